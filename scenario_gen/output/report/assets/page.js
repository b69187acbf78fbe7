"use strict";
// The page: which case is shown, and the player.

const CASES = JSON.parse(document.getElementById("data").textContent);
const ARM_NAMES = { replay: "recording as fitted", with: "with changepoints" };

function option(value, text) {
  const element = document.createElement("option");
  element.value = value;
  element.textContent = text;
  return element;
}

function download(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000); // browsers may read it after the click
}

/** A list entry with a vehicle's colour and name. */
function chipLine(vehicle, n, ...rest) {
  const line = document.createElement("li");
  const chip = document.createElement("i");
  chip.style.background = vehicleColour(n);
  line.append(chip, document.createTextNode(vehicle.type === "car" ? `${vehicle.id} ` : `${vehicle.id}, ${vehicle.type} `), ...rest);
  return line;
}

/** The animation: play, pause, scrub, choose the set and the scenario, or see all scenarios at once. */
class Player {
  constructor(section, data, sets, box, record) {
    this.data = data;
    this.record = record;
    this.sets = sets;
    this.find = (role) => section.querySelector(`[data-role="${role}"]`);
    this.view = new View(this.find("stage"), box, 8);
    this.whole = this.view.box;
    this.recordView = new View(this.find("record"), record.grow([Infinity, Infinity, -Infinity, -Infinity]), 8);
    this.recordWhole = this.recordView.box;
    this.find("follow").checked = Math.max(box[2] - box[0], box[3] - box[1]) > 160; // from farther away a car is a dot
    this.playing = false;
    this.arm = sets.with ? "with" : Object.keys(sets)[0];
    Object.keys(ARM_NAMES).filter((arm) => sets[arm]).forEach((arm) => this.find("arm").append(option(arm, arm === "with" ? data.row : ARM_NAMES[arm])));
    this.find("arm").value = this.arm;
    this.time = 0;
    this.listSamples();
    this.toMeeting();
    this.find("arm").addEventListener("change", (event) => { this.arm = event.target.value; this.listSamples(); this.draw(); });
    this.find("sample").addEventListener("change", () => { this.draw(); this.link(); });
    this.find("video").hidden = !window.MediaRecorder;
    this.find("video").addEventListener("click", () => this.film());
    this.find("play").addEventListener("click", () => this.toggle());
    this.find("scrub").addEventListener("input", (event) => { this.pause(); this.fresh = false; this.time = (event.target.value / 1000) * this.duration; this.draw(); });
    this.find("ghosts").addEventListener("change", () => this.draw());
    this.find("follow").addEventListener("change", () => this.draw());
    this.find("previous").addEventListener("click", () => this.step(-1));
    this.find("next").addEventListener("click", () => this.step(1));
    this.find("stage").addEventListener("click", () => this.toggle());
    ["csv", "png"].forEach((kind) => this.find(kind).addEventListener("click", () => this.save(kind)));
    this.readouts = data.vehicles.map((vehicle, n) => {
      const value = document.createElement("b");
      this.find("readout").append(chipLine(vehicle, n, value));
      return value;
    });
  }

  get set() { return this.sets[this.arm]; }
  get sample() { return this.find("sample").selectedIndex; }
  get duration() { return this.set.durations[this.sample]; }

  listSamples() {
    const list = this.find("sample");
    const before = Math.max(0, list.selectedIndex);
    list.replaceChildren(...this.set.index.map((index) => option(index, this.title(index))));
    list.selectedIndex = Math.min(before, this.set.samples - 1);
    this.time = Math.min(this.time, this.duration);
  }

  /** Show the instant at which two vehicles are nearest; playing starts at 0 all the same. */
  toMeeting() {
    this.time = this.set.meeting(this.sample) * this.duration;
    this.fresh = true;
  }

  /** Play once, and give the pictures as a video. */
  film() {
    const name = `scenario_${this.set.index[this.sample]}.webm`;
    const recorder = new MediaRecorder(this.find("stage").captureStream(30));
    const parts = [];
    recorder.addEventListener("dataavailable", (event) => parts.push(event.data));
    recorder.addEventListener("stop", () => download(name, new Blob(parts, { type: "video/webm" })));
    this.pause();
    this.time = 0;
    this.recorder = recorder;
    recorder.start();
    this.find("said").textContent = "recording: the video is there when the film ends";
    this.play();
  }

