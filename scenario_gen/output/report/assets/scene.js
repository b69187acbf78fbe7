"use strict";
// Trajectories, the road, and how they are drawn on a canvas.

const VEHICLE_COLOURS = ["#2563eb", "#e2590c", "#0d9488", "#9333ea", "#c2185b", "#65780b", "#0e7490", "#7c4a21", "#4b5563"];
const PRIMITIVE_COLOURS = ["#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#b07aa1", "#edc948", "#76b7b2", "#ff9da7", "#9c755f", "#79706e"];
/** What is painted on a road: width, dash and gap in metres; 0 is filled. */
const PAINT = {
  edge: [0.15], lane: [0.12, 3, 4.5], centre: [0.15, 3, 1.5], stop: [0.5], give_way: [0.4, 0.6, 0.4], arrow: [0], zebra: [0.5], obstacle: [0],
};
const LIGHT_COLOURS = { green: "#16a34a", yellow: "#eab308", red: "#dc2626", red_yellow: "#f97316" };
const vehicleColour = (n) => VEHICLE_COLOURS[n % VEHICLE_COLOURS.length];
const isEgo = (data, n) => data.left_out.includes(n);
const primitiveColour = (label) => PRIMITIVE_COLOURS[label % PRIMITIVE_COLOURS.length];

/** A colour of the style sheet, which knows whether the page is dark. */
const themed = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function bytesOf(text) {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i += 1) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

/** A set of S scenarios of N vehicles at F frames, channels x, y, yaw, speed. */
class Trajectories {
  constructor(packed) {
    const { shape, low, step, data } = packed.states;
    const whole = new Uint16Array(bytesOf(data).buffer);
    this.values = Float32Array.from(whole, (value, i) => low[i % 4] + step[i % 4] * value);
    [this.samples, this.vehicles, this.frames] = shape;
    this.durations = packed.durations;
    this.presence = packed.there; // of each sample and vehicle, from which to which share of the duration; without: throughout
    this.index = packed.index || [0];
    this.outcome = packed.outcome || [""];
    this.shown = this.index.map((_, k) => k); // the samples that are drawn together
    this.lights = packed.lights || []; // of each sample
  }

  offset(sample, vehicle, frame) {
    return ((sample * this.vehicles + vehicle) * this.frames + frame) * 4;
  }

  /** Whether a vehicle is there at a share (0 to 1) of the sample's duration. */
  there(sample, vehicle, share) {
    if (!this.presence) return true;
    const [from, to] = this.presence[sample][vehicle];
    return share >= from - 1e-4 && share <= to + 1e-4;
  }

  /** The state of a vehicle at a share (0 to 1) of the sample's duration. */
  state(sample, vehicle, share) {
    const at = Math.min(Math.max(share, 0), 1) * (this.frames - 1);
    const frame = Math.min(Math.floor(at), this.frames - 2);
    const part = at - frame;
    const a = this.offset(sample, vehicle, frame);
    const mix = (c) => this.values[a + c] * (1 - part) + this.values[a + 4 + c] * part;
    return { x: mix(0), y: mix(1), yaw: mix(2), speed: mix(3) };
  }

  /** The share of a sample's duration at which two of its vehicles are nearest. */
  meeting(sample) {
    let [best, share] = [Infinity, 0];
    for (let f = 0; f < this.frames; f += 1) {
      const at = f / (this.frames - 1);
      for (let a = 0; a < this.vehicles; a += 1) {
        for (let b = 0; b < a; b += 1) {
          const [i, j] = [this.offset(sample, a, f), this.offset(sample, b, f)];
          const distance = Math.hypot(this.values[i] - this.values[j], this.values[i + 1] - this.values[j + 1]);
          if (distance < best && this.there(sample, a, at) && this.there(sample, b, at)) [best, share] = [distance, at];
        }
      }
    }
    return share;
  }

  /** Grow a box [x0, y0, x1, y1] to hold every position. */
  grow(box) {
    for (let i = 0; i < this.values.length; i += 4) {
      box[0] = Math.min(box[0], this.values[i]);
      box[1] = Math.min(box[1], this.values[i + 1]);
      box[2] = Math.max(box[2], this.values[i]);
      box[3] = Math.max(box[3], this.values[i + 1]);
    }
    return box;
  }

