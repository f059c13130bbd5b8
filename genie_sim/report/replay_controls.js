// The replay's clock and controls: one instant for the street, the lanes of all methods and the strip of frames.

const STEP_US = 100000; // of an arrow key
const TABLE_CARS = 12, TABLE_GHOSTS = 20;

function showReplay() {
  if (!DATA.replay || !DATA.replay.methods.length) { byId("told").hidden = byId("street").hidden = byId("frame").hidden = true; return; }
  const run = decode(DATA.replay, ABOUT), slider = byId("time");
  let now = run.begin_us, selected = -1, playing = false, before = 0, told = 0;
  let method = run.methods.find((one) => one.caches) ?? run.methods[0];
  slider.max = Math.round((run.end_us - run.begin_us) / 10000);
  const options = { speed: () => Number(byId("speed").value), genie: () => Number(byId("map-of").value), trail: () => byId("trail").checked,
    views: () => byId("views").checked, held: () => byId("believed").checked, selected: () => selected, now: () => now, method: () => method, choose, chooseUnder };
  const axis = timeAxis(run), street = streetView(run, byId("map"), byId("map-tip"), options);
  const lanes = lanesView(run, byId("lanes"), axis, options), strip = stripView(run, byId("strip"), axis, options);

  function render() {
    axis.follow(now, byId("strip").clientWidth);
    for (const paint of [street, lanes, strip]) paint(now);
    slider.value = Math.round((now - run.begin_us) / 10000);
    const text = `${(now / 1e6).toFixed(2)} s of ${(run.end_us / 1e6).toFixed(2)} s`;
    byId("clock").value = text;
    slider.setAttribute("aria-valuetext", text);
    if (Math.abs(performance.now() - told) > 120 || !playing) { told = performance.now(); showNow(run, now); showGhosts(run, method, now); }
  }
  function moveTo(t) {
    now = Math.min(Math.max(t, run.begin_us), run.end_us);
    render();
  }
  function tick(time) {
    if (!playing) return;
    const t = now + Math.min(time - before, 100) * 1000 * options.speed();
    before = time;
    if (t >= run.end_us) play(false);
    moveTo(t);
    requestAnimationFrame(tick);
  }
  function play(on) {
    playing = on;
    byId("play").textContent = on ? "Pause" : "Play";
    if (on) { if (now >= run.end_us) now = run.begin_us; before = performance.now(); requestAnimationFrame(tick); }
  }
  function choose(id, t) {
    selected = id;
    play(false);
    byId("which-stream").value = run.frames.stream[id];
    byId("which-frame").value = run.frames.number[id];
    byId("story").replaceChildren(...storyOf(run, method, id));
    byId("frame-told").textContent = shortStory(run, method, id);
    moveTo(t ?? run.frames.stamp[id] + Math.max(method.rows.first_answer_us[id], 0));
    byId("frame").style.scrollMarginTop = `${byId("frames").offsetHeight}px`;
  }
  function chooseUnder(place, id, t) {
    method = run.methods[place];
    byId("method").value = place;
    const genies = [...new Set(method.lookups.genie)].map((code) => [run.names[code], code]).sort();
    byId("map-of").replaceChildren(option(-1, "of any Genie, the highest"), ...genies.map(([name, code]) => option(code, name)));
    byId("map-of").parentElement.hidden = !method.objects.length;
    showLegend(run, method);
    choose(id, t);
  }
  function chooseNumber() {
    const stream = run.streams[Number(byId("which-stream").value)], first = run.frames.number[stream.first];
    choose(stream.first + Math.min(Math.max(Number(byId("which-frame").value) - first, 0), stream.count - 1));
  }
  function beside(step) {
    const stream = run.streams[run.frames.stream[selected]];
    choose(Math.min(Math.max(selected + step, stream.first), stream.first + stream.count - 1));
  }
  function keys(event) {
    const place = run.methods.indexOf(method), time = { ArrowLeft: now - STEP_US, ArrowRight: now + STEP_US, Home: run.begin_us, End: run.end_us }[event.key];
    const other = { ArrowUp: Math.max(place - 1, 0), ArrowDown: Math.min(place + 1, run.methods.length - 1) }[event.key];
    if (event.key === " ") play(!playing);
    else if (event.target.id !== "strip" && time !== undefined) moveTo(time);
    else if (event.target.id !== "strip" && other !== undefined) chooseUnder(other, selected, now);
    else return;
    event.preventDefault();
  }
  byId("which-stream").append(...run.streams.map((one, i) => option(i, `${one.car} ${one.name}`)));
  byId("method").append(...run.methods.map((one, i) => option(i, one.title)));
  byId("which").addEventListener("submit", (event) => { event.preventDefault(); chooseNumber(); });
  for (const id of ["which-stream", "which-frame"]) byId(id).addEventListener("change", chooseNumber);
  byId("earlier").addEventListener("click", () => beside(-1));
  byId("later").addEventListener("click", () => beside(1));
  byId("play").addEventListener("click", () => play(!playing));
  slider.addEventListener("input", () => { play(false); moveTo(run.begin_us + Number(slider.value) * 10000); });
  byId("method").addEventListener("change", () => chooseUnder(Number(byId("method").value), selected, now));
  for (const id of ["speed", "map-of", "trail", "views", "believed"]) byId(id).addEventListener("input", render);
  for (const id of ["map", "lanes", "strip"]) byId(id).addEventListener("keydown", keys);
  new ResizeObserver(render).observe(byId("replay"));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) byId("speed").value = "0.1";
  const begin = run.begin_us + (run.end_us - run.begin_us) * 0.4; // somewhere with something to see
  chooseUnder(run.methods.indexOf(method), interesting(run, method, begin));
}