  title(index) {
    return this.arm === "replay" ? "the recording" : `scenario ${index}`;
  }

  /** Give the shown scenario as a file: every 0.2 s or so as CSV, or the picture as PNG. */
  save(kind) {
    const name = `${this.arm === "with" ? "scenario" : this.arm}_${this.set.index[this.sample]}.${kind}`;
    if (kind === "png") {
      this.find("stage").toBlob((blob) => download(name, blob));
      return;
    }
    const rows = ["vehicle_id,time,x,y,heading,speed"];
    this.data.vehicles.forEach((vehicle, n) => {
      const id = /[",\n]/.test(vehicle.id) ? `"${vehicle.id.replace(/"/g, '""')}"` : vehicle.id;
      for (let f = 0; f < this.set.frames; f += 1) {
        const share = f / (this.set.frames - 1);
        const { x, y, yaw, speed } = this.set.state(this.sample, n, share);
        if (this.set.there(this.sample, n, share)) rows.push([id, (share * this.duration).toFixed(3), ...[x, y, yaw, speed].map((value) => value.toFixed(3))].join(","));
      }
    });
    download(name, new Blob([`${rows.join("\n")}\n`], { type: "text/csv" }));
  }

  step(by) {
    const list = this.find("sample");
    const shown = this.set.shown.length ? this.set.shown : this.set.index.map((_, k) => k);
    list.selectedIndex = shown[(Math.max(shown.indexOf(list.selectedIndex), 0) + by + shown.length) % shown.length];
    this.draw();
    this.link();
  }

  /** Put the shown scenario into the address of the page, which can be shared. */
  link() {
    history.replaceState(null, "", `#case=${shown + 1}&scenario=${this.set.index[this.sample]}`);
  }

  /** Show the generated sample of that index, where its vehicles meet. */
  showSample(index) {
    this.pause();
    this.arm = "with";
    this.find("arm").value = this.arm;
    this.listSamples();
    this.find("sample").selectedIndex = this.set.index.indexOf(index);
    this.toMeeting();
    this.draw();
    this.link();
    this.find("stage").scrollIntoView({ behavior: "smooth", block: "center" });
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  play() {
    if (this.fresh || this.time >= this.duration - 1e-6) this.time = 0;
    this.fresh = false;
    this.playing = true;
    this.last = null;
    this.find("play").textContent = "❚❚";
    this.find("play").setAttribute("aria-label", "pause");
    requestAnimationFrame((now) => this.tick(now));
  }

  pause() {
    this.playing = false;
    this.find("play").textContent = "▶";
    this.find("play").setAttribute("aria-label", "play");
    if (this.recorder) {
      this.recorder.stop();
      this.recorder = null;
      this.find("said").textContent = "";
    }
  }

  tick(now) {
    if (!this.playing) return;
    if (this.last !== null) this.time += ((now - this.last) / 1000) * Number(this.find("pace").value);
    this.last = now;
    if (this.time >= this.duration) {
      this.time = this.duration;
      this.pause();
    } else {
      requestAnimationFrame((next) => this.tick(next));
    }
    this.draw();
  }

  /** What a vehicle does for another one at a share of a clip's duration, by the reactions of the recording: its words and the other one, or null. */
  reaction(clip, sample, n, share) {
    const { reactions, vehicles } = this.data;
    const duration = clip.durations[sample];
    const slow = (at) => clip.state(sample, n, at).speed < 0.5;
    for (const { who, whom, kind, from, to } of reactions) {
      if (who !== n || !clip.there(sample, whom, share)) continue;
      const other = vehicles[whom].id;
      if (kind === "yield" && slow(share) && share > from - 0.15 && share < to + 0.15) {
        let since = share;
        while (since > 0 && slow(since)) since -= 1 / clip.frames;
        return { whom, words: `waits for ${other}, ${((share - since) * duration).toFixed(1)} s` };
      }
      if (share < from || share > to) continue;
      if (kind === "yield") return { whom, words: `slows for ${other}` };
      const [self, leader] = [clip.state(sample, n, share), clip.state(sample, whom, share)];
      const gap = Math.hypot(leader.x - self.x, leader.y - self.y) - (vehicles[n].length + vehicles[whom].length) / 2;
      return { whom, words: self.speed > 1 ? `follows ${other}, ${(gap / self.speed).toFixed(1)} s` : `follows ${other}` };
    }
    return null;
  }

  /** Name a vehicle, and draw an arrow to the one that it waits for or follows. */
  name(view, clip, sample, n, share) {
    const state = clip.state(sample, n, share);
    const reaction = this.reaction(clip, sample, n, share);
    const other = reaction && clip.state(sample, reaction.whom, share);
    if (reaction) view.arrow(state, other, vehicleColour(n));
    view.label(state.x, state.y, [this.data.vehicles[n].id, reaction && reaction.words].filter(Boolean).join(" "), vehicleColour(n), reaction && other.y > state.y);
  }

  /** The part of the road that is shown: all of it, or the vehicles with some room around them. */
  frame(states, whole) {
    if (!this.find("follow").checked || !states.length) return whole;
    const xs = states.map((state) => state.x);
    const ys = states.map((state) => state.y);
    const room = 18;
    return [Math.min(...xs) - room, Math.min(...ys) - room, Math.max(...xs) + room, Math.max(...ys) + room];
  }

  draw() {
    const { data, set, sample, view } = this;
    const share = this.time / this.duration;
    const states = data.vehicles.map((_, n) => set.state(sample, n, share));
    const here = data.vehicles.map((_, n) => set.there(sample, n, share));
    view.box = this.frame(states.filter((_, n) => here[n]), this.whole);
    this.drawRecord(share);
    const context = view.begin();
    view.road(data.road);
    view.lights(set.lights[sample], this.time);
    const ghosts = this.find("ghosts").checked;
    data.vehicles.forEach((vehicle, n) => {
      context.globalAlpha = 0.35;
      context.lineWidth = 1.2;
      context.strokeStyle = vehicleColour(n);
      context.setLineDash(isEgo(data, n) ? [7, 5] : []);
      set.path(context, view, sample, n);
      context.setLineDash([]);
      context.globalAlpha = 0.9;
      context.lineWidth = 2.5;
      set.path(context, view, sample, n, Math.max(0, share - 3 / this.duration), share);
      if (ghosts) {
        for (const s of set.shown) {
          if (s !== sample && !isEgo(data, n) && set.there(s, n, this.time / set.durations[s])) view.footprint(set.state(s, n, this.time / set.durations[s]), vehicle, vehicleColour(n), 0.08, false);
        }
      }
    });
    data.vehicles.forEach((vehicle, n) => {
      if (!here[n]) {
        this.readouts[n].textContent = "not there";
        return;
      }
      if (isEgo(data, n)) {
        view.outline(states[n], vehicle, vehicleColour(n));
        view.label(states[n].x, states[n].y, "ego", vehicleColour(n));
      } else {
        view.footprint(states[n], vehicle, vehicleColour(n), 1, true);
        this.name(view, set, sample, n, share);
      }
      this.readouts[n].textContent = `${states[n].speed.toFixed(1)} m/s`;
    });
    view.ruler();
    this.find("scrub").value = Math.round(1000 * share);
    this.drawSpeeds();
    this.find("clock").textContent = `${this.time.toFixed(1)} / ${this.duration.toFixed(1)} s`;
    this.sayPrimitive(share);
    if (this.onDraw) this.onDraw(this.arm === "with" ? set.index[sample] : null);
  }

  /** The record at the same moment of its clock, on strips as wide as lanes, for what it was driven on is not known. */
  drawRecord(share) {
    const { data, record, recordView: view } = this;
    const there = data.vehicles.map((_, n) => record.there(0, n, share));
    const states = data.vehicles.map((_, n) => record.state(0, n, share));
    view.box = this.frame(states.filter((_, n) => there[n]), this.recordWhole);
    const context = view.begin();
    context.strokeStyle = "rgb(100 116 139 / 28%)";
    context.lineWidth = 3.5 * view.scale;
    data.vehicles.forEach((_, n) => record.path(context, view, 0, n));
    data.vehicles.forEach((vehicle, n) => {
      if (!there[n]) return;
      context.globalAlpha = 0.9;
      context.lineWidth = 2.5;
      context.strokeStyle = vehicleColour(n);
      record.path(context, view, 0, n, Math.max(0, share - 3 / record.durations[0]), share);
      view.footprint(states[n], vehicle, vehicleColour(n), 1, true);
      this.name(view, record, 0, n, share);
    });
    view.ruler();
  }

  /** The speeds of the shown scenario, drawn anew when it is another one, and the cursor in them. */
  drawSpeeds() {
    const place = this.find("speeds-now");
    const shown = `${this.arm} ${this.sample}`;
    if (this.charted !== shown) drawSpeedsNow(place, this.data, this.set, this.sample, this.record, (time) => { this.pause(); this.fresh = false; this.time = Math.min(time, this.duration); this.draw(); });
    this.charted = shown;
    place.cursorAt = this.time;
    place.moveCursor(this.time);
  }

  /** Scenarios share the recording's clock, so the same share of the duration is the same primitive. */
  sayPrimitive(share) {
    const { bounds, labels, descriptions } = this.data.template;
    const time = share * bounds[bounds.length - 1];
    let k = 0;
    while (k < labels.length - 1 && time >= bounds[k + 1]) k += 1;
    this.find("primitive").textContent = `segment ${k + 1} of ${labels.length}: ${descriptions[k]}`;
    this.find("primitive").style.borderColor = primitiveColour(labels[k]);
  }
}

/** Everything drawn for one case, made when it is first shown. */
function open(section, data) {
  const template = new Trajectories(data.template);
  const sets = Object.fromEntries(Object.entries(data.arms).map(([arm, packed]) => [arm, new Trajectories(packed)]));
  const box = Object.values(sets).reduce((grown, set) => set.grow(grown), [Infinity, Infinity, -Infinity, -Infinity]);
  data.fit.forEach((vehicle) => vehicle.route.forEach(([x, y]) => {
    box[0] = Math.min(box[0], x); box[1] = Math.min(box[1], y); box[2] = Math.max(box[2], x); box[3] = Math.max(box[3], y);
  }));
  const find = (role) => section.querySelector(`[data-role="${role}"]`);
  const player = Object.keys(sets).length ? new Player(section, data, sets, box, template.turned(data.turn)) : null;
  const ground = template.grow([Infinity, Infinity, -Infinity, -Infinity]);
  const maps = [
    [new View(find("template-map"), ground, 6), (view) => drawTemplateMap(view, data, template)],
  ];
  if (find("routes")) maps.push([new View(find("routes"), box, 8), (view) => drawRoutes(view, data)]);
  let top = 1;
  [template, ...Object.values(sets)].forEach((set) => { for (let i = 3; i < set.values.length; i += 4) top = Math.max(top, set.values[i]); });
  const drawAll = (arm) => drawSpeeds(find(`speeds-${arm}`), data, sets[arm], template, 1.08 * top);
  if (sets.with) {
    maps.push([new View(find("samples-with"), box, 8), (view) => drawSamples(view, data, sets.with, "with")]);
    drawAll("with");
  }
  drawTemplate(find("template-speed"), data, template);
  const who = find("motion-vehicle");
  const which = find("motion-sample");
  const motion = () => drawMotion(find("motion"), data, sets.with, template, who.selectedIndex, Number(which.value));
  const listed = () => {
    which.replaceChildren(option(-1, "all drawn scenarios"), ...(sets.with ? sets.with.shown.map((k) => option(k, `scenario ${sets.with.index[k]}`)) : []));
    motion();
  };
  who.append(...data.vehicles.map((vehicle, n) => option(n, vehicle.id)));
  [who, which].forEach((list) => list.addEventListener("change", motion));
  listed();
  const drawMaps = () => { maps.forEach(([view, draw]) => draw(view)); if (player) player.draw(); };
  if (sets.with && find("list")) {
    let ready = false;
    const changed = () => { if (ready) { drawAll("with"); listed(); drawMaps(); } };
    const list = new ScenarioList(section, data, sets.with, changed, (index) => player.showSample(index));
    ready = true;
    changed();
    player.onDraw = (index) => list.mark(index);
  }
  section.querySelectorAll('[data-role="legend"]').forEach((list) => list.append(...data.vehicles.map((vehicle, n) => chipLine(vehicle, n))));
  const pairs = find("pair");
  data.features.forEach((feature, i) => pairs.append(option(i, feature.pair.map((n) => data.vehicles[n].id).join(" and "))));
  pairs.parentElement.hidden = data.features.length < 2;
  const features = () => {
    const feature = data.features[pairs.selectedIndex];
    if (!feature) return; // one vehicle is left: there is no pair
    section.querySelectorAll("[data-feature]").forEach((place) => {
      const [kind, arm] = place.dataset.feature.split(" ");
      if (feature[kind][arm]) drawFeature(place, feature[kind][arm], template.durations[0], feature.pair.map((n) => data.vehicles[n].id));
    });
  };
  const choose = (k) => (sets.with && sets.with.index.includes(data.coverage.index[k]) ? () => player.showSample(data.coverage.index[k]) : null);
  section.querySelectorAll("[data-spread]").forEach((place) => drawSpread(place, data.coverage.figures[place.dataset.spread], choose));
  section.querySelectorAll("[data-pick]").forEach((button) => button.addEventListener("click", () => player.showSample(Number(button.dataset.pick))));
  pairs.addEventListener("change", features);
  features();
  return { player, draw: drawMaps };
}

const opened = new Map();
let shown = -1;

function show(index) {
  if (shown >= 0 && opened.get(shown).player) opened.get(shown).player.pause();
  document.querySelectorAll("[data-case]").forEach((section) => { section.hidden = Number(section.dataset.case) !== index; });
  document.querySelectorAll("[data-show]").forEach((row) => row.setAttribute("aria-current", String(Number(row.dataset.show) === index)));
  shown = index;
  if (!opened.has(index)) opened.set(index, open(document.querySelector(`[data-case="${index}"]`), CASES[index]));
  opened.get(index).draw();
}

document.querySelectorAll("[data-show]").forEach((row) => {
  row.addEventListener("click", () => show(Number(row.dataset.show)));
});

/** Whatever changes the width of the page, or unfolds a part of it: canvases and charts follow. */
function fit() {
  if (shown < 0) return;
  redraw(document.querySelector(`[data-case="${shown}"]`));
  opened.get(shown).draw();
}
new ResizeObserver(fit).observe(document.querySelector("main"));
document.querySelectorAll("details.part").forEach((part) => part.addEventListener("toggle", () => { if (part.open) fit(); }));
document.addEventListener("keydown", (event) => {
  const player = shown >= 0 && opened.get(shown).player;
  if (!player || /^(INPUT|SELECT|BUTTON)$/.test(document.activeElement.tagName)) return;
  if (event.key === " ") { event.preventDefault(); player.toggle(); }
  if (event.key === "ArrowRight") player.step(1);
  if (event.key === "ArrowLeft") player.step(-1);
});

/** Show the case and the scenario that the address names, or the first case. */
function follow() {
  const asked = new URLSearchParams(location.hash.slice(1));
  const index = Number(asked.get("case") ?? 1) - 1;
  show(CASES[index] ? index : 0);
  const { player } = opened.get(shown);
  const scenario = Number(asked.get("scenario") ?? NaN);
  if (player && player.sets.with && player.sets.with.index.includes(scenario)) player.showSample(scenario);
}
window.addEventListener("hashchange", follow);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (shown >= 0) opened.get(shown).draw(); });
follow();
document.querySelectorAll("[data-primitive]").forEach((chip) => { chip.style.background = primitiveColour(Number(chip.dataset.primitive)); });
document.querySelectorAll("[data-vehicle]").forEach((chip) => { chip.style.background = vehicleColour(Number(chip.dataset.vehicle)); });
