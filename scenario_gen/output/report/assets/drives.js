"use strict";
// Replays of drives in closed loop: one is shown, the table's rows choose which.

const all = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
let shown = null;
let playing = false;
let last = 0;

function show(number) {
  const drive = all.drives[number];
  if (!drive) return;
  const motion = new Trajectories(drive.motion);
  const box = motion.grow([Infinity, Infinity, -Infinity, -Infinity]);
  drive.witness.forEach(([x, y]) => {
    box[0] = Math.min(box[0], x);
    box[1] = Math.min(box[1], y);
    box[2] = Math.max(box[2], x);
    box[3] = Math.max(box[3], y);
  });
  shown = { drive, motion, view: new View(byId("stage"), box, 8), duration: motion.durations[0] };
  const chosen = [...document.querySelectorAll(`[data-show="${number}"]`)].pop(); // a planner's verdict in a row, or the row
  document.querySelectorAll("[data-show]").forEach((each) => each.setAttribute("aria-current", String(each === chosen || each === chosen.closest("tr"))));
  byId("title").textContent = `Scenario ${drive.name}: ${drive.sentence}`;
  listFigures(chosen.closest("tr"));
  byId("time").value = 0;
  draw();
}

// What the row of a drive says, under its heads, in the columns that the table hides too.
function listFigures(row) {
  const list = byId("figures");
  list.replaceChildren();
  const heads = row.closest("table").querySelectorAll("thead th");
  row.querySelectorAll("td").forEach((cell, k) => {
    if (k < 2) return;
    const name = document.createElement("dt");
    const value = document.createElement("dd");
    name.textContent = heads[k].textContent;
    value.textContent = cell.textContent;
    list.append(name, value);
  });
}

function draw() {
  if (!shown) return;
  const { drive, motion, view, duration } = shown;
  const share = Number(byId("time").value);
  const time = share * duration;
  const context = view.begin();
  view.road(all.roads[drive.road]);
  view.lights(motion.lights[0], time);
  context.globalAlpha = 0.9;
  context.lineWidth = 1;
  context.strokeStyle = themed("ink");
  context.beginPath();
  drive.witness.forEach(([x, y], i) => (i ? context.lineTo(view.x(x), view.y(y)) : context.moveTo(view.x(x), view.y(y))));
  context.stroke();
  const readout = byId("readout");
  readout.replaceChildren();
  drive.vehicles.forEach((vehicle, n) => {
    const [came, gone] = drive.spans[n];
    const there = n === drive.ego || (time >= came - 1e-6 && time <= gone + 1e-6);
    const state = motion.state(0, n, share);
    const colour = n === drive.ego ? themed("ink") : vehicleColour(n);
    if (there) {
      context.globalAlpha = 0.35;
      context.lineWidth = 2;
      context.strokeStyle = colour;
      motion.path(context, view, 0, n, Math.min(came / Math.max(duration, 1e-9), share), share);
      view.footprint(state, vehicle, colour, n === drive.ego ? 1 : 0.85, true);
      if (n === drive.ego) view.outline(state, { length: vehicle.length + 0.6, width: vehicle.width + 0.6 }, colour);
      view.label(state.x, state.y, n === drive.ego ? `ego (${vehicle.id})` : vehicle.id, colour);
    }
    const item = document.createElement("li");
    const chip = document.createElement("i");
    chip.style.background = colour;
    const speed = document.createElement("b");
    speed.textContent = there ? `${state.speed.toFixed(1)} m/s` : "not there";
    item.append(chip, `${vehicle.id} `, speed);
    readout.append(item);
  });
  if (drive.hit !== null && time >= drive.hit - 0.05) {
    const ego = motion.state(0, drive.ego, drive.hit / Math.max(duration, 1e-9));
    view.dot(ego.x, ego.y, "#dc2626", 7);
  }
  view.ruler();
  byId("clock").textContent = `${time.toFixed(1)} / ${duration.toFixed(1)} s`;
}

function tick(now) {
  if (!playing) return;
  const slider = byId("time");
  const next = Number(slider.value) + (now - last) / 1000 / Math.max(shown.duration, 0.1);
  last = now;
  slider.value = Math.min(next, 1);
  draw();
  if (next >= 1) playing = false;
  byId("play").textContent = playing ? "❚❚" : "▶";
  if (playing) requestAnimationFrame(tick);
}

function toggle() {
  if (!shown) return;
  playing = !playing;
  if (playing && Number(byId("time").value) >= 1) byId("time").value = 0;
  byId("play").textContent = playing ? "❚❚" : "▶";
  last = performance.now();
  if (playing) requestAnimationFrame(tick);
}

byId("play")?.addEventListener("click", toggle);
document.addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target.closest("button, input, select, summary")) return;
  event.preventDefault();
  toggle();
});
byId("time")?.addEventListener("input", draw);
document.querySelectorAll("[data-show]").forEach((each) => each.addEventListener("click", (event) => {
  event.stopPropagation();
  show(Number(each.dataset.show));
}));
window.addEventListener("resize", draw);

/** A link to a scenario, #s12, shows its replay. */
const linked = () => {
  const number = /^#s(\d+)$/.exec(location.hash)?.[1] ?? 0;
  return Number(byId(`s${number}`)?.dataset.show ?? number);
};
window.addEventListener("hashchange", () => show(linked()));
show(linked());
