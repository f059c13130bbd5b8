// The replay's clock and controls: one instant for the street and the strip of frames, under one method.
// Uses all others of the replay, and the id of the section "Replay".

const STEP_US = 100000; // of an arrow key
const TICK_US = 10000; // of the slider
const OLD_BROWSER = "The replay needs a browser of 2023 or later.";

class Replay {
  constructor(run) {
    const method = run.methods.find(({ caches }) => caches) ?? run.methods[0];
    Object.assign(this, { run, method, now: run.begin_us, selected: -1, playing: false, before: 0, told: 0 });
    const isChecked = (id) => () => byId(id).checked;
    const options = {
      trail: isChecked("trail"),
      views: isChecked("views"),
      heldObjects: isChecked("held-objects"),
      speed: () => Number(byId("speed").value),
      selected: () => this.selected,
      now: () => this.now,
      method: () => this.method,
      choose: (id) => this.chooseByHand(id),
    };
    this.axis = new TimeAxis(run);
    this.street = new Street(run, byId("map"), byId("map-tip"), options);
    this.strip = new Strip(run, byId("strip"), this.axis, options);
    this.fillControls();
    this.listen();
    if (this.followAddress()) return;
    this.setMethod(method);
    this.choose(Math.max(latestFrame(run, run.cars[0], run.begin_us + (run.end_us - run.begin_us) * 0.4), 0));
  }

  fillControls() {
    const { run } = this;
    byId("time").max = Math.round((run.end_us - run.begin_us) / TICK_US);
    byId("which-stream").append(...run.streams.map(({ car, name }, i) => option(i, `${car} ${name}`)));
    byId("method").append(...run.methods.map(({ title }, i) => option(i, title)));
    byId("method").parentElement.hidden = run.methods.length === 1;
    byId("held-objects").parentElement.hidden = !run.methods.some(({ heldObjects }) => heldObjects.begin.length);
    if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) byId("speed").value = "0.1";
  }

  listen() {
    const on = (id, event, call) => byId(id).addEventListener(event, call),
      { run } = this;
    on("method", "change", () => this.changeMethod(run.methods[Number(byId("method").value)]));
    on("which", "submit", (event) => {
      event.preventDefault();
      this.chooseNumber();
    });
    for (const id of ["which-stream", "which-frame"]) on(id, "change", () => this.chooseNumber());
    on("earlier", "click", () => this.chooseBeside(-1));
    on("later", "click", () => this.chooseBeside(1));
    on("play", "click", () => this.play(!this.playing));
    on("time", "input", () => this.seek(run.begin_us + Number(byId("time").value) * TICK_US));
    for (const id of ["speed", "trail", "views", "held-objects"]) on(id, "input", () => this.render());
    for (const id of ["map", "strip"]) on(id, "keydown", (event) => this.followKey(event));
    window.addEventListener("hashchange", () => this.followAddress());
    new ResizeObserver(() => this.render()).observe(byId("map"));
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.render());
  }

  render() {
    const { run, now } = this,
      text = `${(now / 1e6).toFixed(2)} s of ${(run.end_us / 1e6).toFixed(2)} s`;
    this.axis.follow(now, byId("strip").clientWidth);
    this.street.paint(now);
    this.strip.paint(now);
    byId("time").value = Math.round((now - run.begin_us) / TICK_US);
    byId("time").setAttribute("aria-valuetext", text);
    byId("clock").value = text;
    if (Math.abs(performance.now() - this.told) < 120 && this.playing) return;
    this.told = performance.now();
    byId("moment").textContent = countsText(run, this.method, now);
  }

  moveTo(t) {
    this.now = Math.min(Math.max(t, this.run.begin_us), this.run.end_us);
    this.render();
  }
  seek(t) {
    this.play(false);
    this.moveTo(t);
    this.writeAddress();
  }

  play(isOn) {
    const stops = this.playing && !isOn;
    this.playing = isOn;
    byId("play").textContent = isOn ? "Pause" : "Play";
    if (stops) {
      this.render();
      this.writeAddress(); // not while it plays: browsers bound how often that may be
    }
    if (!isOn) return;
    if (this.now >= this.run.end_us) this.now = this.run.begin_us;
    this.before = performance.now();
    requestAnimationFrame((time) => this.tick(time));
  }
  tick(time) {
    if (!this.playing) return;
    const t = this.now + Math.min(time - this.before, 100) * 1000 * Number(byId("speed").value);
    this.before = time;
    this.moveTo(t);
    if (t >= this.run.end_us) this.play(false);
    requestAnimationFrame((next) => this.tick(next));
  }

  // Shows the story of a frame, and moves to `t`, by default to its first answer.
  choose(id, t) {
    const { run, method } = this;
    this.selected = id;
    byId("which-stream").value = run.frames.stream[id];
    byId("which-frame").value = run.frames.number[id];
    byId("story").replaceChildren(...storyOf(run, method, id));
    byId("frame-told").textContent = shortStory(run, method, id);
    this.moveTo(t ?? run.frames.stamp[id] + Math.max(method.rows.first_answer_us[id], 0));
    this.play(false);
    byId("frame").style.scrollMarginTop = `${byId("frames").offsetHeight}px`;
  }
  chooseByHand(id) {
    this.choose(id);
    this.writeAddress();
  }
  chooseNumber() {
    const { first, count } = this.run.streams[Number(byId("which-stream").value)];
    const place = Number(byId("which-frame").value) - this.run.frames.number[first];
    this.chooseByHand(first + Math.min(Math.max(place, 0), count - 1));
  }
  chooseBeside(step) {
    const { first, count } = this.run.streams[this.run.frames.stream[this.selected]];
    this.chooseByHand(Math.min(Math.max(this.selected + step, first), first + count - 1));
  }

  setMethod(method) {
    this.method = method;
    byId("method").value = this.run.methods.indexOf(method);
    showLegend(this.run, method);
  }
  changeMethod(method) {
    this.setMethod(method);
    this.choose(this.selected, this.now);
    this.writeAddress();
  }

  followKey(event) {
    const { now, run } = this,
      place = run.methods.indexOf(this.method),
      isOnStreet = event.target.id !== "strip";
    const times = { ArrowLeft: now - STEP_US, ArrowRight: now + STEP_US, Home: run.begin_us, End: run.end_us };
    const methods = {
      ArrowUp: run.methods[Math.max(place - 1, 0)],
      ArrowDown: run.methods[place + 1] ?? this.method,
    };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === " ") this.play(!this.playing);
    else if (isOnStreet && event.key in times) this.seek(times[event.key]);
    else if (isOnStreet && event.key in methods) this.changeMethod(methods[event.key]);
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
      t = Number(fields.get("t") || NaN) * 1e6;
    if (!Number.isFinite(t)) return false;
    const { run } = this;
    this.setMethod(run.methods.find(({ name }) => name === fields.get("method")) ?? this.method);
    this.choose(Math.max(latestFrame(run, run.cars[0], t), 0), t);
    byId("replay").scrollIntoView({ behavior: "instant" });
    return true;
  }
}