  /** The same motion, turned about the origin. */
  turned(angle) {
    const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
    const turned = Object.assign(Object.create(Trajectories.prototype), this, { values: Float32Array.from(this.values) });
    for (let i = 0; i < this.values.length; i += 4) {
      const [x, y, yaw] = this.values.subarray(i, i + 3);
      turned.values.set([cos * x - sin * y, sin * x + cos * y, yaw + angle], i);
    }
    return turned;
  }

  path(context, view, sample, vehicle, from = 0, to = 1) {
    const first = Math.ceil(from * (this.frames - 1));
    const last = Math.floor(to * (this.frames - 1));
    context.beginPath();
    const start = this.state(sample, vehicle, from);
    context.moveTo(view.x(start.x), view.y(start.y));
    for (let frame = first; frame <= last; frame += 1) {
      const i = this.offset(sample, vehicle, frame);
      context.lineTo(view.x(this.values[i]), view.y(this.values[i + 1]));
    }
    const end = this.state(sample, vehicle, to);
    context.lineTo(view.x(end.x), view.y(end.y));
    context.stroke();
  }
}

/** A canvas that keeps its sharpness and its proportions, and the map from metres to its pixels. */
class View {
  constructor(canvas, box, margin) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.box = [box[0] - margin, box[1] - margin, box[2] + margin, box[3] + margin];
    canvas.style.aspectRatio = `${this.box[2] - this.box[0]} / ${this.box[3] - this.box[1]}`; // within the bounds of the style sheet
  }

  /** Fit the canvas to its place on the page and clear it. */
  begin() {
    const density = Math.min(window.devicePixelRatio || 1, 2);
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    if (this.canvas.width !== Math.round(width * density) || this.canvas.height !== Math.round(height * density)) {
      this.canvas.width = Math.round(width * density);
      this.canvas.height = Math.round(height * density);
    }
    const [x0, y0, x1, y1] = this.box;
    this.scale = Math.min(width / (x1 - x0), height / (y1 - y0));
    const left = (width - this.scale * (x1 - x0)) / 2 - this.scale * x0;
    const bottom = (height + this.scale * (y1 - y0)) / 2 + this.scale * y0;
    this.x = (x) => left + this.scale * x;
    this.y = (y) => bottom - this.scale * y;
    this.width = width;
    this.height = height;
    const context = this.context;
    context.setTransform(density, 0, 0, density, 0, 0);
    context.clearRect(0, 0, width, height);
    context.lineJoin = "round";
    context.lineCap = "round";
    return context;
  }

  road(road) {
    if (!road) return;
    this.context.globalAlpha = 1;
    this.context.fillStyle = "rgba(100, 116, 139, 0.28)";
    this.lines(road.rings, 0);
    this.context.strokeStyle = this.context.fillStyle = themed("lane");
    Object.entries(road.markings).forEach(([kind, lines]) => this.lines(lines, ...PAINT[kind]));
  }

  /** Draw the stop lines of traffic lights in the colours that they show at a time. */
  lights(lights, time) {
    (lights || []).forEach(({ line, starts, states, end, repeats }) => {
      const [first, period] = [starts[0], end - starts[0]];
      const at = repeats ? first + ((((time - first) % period) + period) % period) : time;
      const state = at < end ? states[starts.filter((start) => start <= at).length - 1] : undefined;
      this.context.strokeStyle = LIGHT_COLOURS[state] || themed("soft");
      this.lines([line.flat()], 0.7);
    });
  }

  /** Draw lines, each x, y, x, y … in metres, so many metres wide, with dashes and gaps of so many metres; or fill them. */
  lines(drawn, width, ...dashes) {
    const context = this.context;
    context.lineWidth = Math.max(width * this.scale, 1);
    context.setLineDash(dashes.map((metres) => metres * this.scale));
    context.lineCap = "butt";
    context.beginPath();
    drawn.forEach((line) => {
      for (let i = 0; i < line.length; i += 2) context[i ? "lineTo" : "moveTo"](this.x(line[i]), this.y(line[i + 1]));
    });
    if (width) context.stroke(); else context.fill("evenodd");
    context.setLineDash([]);
    context.lineCap = "round";
  }

  /** A bar that says how long some metres are. */
  ruler() {
    const length = [1, 2, 5, 10, 20, 50, 100, 200, 500].find((l) => l * this.scale > 48) || 1000;
    const context = this.context;
    const y = this.height - 12;
    context.globalAlpha = 1;
    context.strokeStyle = context.fillStyle = themed("soft");
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(12, y - 4);
    context.lineTo(12, y);
    context.lineTo(12 + length * this.scale, y);
    context.lineTo(12 + length * this.scale, y - 4);
    context.stroke();
    context.font = "11px system-ui, sans-serif";
    context.fillText(`${length} m`, 16, y - 5);
  }

  footprint(state, vehicle, colour, alpha, front) {
    const context = this.context;
    context.save();
    context.translate(this.x(state.x), this.y(state.y));
    context.rotate(-state.yaw);
    const length = vehicle.length * this.scale;
    const width = vehicle.width * this.scale;
    context.globalAlpha = alpha;
    context.fillStyle = colour;
    context.beginPath();
    if (vehicle.type === "pedestrian") context.arc(0, 0, length / 2, 0, 2 * Math.PI);
    else if (["bicycle", "e_scooter", "motorcycle"].includes(vehicle.type)) {
      context.ellipse(0, 0, length / 2, width / 5, 0, 0, 2 * Math.PI); // the frame, and across it who rides
      context.rect(-length * 0.08, -width / 2, length * 0.16, width);
    } else if (context.roundRect) context.roundRect(-length / 2, -width / 2, length, width, Math.min(width, length) * 0.22);
    else context.rect(-length / 2, -width / 2, length, width);
    context.fill();
    if (front && !["pedestrian", "bicycle", "e_scooter", "motorcycle"].includes(vehicle.type)) {
      context.fillStyle = "rgba(255,255,255,0.8)";
      context.fillRect(length * 0.16, -width * 0.36, length * 0.14, width * 0.72);
      context.lineWidth = 1;
      context.strokeStyle = "rgba(15,23,42,0.7)";
      context.stroke();
    }
    context.restore();
  }

  /** Where an ego's witness is: a dashed outline, for it is not part of the scenario. */
  outline(state, vehicle, colour) {
    const context = this.context;
    context.save();
    context.translate(this.x(state.x), this.y(state.y));
    context.rotate(-state.yaw);
    context.globalAlpha = 1;
    context.lineWidth = 2;
    context.strokeStyle = colour;
    context.setLineDash([5, 3]);
    const length = vehicle.length * this.scale;
    const width = vehicle.width * this.scale;
    context.strokeRect(-length / 2, -width / 2, length, width);
    context.restore();
  }

  /** A dashed arrow between two vehicles: from the one that reacts to the one it reacts to. */
  arrow(from, to, colour) {
    const context = this.context;
    const [x0, y0, x1, y1] = [this.x(from.x), this.y(from.y), this.x(to.x), this.y(to.y)];
    const angle = Math.atan2(y1 - y0, x1 - x0);
    context.globalAlpha = 0.8;
    context.strokeStyle = colour;
    context.lineWidth = 1.5;
    context.setLineDash([6, 4]);
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
    context.stroke();
    context.setLineDash([]);
    context.beginPath();
    [-0.4, 0.4].forEach((turn) => {
      context.moveTo(x1, y1);
      context.lineTo(x1 - 10 * Math.cos(angle + turn), y1 - 10 * Math.sin(angle + turn));
    });
    context.stroke();
  }

  dot(x, y, colour, radius = 4) {
    const context = this.context;
    context.globalAlpha = 1;
    context.beginPath();
    context.arc(this.x(x), this.y(y), radius, 0, 2 * Math.PI);
    context.fillStyle = colour;
    context.fill();
    context.lineWidth = 1.5;
    context.strokeStyle = "#fff";
    context.stroke();
  }

  /** Write beside a point, above it, or below: to leave what it points at free. */
  label(x, y, text, colour, below = false) {
    const context = this.context;
    const [left, base] = [this.x(x) + 8, this.y(y) + (below ? 24 : -8)];
    context.globalAlpha = 1;
    context.font = "600 12px system-ui, sans-serif";
    context.lineWidth = 3;
    context.strokeStyle = themed("card");
    context.strokeText(text, left, base);
    context.fillStyle = colour;
    context.fillText(text, left, base);
  }
}
