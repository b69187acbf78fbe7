"use strict";
// The still figures of one case: maps on canvases, the rest with plotly.

const PLOT = { displayModeBar: false, scrollZoom: false };
const LAYOUT = {
  margin: { l: 46, r: 10, t: 10, b: 38 },
  paper_bgcolor: "rgba(0,0,0,0)",
  plot_bgcolor: "rgba(0,0,0,0)",
  font: { family: "system-ui, sans-serif", size: 12, color: "#334155" },
  showlegend: false,
  hovermode: "closest",
};
const HEAT = ["#313695", "#4575b4", "#74add1", "#abd9e9", "#ffffbf", "#fdae61", "#f46d43", "#d73027", "#a50026"].map((c, i) => [i / 8, c]);
const GRID = { gridcolor: "#e2e8f0", zeroline: false };

/** A name or sentence out of the data for plotly, which takes some HTML and %{…} in its texts: all of it is shown as it is. */
const PLAIN = { "&": "&amp;", "<": "&lt;", ">": "&gt;", "{": "&#123;" };
const plain = (text) => text.replace(/[&<>{]/g, (sign) => PLAIN[sign]);

function plot(place, traces, layout) {
  if (place) Plotly.newPlot(place, traces, { ...LAYOUT, ...layout }, PLOT);
}

/** Time of each frame of a sample. */
function clock(set, sample) {
  return Array.from({ length: set.frames }, (_, f) => +((set.durations[sample] * f) / (set.frames - 1)).toFixed(3));
}

function speeds(set, sample, vehicle) {
  const at = (f) => +set.values[set.offset(sample, vehicle, f) + 3].toFixed(2);
  return Array.from({ length: set.frames }, (_, f) => (set.there(sample, vehicle, f / (set.frames - 1)) ? at(f) : null));
}

/** How one figure is distributed over the set, with the template's place in it. */
function drawSpread(place, figure) {
  const values = figure.values.filter((value) => value !== null);
  const unit = plain(figure.unit);
  const shapes = figure.template === null ? [] : [{
    type: "line", xref: "x", yref: "paper", x0: figure.template, x1: figure.template, y0: 0, y1: 1, line: { color: "#0f172a", width: 2, dash: "dash" },
  }];
  plot(place, [{ x: values, type: "histogram", nbinsx: 20, marker: { color: "#2563eb", opacity: 0.75 }, hovertemplate: `%{y} at %{x} ${unit}<extra></extra>` }], {
    shapes, margin: { l: 34, r: 8, t: 6, b: 40 }, bargap: 0.06,
    xaxis: { ...GRID, title: { text: `${plain(figure.label)} [${unit}], ${values.length} of ${figure.values.length}`, standoff: 6, font: { size: 11 } } },
    yaxis: { ...GRID, rangemode: "tozero" },
  });
}

/** Figure 3: speed over time on the colours of its primitives, and the probability of a changepoint below. */
function drawTemplate(place, data, template) {
  const { bounds, labels, descriptions, probability, probability_step: step } = data.template;
  const traces = data.vehicles.map((vehicle, n) => ({
    x: clock(template, 0), y: speeds(template, 0, n), name: plain(vehicle.id), mode: "lines",
    line: { color: vehicleColour(n), width: 2.5 }, hovertemplate: "%{y:.1f} m/s at %{x:.1f} s<extra>" + plain(vehicle.id) + "</extra>",
  }));
  traces.push({
    x: probability.map((_, i) => +(i * step).toFixed(2)), y: probability, yaxis: "y2", name: "changepoint probability",
    mode: "lines", fill: "tozeroy", line: { color: "#475569", width: 1, shape: "hvh" }, hovertemplate: "p = %{y:.2f} at %{x:.1f} s<extra></extra>",
  });
  const shapes = labels.map((label, k) => ({
    type: "rect", xref: "x", yref: "paper", x0: bounds[k], x1: bounds[k + 1], y0: 0.3, y1: 1,
    fillcolor: primitiveColour(label), opacity: 0.2, line: { width: 0 }, layer: "below",
  }));
  bounds.slice(1, -1).forEach((time) => shapes.push({
    type: "line", xref: "x", yref: "paper", x0: time, x1: time, y0: 0, y1: 1, line: { color: "#334155", width: 1, dash: "dot" },
  }));
  traces.push({
    x: labels.map((_, k) => (bounds[k] + bounds[k + 1]) / 2), y: labels.map(() => 0), mode: "markers",
    marker: { size: 14, opacity: 0 }, text: descriptions.map(plain), hovertemplate: "%{text}<extra></extra>",
  });
  plot(place, traces, {
    shapes,
    xaxis: { ...GRID, anchor: "y2", title: { text: "time [s]", standoff: 6 }, range: [0, bounds[bounds.length - 1]] },
    yaxis: { ...GRID, title: { text: "speed [m/s]", standoff: 6 }, domain: [0.3, 1], rangemode: "tozero" },
    yaxis2: { ...GRID, title: { text: "p", standoff: 6 }, domain: [0, 0.22], range: [0, 1.05] },
  });
}

/** Figure 4, lower half: the speeds of all samples, the template's dashed. */
function drawSpeeds(place, data, set, template, top) {
  const traces = [];
  data.vehicles.forEach((_, n) => {
    const x = [];
    const y = [];
    for (let s = 0; s < (isEgo(data, n) ? 1 : set.samples); s += 1) {
      x.push(...clock(set, s), null);
      y.push(...speeds(set, s, n), null);
    }
    const line = { color: vehicleColour(n), width: isEgo(data, n) ? 2 : 1, dash: isEgo(data, n) ? "dash" : "solid" };
    traces.push({ x, y, mode: "lines", line, opacity: Math.max(0.3, 1 - set.samples / 30), hoverinfo: "skip" });
  });
  data.vehicles.forEach((_, n) => traces.push({
    x: clock(template, 0), y: speeds(template, 0, n), mode: "lines",
    line: { color: "#0f172a", width: 1.5, dash: "dash" }, hoverinfo: "skip",
  }));
  plot(place, traces, {
    xaxis: { ...GRID, title: { text: "time [s]", standoff: 6 } },
    yaxis: { ...GRID, title: { text: "speed [m/s]", standoff: 6 }, range: [0, top] },
  });
}

/** One vehicle's speed, acceleration and lateral acceleration: the template bold, samples (all, or the one chosen) thin. */
function drawMotion(place, motion, colour, chosen) {
  const traces = [];
  const add = (packed, line) => {
    const { shape: [frames, channels], low, step, data } = packed.values;
    const whole = new Uint16Array(bytesOf(data).buffer);
    const x = Array.from({ length: frames }, (_, f) => +(packed.from + ((packed.to - packed.from) * f) / (frames - 1)).toFixed(2));
    for (let c = 0; c < channels; c += 1) {
      const y = Array.from({ length: frames }, (_, f) => +(low[c] + step[c] * whole[f * channels + c]).toFixed(3));
      traces.push({ x, y, yaxis: `y${c ? c + 1 : ""}`, mode: "lines", line, hoverinfo: "skip" });
    }
  };
  motion.samples.forEach((sample, s) => {
    if (chosen < 0 || chosen === s) add(sample, { color: colour, width: chosen < 0 ? 1 : 2 });
  });
  add(motion.template, { color: "#0f172a", width: 2.5 });
  const axis = (title, domain) => ({ ...GRID, title: { text: title, standoff: 6, font: { size: 11 } }, domain });
  plot(place, traces, {
    xaxis: { ...GRID, anchor: "y3", title: { text: "time [s]", standoff: 6 } },
    yaxis: { ...axis("speed [m/s]", [0.7, 1]), rangemode: "tozero" },
    yaxis2: axis("acceleration [m/s²]", [0.35, 0.65]),
    yaxis3: axis("lateral [m/s²]", [0, 0.3]),
  });
}

/** Figure 5: the mean feature matrices. */
function drawFeature(place, text, duration, vehicles) {
  const bytes = bytesOf(text);
  const side = Math.round(Math.sqrt(bytes.length));
  const z = Array.from({ length: side }, (_, i) => Array.from(bytes.subarray(i * side, (i + 1) * side), (v) => +(v / 255).toFixed(3)));
  const step = duration / (side - 1);
  const trace = {
    type: "heatmap", x0: 0, dx: step, y0: 0, dy: step, z, zmin: 0, zmax: 1, colorscale: HEAT, zsmooth: "fast", showscale: false,
    hovertemplate: "%{y:.1f} s, %{x:.1f} s: %{z:.2f}<extra></extra>",
  };
  const short = (name) => (name.length > 9 ? `${name.slice(0, 8)}…` : name);
  const axis = { ticks: "", showgrid: false, zeroline: false, nticks: 4, tickfont: { size: 10 } };
  plot(place, [trace], {
    margin: { l: 34, r: 4, t: 4, b: 32 },
    xaxis: { ...axis, title: { text: `${plain(short(vehicles[1]))} [s]`, font: { size: 10 }, standoff: 2 } },
    yaxis: { ...axis, title: { text: `${plain(short(vehicles[0]))} [s]`, font: { size: 10 }, standoff: 2 }, scaleanchor: "x", constrain: "domain" },
  });
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
      view.dot(at.x, at.y, "#1e293b", 3.5);
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
function drawRoutes(view, data, picture) {
  const context = view.begin();
  view.road(data.road, picture);
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
function drawSamples(view, data, picture, set, arm) {
  const context = view.begin();
  view.road(data.road, picture);
  data.vehicles.forEach((_, n) => {
    context.strokeStyle = vehicleColour(n);
    context.lineWidth = 1.2;
    context.globalAlpha = Math.max(0.18, Math.min(1, 8 / set.samples));
    if (isEgo(data, n)) {
      context.globalAlpha = 1;
      context.lineWidth = 2;
      context.setLineDash([7, 5]);
      set.path(context, view, 0, n);
      context.setLineDash([]);
    } else for (let s = 0; s < set.samples; s += 1) set.path(context, view, s, n);
  });
  data.fit.forEach((vehicle, n) => {
    const last = vehicle.anchors.length - 1;
    vehicle.anchors.forEach(([x, y], k) => { if (arm === "with" || k === 0 || k === last) view.dot(x, y, vehicleColour(n), 3); });
  });
  view.ruler();
}
