// The replay: one instant of simulated time, under one method, for the street, the strip of frames and one frame's
// story. Its elements are those of replay.html.

import { byId, make, makeSvg, option, unpacked } from "./replay_elements.js";
import { countsText, decode, latestFrame } from "./replay_model.js";
import { Street } from "./replay_street.js";
import { Strip } from "./replay_strip.js";
import { shortStory, storyOf } from "./story.js";

const STEP_US = 100000; // of an arrow key
const TICK_US = 10000; // of the slider
const TELL_MS = 120; // between two words on a moment while it plays
const ADDRESS_MS = 300; // after the last change
const OLD_BROWSER = "The replay needs a browser of 2023 or later.";

class Replay {
  constructor(run) {
    const method = run.methods.find(({ caches }) => caches) ?? run.methods[0];
    const selected = Math.max(latestFrame(run, run.cars[0], run.begin_us + (run.end_us - run.begin_us) * 0.4), 0);
    Object.assign(this, { run, method, selected, now: answeredAt(run, method, selected), isPlaying: false });
    const choose = (id) => this.choose(id);
    this.street = new Street(run, byId("map"), byId("map-tip"), choose);
    this.strip = new Strip(run, byId("strip"), choose);
    this.fillControls();
    this.listen();
    this.render();
    this.followAddress();
  }

  fillControls() {
    const { run } = this;
    byId("time").max = Math.round((run.end_us - run.begin_us) / TICK_US);
    byId("which-stream").append(...run.streams.map(({ car, stream }, i) => option(i, `${car} ${stream}`)));
    byId("method").append(...run.methods.map(({ title }, i) => option(i, title)));
    byId("method").parentElement.hidden = run.methods.length === 1;
    byId("held-objects").parentElement.hidden = !run.methods.some(({ held_objects }) => held_objects.car.length);
    if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) byId("speed").value = "0.1";
  }

  listen() {
    const on = (id, event, call) => byId(id).addEventListener(event, call),
      { run } = this;
    on("method", "change", () => this.set({ method: run.methods[Number(byId("method").value)], isPlaying: false }));
    on("which", "submit", (event) => {
      event.preventDefault();
      this.chooseNumber();
    });
    for (const id of ["which-stream", "which-frame"]) on(id, "change", () => this.chooseNumber());
    on("earlier", "click", () => this.chooseBeside(-1));
    on("later", "click", () => this.chooseBeside(1));
    on("play", "click", () => this.play());
    on("time", "input", () => this.seek(run.begin_us + Number(byId("time").value) * TICK_US));
    for (const id of ["speed", "trail", "views", "held-objects"]) on(id, "input", () => this.render());
    for (const id of ["map", "strip"]) on(id, "keydown", (event) => this.followKey(event));
    window.addEventListener("hashchange", () => this.followAddress());
    new ResizeObserver(() => this.render()).observe(byId("map"));
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.render());
  }

  // The one way to change what is shown: method, selected (the id of the chosen frame), now [us] and isPlaying. The
  // address follows after the last of many changes, and not while it plays: browsers bound how often it is written.
  set(changes) {
    Object.assign(this, changes);
    this.now = Math.min(Math.max(this.now, this.run.begin_us), this.run.end_us);
    this.render();
    clearTimeout(this.nextAddress);
    if (!this.isPlaying) this.nextAddress = setTimeout(() => this.writeAddress(), ADDRESS_MS);
  }

  render() {
    const { run, method, selected, now, isPlaying } = this,
      isOn = (id) => byId(id).checked,
      text = `${(now / 1e6).toFixed(2)} s of ${(run.end_us / 1e6).toFixed(2)} s`;
    const options = { trail: isOn("trail"), views: isOn("views"), heldObjects: isOn("held-objects") };
    this.street.paint({ now, method, selected, speed: Number(byId("speed").value), ...options });
    this.strip.paint({ now, method, selected });
    byId("play").textContent = isPlaying ? "Pause" : "Play";
    byId("time").value = Math.round((now - run.begin_us) / TICK_US);
    byId("time").setAttribute("aria-valuetext", text);
    byId("clock").value = text;
    this.tellFrame();
    if (isPlaying && performance.now() - this.told < TELL_MS) return;
    this.told = performance.now();
    byId("moment").textContent = countsText(method, now);
  }

  // The story of the chosen frame, and what the marks mean, where they are not those that are told.
  tellFrame() {
    const { run, method, selected, toldOf } = this;
    if (toldOf?.method === method && toldOf.selected === selected) return;
    this.toldOf = { method, selected };
    byId("method").value = run.methods.indexOf(method);
    byId("which-stream").value = run.streams.indexOf(run.frames.stream[selected]);
    byId("which-frame").value = run.frames.number[selected];
    byId("story").replaceChildren(...storyOf(run, method, selected));
    byId("frame-told").textContent = shortStory(run, method, selected);
    byId("frame").style.scrollMarginTop = `${byId("frames").offsetHeight}px`;
    showLegend(run, method);
  }

  seek(now) {
    this.set({ now, isPlaying: false });
  }
  choose(id) {
    this.set({ selected: id, now: answeredAt(this.run, this.method, id), isPlaying: false });
  }
  chooseNumber() {
    const { first_id, first_frame, stamp_us } = this.run.streams[Number(byId("which-stream").value)],
      place = Math.trunc(Number(byId("which-frame").value)) - first_frame;
    this.choose(first_id + Math.min(Math.max(place, 0), stamp_us.length - 1));
    byId("which-frame").value = this.run.frames.number[this.selected]; // whatever was typed
  }
  chooseBeside(step) {
    const { first_id, stamp_us } = this.run.frames.stream[this.selected];
    this.choose(Math.min(Math.max(this.selected + step, first_id), first_id + stamp_us.length - 1));
  }

  // Plays, from the begin on where it is at the end, or pauses.
  play() {
    const { begin_us, end_us } = this.run,
      isPlaying = !this.isPlaying;
    this.set({ isPlaying, now: isPlaying && this.now >= end_us ? begin_us : this.now });
    cancelAnimationFrame(this.nextTick); // of before a pause
    if (isPlaying) this.nextTick = requestAnimationFrame((time) => this.tick(time, time));
  }
  tick(time, before) {
    if (!this.isPlaying) return;
    const now = this.now + Math.min(time - before, 100) * 1000 * Number(byId("speed").value);
    this.set({ now, isPlaying: now < this.run.end_us });
    this.nextTick = requestAnimationFrame((next) => this.tick(next, time));
  }

  followKey(event) {
    const { now, run, method } = this,
      place = run.methods.indexOf(method),
      isOnStreet = event.target.id !== "strip";
    const times = { ArrowLeft: now - STEP_US, ArrowRight: now + STEP_US, Home: run.begin_us, End: run.end_us };
    const methods = { ArrowUp: run.methods[place - 1] ?? method, ArrowDown: run.methods[place + 1] ?? method };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === " ") {
      if (!event.repeat) this.play();
    } else if (isOnStreet && event.key in times) this.seek(times[event.key]);
    else if (isOnStreet && event.key in methods) this.set({ method: methods[event.key], isPlaying: false });
    else return;
    event.preventDefault();
  }

  // An instant of the replay: #t=12.3&method=genie.
  writeAddress() {
    const method = encodeURIComponent(this.method.name);
    history.replaceState(null, "", `#t=${(this.now / 1e6).toFixed(3)}&method=${method}`);
  }
  followAddress() {
    const fields = new URLSearchParams(location.hash.slice(1)),
      now = Number(fields.get("t") || NaN) * 1e6,
      { run } = this;
    if (!Number.isFinite(now)) return;
    const method = run.methods.find(({ name }) => name === fields.get("method")) ?? this.method;
    this.set({ method, selected: Math.max(latestFrame(run, run.cars[0], now), 0), now, isPlaying: false });
    byId("replay").scrollIntoView({ behavior: "instant" });
  }
}

