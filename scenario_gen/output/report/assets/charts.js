"use strict";
// The still figures of one case: maps on canvases, the rest as charts.

const HEAT = ["#313695", "#4575b4", "#74add1", "#abd9e9", "#ffffbf", "#fdae61", "#f46d43", "#d73027", "#a50026"].map((c) => [1, 3, 5].map((i) => parseInt(c.slice(i, i + 2), 16)));

/** Time of each frame of a sample. */
function clock(set, sample) {
  return Array.from({ length: set.frames }, (_, f) => +((set.durations[sample] * f) / (set.frames - 1)).toFixed(3));
}

function speeds(set, sample, vehicle) {
  const at = (f) => +set.values[set.offset(sample, vehicle, f) + 3].toFixed(2);
  return Array.from({ length: set.frames }, (_, f) => (set.there(sample, vehicle, f / (set.frames - 1)) ? at(f) : null));
}

/** How one figure is distributed over the set, with the recording's place in it; `choose(k)` shows the k-th scenario, or is null if it is not drawn. */
function drawSpread(place, figure, choose) {
  const values = figure.values.filter((value) => value !== null);
  const [low, high] = values.length ? extent(values) : [0, 1];
  const count = high > low ? 20 : 1;
  const step = (high - low || 1) / count;
  const bars = Array.from({ length: count }, (_, k) => ({ from: low + k * step, to: low + (k + 1) * step, count: 0 }));
  figure.values.forEach((value, k) => {
    if (value === null) return;
    const bar = bars[Math.min(count - 1, Math.floor((value - low) / step))];
    bar.count += 1;
    bar.choose = bar.choose || choose(k);
  });
  const title = `${figure.label} [${figure.unit}], ${values.length} of ${figure.values.length}`;
  const marks = figure.template === null ? [] : [figure.template];
  const range = extent([...marks, low, high === low ? low + 1 : high]);
  chart(place, { label: title, x: { title, range }, panels: [{ title: "", share: 1, lines: [], bars: bars.filter((bar) => bar.count), marks }] });
}

/** Figure 3: speed over time on the colours of its primitives, and the probability of a changepoint below. */
function drawTemplate(place, data, template) {
  const { bounds, labels, descriptions, probability, probability_step: step } = data.template;
  const lines = data.vehicles.map((vehicle, n) => ({
    x: clock(template, 0), y: speeds(template, 0, n), name: vehicle.id, colour: vehicleColour(n), width: 2.5,
  }));
  const bands = labels.map((label, k) => ({ from: bounds[k], to: bounds[k + 1], colour: primitiveColour(label), name: descriptions[k] }));
  const marks = bounds.slice(1, -1);
  const likely = { x: probability.map((_, i) => +(i * step).toFixed(2)), y: probability, width: 1, fill: true, name: "probability of a changepoint" };
  chart(place, {
    label: `${data.made} speeds, and below them the probability of a changepoint`,
    x: { title: "time [s]", range: [0, bounds[bounds.length - 1]] },
    zoom: true,
    panels: [
      { title: "speed [m/s]", share: 0.75, zero: true, lines, bands, marks },
      { title: "p", share: 0.25, range: [0, 1.05], lines: [likely], marks },
    ],
  });
}

/** The speeds of one scenario, those of the recording on its own clock dashed, under a cursor. */
function drawSpeedsNow(place, data, set, sample, template, cursor) {
  const lines = data.vehicles.flatMap((vehicle, n) => [
    { x: clock(template, 0), y: speeds(template, 0, n), colour: vehicleColour(n), width: 1.2, dash: "5 4", name: `${vehicle.id}, ${data.made}` },
    { x: clock(set, sample), y: speeds(set, sample, n), colour: vehicleColour(n), width: 2.2, name: vehicle.id },
  ]);
  chart(place, { label: `speeds of the shown scenario; dashed: ${data.made}`, x: { title: "time [s]" }, cursor, zoom: true, panels: [{ title: "speed [m/s]", share: 1, zero: true, lines }] });
}

