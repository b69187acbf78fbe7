"use strict";
// Charts as SVG: panels below each other on one axis of time, each with lines, bands and bars; colours are those of the style sheet.

const SVG = "http://www.w3.org/2000/svg";

function svgElement(name, attributes, parent, text) {
  const element = document.createElementNS(SVG, name);
  Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));
  if (text !== undefined) element.textContent = text;
  if (parent) parent.append(element);
  return element;
}

/** Round numbers between low and high, about `count` of them. */
function ticks(low, high, count) {
  const rough = Math.max(high - low, 1e-9) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((n) => n * power).find((s) => s >= rough * 0.999);
  const found = [];
  for (let value = Math.ceil(low / step - 1e-9) * step; value <= high + 1e-9 * step; value += step) found.push(+value.toPrecision(6));
  return found;
}

function extent(values, low = Infinity, high = -Infinity) {
  values.forEach((value) => { if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); } });
  return [low, high];
}

/**
 * Draw a chart into a place.
 * @param spec {label, x: {title, range?}, panels: [{title, share, range?, lines, bands?, marks?, bars?}]}
 *   lines: {x, y (null parts it), colour, width, dash?, opacity?, fill?, name?}; bands: {from, to, colour, name}; marks: [x];
 *   bars: {from, to, count, choose?}, the last called by a click; `cursor`: a line that `place.moveCursor(x)` moves, and what a click on an x calls.
 */
function chart(place, spec) {
  if (!place) return;
  if (place.chart !== spec) place.zoomed = null;
  place.chart = spec;
  const width = Math.max(place.clientWidth, 240);
  const height = Math.max(place.clientHeight, 120);
  const root = svgElement("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", class: "plot" });
  svgElement("title", {}, root, spec.label);
  const [left, right, top, bottom] = [48, 10, 8, 38];
  const all = spec.panels.flatMap((panel) => [...panel.lines.map((line) => line.x), ...(panel.bars || []).map((bar) => [bar.from, bar.to])]);
  const whole = spec.x.range || all.reduce((grown, x) => extent(x, ...grown), [Infinity, -Infinity]);
  const [x0, x1] = place.zoomed || whole;
  const inner = width - left - right;
  const px = (x) => left + (inner * (x - x0)) / (x1 - x0 || 1);
  const inside = () => svgElement("svg", { x: left, y: 0, width: inner, height, viewBox: `${left} 0 ${inner} ${height}` }, root); // cuts off what the zoom leaves out
  const gap = 16;
  const room = height - top - bottom - gap * (spec.panels.length - 1);
  let upper = top;
  spec.panels.forEach((panel) => {
    const tall = room * panel.share;
    const bars = panel.bars || [];
    let [y0, y1] = panel.range || panel.lines.reduce((grown, line) => extent(line.y, ...grown), extent(bars.map((bar) => bar.count), 0, 1));
    if (!(y1 > y0)) [y0, y1] = [y0 - 1, y0 + 1];
    if (!panel.range) [y0, y1] = [panel.zero || bars.length ? Math.min(0, y0) : y0 - 0.05 * (y1 - y0), y1 + 0.05 * (y1 - y0)];
    const base = upper;
    const py = (y) => base + tall - (tall * (y - y0)) / (y1 - y0);
    const field = inside();
    (panel.bands || []).forEach((band) => {
      const rectangle = { x: px(band.from), y: base, width: px(band.to) - px(band.from), height: tall, fill: band.colour, "fill-opacity": 0.2 };
      svgElement("title", {}, svgElement("rect", rectangle, field), band.name);
    });
    ticks(y0, y1, Math.max(2, tall / 45)).forEach((value) => {
      svgElement("line", { x1: left, x2: width - right, y1: py(value), y2: py(value), class: "grid" }, root);
      svgElement("text", { x: left - 6, y: py(value) + 4, "text-anchor": "end" }, root, String(value));
    });
    (panel.marks || []).forEach((at) => svgElement("line", { x1: px(at), x2: px(at), y1: base, y2: base + tall, class: "mark" }, field));
    bars.forEach((bar) => {
      const shape = svgElement("rect", { x: px(bar.from) + 0.5, y: py(bar.count), width: Math.max(px(bar.to) - px(bar.from) - 1, 1), height: py(0) - py(bar.count), class: "bar" }, root);
      svgElement("title", {}, shape, `${bar.count} from ${+bar.from.toPrecision(3)} to ${+bar.to.toPrecision(3)}`);
      if (bar.choose) {
        shape.classList.add("choice");
        shape.addEventListener("click", bar.choose);
      }
    });
    panel.lines.forEach((line) => {
      let path = "";
      let pen = false;
      line.x.forEach((x, i) => {
        const y = line.y[i];
        if (y === null || x === null) { pen = false; return; }
        path += `${pen ? "L" : "M"}${px(x).toFixed(1)} ${py(y).toFixed(1)}`;
        pen = true;
      });
      const style = { d: path, fill: "none", "stroke-width": line.width, "stroke-opacity": line.opacity || 1, class: line.colour ? "" : "ink" };
      if (line.colour) style.stroke = line.colour;
      if (line.dash) style["stroke-dasharray"] = line.dash;
      if (line.fill) svgElement("path", { d: `${path}V${py(0).toFixed(1)}H${px(line.x[0]).toFixed(1)}Z`, class: "area" }, field);
      const drawn = svgElement("path", style, field);
      if (line.name) svgElement("title", {}, drawn, line.name);
    });
    svgElement("text", { x: 12, y: base + tall / 2, transform: `rotate(-90 12 ${base + tall / 2})`, "text-anchor": "middle" }, root, panel.title);
    upper += tall + gap;
  });
  ticks(x0, x1, Math.max(2, (width - left - right) / 80)).forEach((value) => {
    svgElement("line", { x1: px(value), x2: px(value), y1: top, y2: height - bottom, class: "grid" }, root);
    svgElement("text", { x: px(value), y: height - bottom + 14, "text-anchor": "middle" }, root, String(value));
  });
  svgElement("text", { x: (left + width - right) / 2, y: height - 6, "text-anchor": "middle" }, root, spec.x.title);
  if (spec.cursor) {
    const cursor = svgElement("line", { x1: left, x2: left, y1: top, y2: height - bottom, class: "cursor" }, inside());
    place.moveCursor = (x) => ["x1", "x2"].forEach((end) => cursor.setAttribute(end, px(x)));
    place.moveCursor(place.cursorAt || 0);
  }
  place.replaceChildren(root);
  if (!spec.zoom) return;
  const guide = svgElement("line", { y1: top, y2: height - bottom, class: "guide", visibility: "hidden" }, root);
  const values = svgElement("text", { x: left + 6, y: top + 10, class: "values" }, root);
  place.field = { left, inner, whole, shown: [x0, x1], px, guide, values };
  place.append(zoomButtons(place));
  if (!place.listens) listen(place);
  place.listens = true;
}