// When a frame has its first answer; of one that has none, when it was taken.
function answeredAt(run, method, id) {
  return run.frames.stamp_us[id] + Math.max(method.frames.first_answer_us[id], 0);
}

function showLegend(run, method) {
  const solid = (tone) => ({ fill: `var(--${tone})` });
  const stroke = (tone, broad = 2) => ({ fill: "none", stroke: `var(--${tone})`, "stroke-width": broad });
  const disc = (look, cx = 8, r = 4.5) => makeSvg("circle", { cx, cy: 7, r, ...look });
  const box = (look) => makeSvg("rect", { x: 3.5, y: 2.5, width: 9, height: 9, ...look });
  const slab = (look, height, y) => makeSvg("rect", { x: 1, y, width: 14, height, rx: 2, ...look });
  const path = (d, look) => makeSvg("path", { d, ...look });
  const triangle = "M8 2L13 11H3Z",
    holds = method.held_objects.car.length;
  const signs = [
    [true, method.caches ? "frame on the road: hit" : "frame on the road: answered", disc(solid("hit"))],
    [method.caches, "miss", disc(stroke("miss"))],
    [method.caches, "coalesced: waits for an equal frame", box(solid("coalesced"))],
    [true, "no answer", disc(stroke("none"))],
    [method.images.some((row) => !method.lookups.edge[row]), "look-up in a car, in the colour of its outcome", disc(stroke("miss", 3))],
    [method.images.some((row) => method.lookups.edge[row]), "look-up at an edge", path("M0 7H16", stroke("hit", 3)), box(solid("hit"))],
    [true, "car", slab(solid("car"), 6, 4)],
    [true, "its field of view", path("M1 7L15 1V13Z", { opacity: 0.3, ...solid("car") })],
    [run.edges.length, "edge: has no place on the street, stands above it", slab(stroke("muted", 1.2), 8, 3)],
    [run.edges.length, "link of a car to its edge", path("M0 7H16", stroke("line", 1.5))],
    [method.messages.all.length, "message to an edge; small: to a car", disc(solid("ink"), 5), disc(solid("ink"), 13, 2.5)],
    [true, "the chosen frame", disc(stroke("ink", 1.5), 8, 6)],
    [holds, "held and there", path(triangle, solid("hit"))],
    [holds, "false: held, but not there", path("M4 3L12 11M4 11L12 3", stroke("false"))],
    [holds, "missed: visible, but not held", path(triangle, stroke("hit", 1.5))],
  ];
  const size = { width: 16, height: 14, "aria-hidden": "true" };
  byId("legend").replaceChildren(
    ...signs
      .filter(([isShown]) => isShown)
      .map(([, text, ...shapes]) => make("span", {}, makeSvg("svg", size, ...shapes), text)),
  );
  byId("strip-about").textContent =
    `${method.title}: a cell for each frame, in the colour of its outcome; filled where a fresh result came, ` +
    "framed: the chosen one. Click one, or use the arrow keys.";
}

// Done when the replay stands in the page.
export const shown = unpacked(byId("data").textContent).then(
  (replay) => new Replay(decode(replay)),
  () => {
    byId("moment").textContent = OLD_BROWSER;
  },
);