// What each car holds at this instant under each method: also the canvases' text alternative.
function showNow(run, t) {
  const cars = run.cars.slice(0, TABLE_CARS);
  table(byId("now"), "What each car holds", ["", ...run.methods.map((one) => methodKey(one.name))], cars.map((car, place) => [car.name, ...run.methods.map((method) => {
    const held = holding(run, method, place, t);
    if (held === null) return make("td", {}, "nothing yet");
    return make("td", {}, countOf(held.objects), ghosts(method.judged[place], t), make("small", {}, `${held.age < 1e6 ? `${Math.round(held.age / 1000)} ms` : `${(held.age / 1e6).toFixed(1)} s`} old`),
      make("small", {}, `${held.source === "map" ? "object map" : words(held.source)}${held.fresh ? ", fresh" : ""}`));
  })]));
  const truth = run.methods.some((one) => one.judged.some(Boolean)) ? " Ghosts: held in its field of view at its last frame, but not there." : "";
  byId("now-about").textContent = `The newest answer: its objects, its age since the frame was received, its source.${truth}` +
    (cars.length < run.cars.length ? ` The first ${cars.length} of ${run.cars.length} cars.` : "");
}

// Where the truth is known: how many of the objects that a consumer holds in its field of view are not there.
function ghosts(judged, t) {
  const i = judged ? lastUpTo(judged.t, t) : -1;
  return i < 0 ? null : make("small", { class: judged.held[i] > judged.right[i] ? "o-ghost" : "o-hit" }, `${judged.held[i] - judged.right[i]} of ${judged.held[i]} in view are ghosts`);
}

// The ghosts on the street, in words.
function showGhosts(run, method, t) {
  const ghosts = believed(run, method, t).filter(isGhost), shown = ghosts.slice(0, TABLE_GHOSTS);
  byId("ghosts").hidden = byId("believed").parentElement.hidden = !method.beliefs.begin.length;
  byId("ghosts-now").textContent = `Ghosts under ${method.title} now: ${ghosts.length}`;
  table(byId("ghost-table"), null, ["held by", "what", "where [m]", "why it is one", "since"], shown.map((one) => [one.car, one.label,
    `${one.east.toFixed(1)} east, ${one.north.toFixed(1)} north`, GHOSTS[one.judged], `${(one.since / 1e6).toFixed(2)} s`]));
  byId("ghosts-more").textContent = ghosts.length > shown.length ? `and ${ghosts.length - shown.length} more` : "";
}

function showLegend(run, method) {
  const sign = (text, ...shapes) => make("span", {}, draw("svg", { width: 16, height: 14, "aria-hidden": "true" }, ...shapes), text);
  const disc = (look) => draw("circle", { cx: 8, cy: 7, r: 4.5, ...look }), box = (look) => draw("rect", { x: 3.5, y: 2.5, width: 9, height: 9, ...look });
  const stroke = (tone, broad = 2) => ({ fill: "none", stroke: `var(--${tone})`, "stroke-width": broad }), solid = (tone) => ({ fill: `var(--${tone})` });
  const across = (look) => draw("path", { d: "M0 7H16", ...look });
  byId("legend").replaceChildren(
    sign(method.caches ? "frame on the road: hit" : "frame on the road: answered", disc(solid("hit"))),
    ...(method.caches ? [sign("miss", disc(stroke("miss"))), sign("coalesced: waits for an equal frame", box(solid("coalesced")))] : []),
    sign("no answer", disc(stroke("none"))),
    ...(method.images.length ? [sign("look-up in a car, in the colour of its outcome", disc(stroke("miss", 3))),
      sign("look-up at an edge", across(stroke("hit", 3)), box(solid("hit")))] : []),
    sign("car", draw("rect", { x: 1, y: 4, width: 14, height: 6, rx: 2, ...solid("car") })), sign("its field of view", draw("path", { d: "M1 7L15 1V13Z", opacity: 0.3, ...solid("car") })),
    ...(run.about.edges.length ? [sign("edge: has no place on the street, stands above it", draw("rect", { x: 1, y: 3, width: 14, height: 8, rx: 2, ...stroke("muted", 1.2) })),
      sign("link of a car to its edge", across(stroke("line", 1.5)))] : []),
    sign("the chosen frame", draw("circle", { cx: 8, cy: 7, r: 6, ...stroke("ink", 1.5) })),
    ...(method.beliefs.begin.length ? [sign("held and there", draw("path", { d: "M8 2L13 11H3Z", ...solid("hit") })), sign("ghost: held, but not there", draw("path", { d: "M4 3L12 11M4 11L12 3", ...stroke("ghost") })),
      sign("missed: visible, but not held", draw("path", { d: "M8 2L13 11H3Z", ...stroke("hit", 1.5) }))] : []),
    ...(method.objects.length ? [sign("object of high confidence; square: vehicle", box(solid("sure"))), sign("of low confidence; disc: person or cycle", disc(solid("unsure"))),
      sign("below C_T, not shared; diamond: other", draw("path", { d: "M8 2L13 7L8 12L3 7Z", ...stroke("unsure") }))] : []));
  byId("lanes-about").textContent = "A lane for each method, a row for each car. Height: age of the newest answer since its frame was received, " +
    `logarithmic, ${AGES_US[0] / 1000} ms or less to ${AGES_US[1] / 1e6} s or more; empty: no answer yet. Vertical line: now. Click to go there.` +
    (run.cars.length > MOST_CARS ? ` The first ${MOST_CARS} of ${run.cars.length} cars.` : "");
  byId("strip-about").textContent = `${method.title}: a cell for each frame, in the colour of its outcome; filled where a fresh result came, ` +
    "framed: the chosen one. Click one, or use the arrow keys.";
}