function showLegend(run, method) {
  const solid = (tone) => ({ fill: `var(--${tone})` });
  const stroke = (tone, broad = 2) => ({ fill: "none", stroke: `var(--${tone})`, "stroke-width": broad });
  const disc = (look, cx = 8, r = 4.5) => draw("circle", { cx, cy: 7, r, ...look });
  const box = (look) => draw("rect", { x: 3.5, y: 2.5, width: 9, height: 9, ...look });
  const slab = (look, height, y) => draw("rect", { x: 1, y, width: 14, height, rx: 2, ...look });
  const path = (d, look) => draw("path", { d, ...look });
  const triangle = "M8 2L13 11H3Z";
  const signs = [
    [true, method.caches ? "frame on the road: hit" : "frame on the road: answered", disc(solid("hit"))],
    [method.caches, "miss", disc(stroke("miss"))],
    [method.caches, "coalesced: waits for an equal frame", box(solid("coalesced"))],
    [true, "no answer", disc(stroke("none"))],
    [method.images.length, "look-up in a car, in the colour of its outcome", disc(stroke("miss", 3))],
    [method.images.length, "look-up at an edge", path("M0 7H16", stroke("hit", 3)), box(solid("hit"))],
    [true, "car", slab(solid("car"), 6, 4)],
    [true, "its field of view", path("M1 7L15 1V13Z", { opacity: 0.3, ...solid("car") })],
    [run.edges.length, "edge: has no place on the street, stands above it", slab(stroke("muted", 1.2), 8, 3)],
    [run.edges.length, "link of a car to its edge", path("M0 7H16", stroke("line", 1.5))],
    [true, "message to an edge; small: to a car", disc(solid("ink"), 5), disc(solid("ink"), 13, 2.5)],
    [true, "the chosen frame", disc(stroke("ink", 1.5), 8, 6)],
    [method.heldObjects.begin.length, "held and there", path(triangle, solid("hit"))],
    [method.heldObjects.begin.length, "false: held, but not there", path("M4 3L12 11M4 11L12 3", stroke("ghost"))],
    [method.heldObjects.begin.length, "missed: visible, but not held", path(triangle, stroke("hit", 1.5))],
  ];
  const size = { width: 16, height: 14, "aria-hidden": "true" };
  const shown = signs.filter(([isShown]) => isShown);
  byId("legend").replaceChildren(
    ...shown.map(([, text, ...shapes]) => make("span", {}, draw("svg", size, ...shapes), text)),
  );
  byId("strip-about").textContent =
    `${method.title}: a cell for each frame, in the colour of its outcome; filled where a fresh result came, ` +
    "framed: the chosen one. Click one, or use the arrow keys.";
}

const shown = unpacked(byId("data").textContent).then(
  (replay) => new Replay(decode(replay)),
  () => {
    byId("moment").textContent = OLD_BROWSER;
  },
);