/** Show another range of x, at most all of it. */
function zoomTo(place, from, span) {
  const [low, high] = place.field.whole;
  const width = Math.min(span, high - low);
  const start = Math.min(Math.max(from, low), high - width);
  place.zoomed = width < high - low ? [start, start + width] : null;
  chart(place, place.chart);
}

/** Zoom about an x, which stays where it is. */
function zoomBy(place, factor, about) {
  const [x0, x1] = place.field.shown;
  const x = about ?? (x0 + x1) / 2;
  zoomTo(place, x - (x - x0) * factor, (x1 - x0) * factor);
}

function zoomButtons(place) {
  const buttons = document.createElement("span");
  buttons.className = "zoom";
  [["+", "zoom in", 0.5], ["−", "zoom out", 2]].forEach(([text, label, factor]) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.setAttribute("aria-label", label);
    button.title = `${label}; Ctrl and the wheel zoom, too, a drag moves, a double click shows all`;
    button.addEventListener("click", (event) => { event.stopPropagation(); zoomBy(place, factor); place.querySelector(`[aria-label="${label}"]`).focus(); });
    buttons.append(button);
  });
  return buttons;
}

/** Show the values under the pointer; pan by dragging; a click moves the cursor. */
function listen(place) {
  const at = (event) => {
    const { left, inner, shown: [x0, x1] } = place.field;
    return x0 + Math.min(Math.max((event.clientX - place.getBoundingClientRect().left - left) / inner, 0), 1) * (x1 - x0);
  };
  let drag = null;
  place.addEventListener("pointerdown", (event) => { drag = { pixel: event.clientX, range: place.field.shown, moved: false }; });
  place.addEventListener("pointermove", (event) => {
    if (drag && event.buttons && place.zoomed && (drag.moved || Math.abs(event.clientX - drag.pixel) > 4)) {
      drag.moved = true;
      const [x0, x1] = drag.range;
      zoomTo(place, x0 - ((event.clientX - drag.pixel) / place.field.inner) * (x1 - x0), x1 - x0);
    }
    showValues(place, at(event));
  });
  place.addEventListener("pointerleave", () => { place.field.guide.setAttribute("visibility", "hidden"); place.field.values.textContent = ""; });
  place.addEventListener("click", (event) => {
    if (place.chart.cursor && !(drag && drag.moved)) place.chart.cursor(at(event));
    drag = null;
  });
  place.addEventListener("dblclick", () => zoomTo(place, -Infinity, Infinity));
  place.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return; // the wheel alone scrolls the page
    event.preventDefault();
    zoomBy(place, event.deltaY < 0 ? 0.8 : 1.25, at(event));
  }, { passive: false });
}

function showValues(place, x) {
  const { guide, values, px } = place.field;
  const named = place.chart.panels.flatMap((panel) => panel.lines.filter((line) => line.name).map((line) => [line.name, valuesAt(line, x)])).filter(([, found]) => found.length);
  const text = ([name, found]) => `${name}: ${[...new Set([Math.min(...found), Math.max(...found)].map((value) => value.toFixed(1)))].join(" to ")}`;
  values.textContent = [`${x.toFixed(1)} s`, ...(named.length > 12 ? [] : named.map(text))].join("  ·  ");
  ["x1", "x2"].forEach((end) => guide.setAttribute(end, px(x)));
  guide.setAttribute("visibility", "visible");
}

/** The values of a line at an x, between its points: one for each of its strokes. */
function valuesAt(line, x) {
  const found = [];
  for (let i = 0; i + 1 < line.x.length; i += 1) {
    const [a, b, low, high] = [line.x[i], line.x[i + 1], line.y[i], line.y[i + 1]];
    if (a !== null && b !== null && low !== null && high !== null && x >= a && x < b) found.push(low + ((high - low) * (x - a)) / (b - a));
  }
  return found;
}

/** Draw every chart below an element again, in the size of its place. */
function redraw(section) {
  section.querySelectorAll(".chart").forEach((place) => { if (place.chart) chart(place, place.chart); });
}