/** Figure 4, lower half: the speeds of all scenarios, those of the recording dashed. */
function drawSpeeds(place, data, set, template, top) {
  const lines = [];
  data.vehicles.forEach((vehicle, n) => {
    const x = [];
    const y = [];
    for (const s of isEgo(data, n) ? [0] : set.shown) {
      x.push(...clock(set, s), null);
      y.push(...speeds(set, s, n), null);
    }
    lines.push({ x, y, colour: vehicleColour(n), width: isEgo(data, n) ? 2 : 1, dash: isEgo(data, n) ? "7 5" : "", opacity: Math.max(0.3, 1 - set.shown.length / 30), name: vehicle.id });
  });
  data.vehicles.forEach((vehicle, n) => lines.push({ x: clock(template, 0), y: speeds(template, 0, n), width: 1.5, dash: "6 4", name: `${vehicle.id}, ${data.made}` }));
  chart(place, { label: `speeds of all scenarios; dashed: ${data.made}`, x: { title: "time [s]" }, zoom: true, panels: [{ title: "speed [m/s]", share: 1, range: [0, top], lines }] });
}

/** One vehicle's speed, acceleration and lateral acceleration: the recording bold, scenarios (the drawn ones, or the one chosen) thin. */
function drawMotion(place, data, set, template, n, chosen) {
  const lines = [[], [], []];
  const add = (clip, sample, line) => {
    const x = clock(clip, sample);
    const speed = speeds(clip, sample, n);
    const yaw = x.map((_, f) => clip.values[clip.offset(sample, n, f) + 2]);
    const slope = (values) => x.map((_, f) => {
      const [a, b] = [Math.max(f - 1, 0), Math.min(f + 1, x.length - 1)];
      return values[a] === null || values[b] === null ? null : +((values[b] - values[a]) / (x[b] - x[a])).toFixed(3);
    });
    const turning = slope(yaw);
    [speed, slope(speed), speed.map((v, f) => (v === null ? null : +(v * turning[f]).toFixed(3)))].forEach((y, c) => lines[c].push({ ...line, x, y }));
  };
  const drawn = set && !isEgo(data, n) ? set.shown.filter((s) => chosen < 0 || s === chosen) : [];
  drawn.forEach((s) => add(set, s, { colour: vehicleColour(n), width: chosen < 0 ? 1 : 2, opacity: drawn.length > 12 ? 0.4 : 1, name: `scenario ${set.index[s]}` }));
  add(template, 0, { width: 2.5, name: data.made });
  const titles = ["speed [m/s]", "acceleration [m/s²]", "lateral [m/s²]"];
  const panels = titles.map((title, c) => ({ title, share: 1 / 3, zero: c === 0, lines: lines[c] }));
  chart(place, { label: `speed and accelerations over time; black: ${data.made}`, x: { title: "time [s]" }, zoom: true, panels });
}

/** Figure 5: the mean feature matrices. */
function drawFeature(place, text, duration, vehicles) {
  const bytes = bytesOf(text);
  const side = Math.round(Math.sqrt(bytes.length));
  const canvas = document.createElement("canvas");
  canvas.width = side;
  canvas.height = side;
  const context = canvas.getContext("2d");
  const image = context.createImageData(side, side);
  bytes.forEach((value, i) => {
    const at = (value / 255) * (HEAT.length - 1);
    const k = Math.min(Math.floor(at), HEAT.length - 2);
    const colour = HEAT[k].map((c, j) => c + (HEAT[k + 1][j] - c) * (at - k));
    image.data.set([...colour, 255], 4 * ((side - 1 - Math.floor(i / side)) * side + (i % side)));
  });
  context.putImageData(image, 0, 0);
  const short = (name) => (name.length > 9 ? `${name.slice(0, 8)}…` : name);
  const [width, left, bottom] = [240, 34, 32];
  const inner = width - left - 4;
  const root = svgElement("svg", { viewBox: `0 0 ${width} ${width - 4}`, role: "img", class: "plot" });
  svgElement("title", {}, root, `distance of ${vehicles.join(" and ")} at each pair of times`);
  svgElement("image", { href: canvas.toDataURL(), x: left, y: 2, width: inner, height: inner, preserveAspectRatio: "none" }, root);
  ticks(0, duration, 4).forEach((value) => {
    const at = (inner * value) / duration;
    svgElement("text", { x: left + at, y: inner + 14, "text-anchor": "middle" }, root, String(value));
    svgElement("text", { x: left - 4, y: inner - at + 6, "text-anchor": "end" }, root, String(value));
  });
  svgElement("text", { x: left + inner / 2, y: inner + bottom - 6, "text-anchor": "middle" }, root, `${short(vehicles[1])} [s]`);
  svgElement("text", { x: 9, y: inner / 2, transform: `rotate(-90 9 ${inner / 2})`, "text-anchor": "middle" }, root, `${short(vehicles[0])} [s]`);
  place.replaceChildren(root);
}

/** The template over the ground it was recorded on, coloured by primitive. */
function drawTemplateMap(view, data, template) {
  const context = view.begin();
  const { bounds, labels } = data.template;
  const end = bounds[bounds.length - 1];
  data.vehicles.forEach((vehicle, n) => {
    context.globalAlpha = 1;
    context.lineWidth = Math.max(4, Math.min(10, vehicle.width * view.scale));
    labels.forEach((label, k) => {
      context.strokeStyle = primitiveColour(label);
      template.path(context, view, 0, n, bounds[k] / end, bounds[k + 1] / end);
    });
    context.lineWidth = 1.5;
    context.strokeStyle = vehicleColour(n);
    template.path(context, view, 0, n);
    bounds.slice(1, -1).forEach((time) => {
      const at = template.state(0, n, time / end);
      view.dot(at.x, at.y, themed("ink"), 3.5);
    });
  });
  data.vehicles.forEach((vehicle, n) => {
    const start = template.state(0, n, 0);
    view.footprint(start, vehicle, vehicleColour(n), 1, true);
    view.label(start.x, start.y, vehicle.id, vehicleColour(n));
  });
  view.ruler();
}

/** Planned routes and fitted changepoints on the road. */
function drawRoutes(view, data) {
  const context = view.begin();
  view.road(data.road);
  data.fit.forEach((vehicle, n) => {
    context.globalAlpha = 1;
    context.strokeStyle = vehicleColour(n);
    context.lineWidth = 2.5;
    context.beginPath();
    vehicle.route.forEach(([x, y], i) => (i ? context.lineTo(view.x(x), view.y(y)) : context.moveTo(view.x(x), view.y(y))));
    context.stroke();
    vehicle.anchors.forEach(([x, y, yaw], k) => {
      if (k === 0) view.footprint({ x, y, yaw }, data.vehicles[n], vehicleColour(n), 1, true);
      else if (k === vehicle.anchors.length - 1) view.footprint({ x, y, yaw }, data.vehicles[n], vehicleColour(n), 0.35, true);
      else view.dot(x, y, vehicleColour(n));
    });
    view.label(vehicle.anchors[0][0], vehicle.anchors[0][1], data.vehicles[n].id, vehicleColour(n));
  });
  view.ruler();
}

/** Figure 4, upper half: all samples of one arm on the road. */
function drawSamples(view, data, set, arm) {
  const context = view.begin();
  view.road(data.road);
  data.vehicles.forEach((_, n) => {
    context.strokeStyle = vehicleColour(n);
    context.lineWidth = 1.2;
    context.globalAlpha = Math.max(0.18, Math.min(1, 8 / Math.max(set.shown.length, 1)));
    if (isEgo(data, n)) {
      context.globalAlpha = 1;
      context.lineWidth = 2;
      context.setLineDash([7, 5]);
      set.path(context, view, 0, n);
      context.setLineDash([]);
    } else set.shown.forEach((s) => set.path(context, view, s, n));
  });
  data.fit.forEach((vehicle, n) => {
    const last = vehicle.anchors.length - 1;
    vehicle.anchors.forEach(([x, y], k) => { if (arm === "with" || k === 0 || k === last) view.dot(x, y, vehicleColour(n), 3); });
  });
  view.ruler();
}
