// The replay's clock and controls: one instant for the street and the strip of frames, under one method.

const STEP_US = 100000; // of an arrow key
const OLD_BROWSER = "The replay needs a browser of 2023 or later.";

function showReplay(run) {
  const slider = byId("time"), axis = timeAxis(run);
  let now = run.begin_us, selected = -1, playing = false, before = 0, told = 0;
  let method = run.methods.find((one) => one.caches) ?? run.methods[0];
  slider.max = Math.round((run.end_us - run.begin_us) / 10000);
  const options = { speed: () => Number(byId("speed").value), trail: () => byId("trail").checked, views: () => byId("views").checked,
    held: () => byId("believed").checked, selected: () => selected, now: () => now, method: () => method, choose: chooseByHand };
  const paints = [streetView(run, byId("map"), byId("map-tip"), options), stripView(run, byId("strip"), axis, options)];

  function render() {
    axis.follow(now, byId("strip").clientWidth);
    for (const paint of paints) paint(now);
    slider.value = Math.round((now - run.begin_us) / 10000);
    const text = `${(now / 1e6).toFixed(2)} s of ${(run.end_us / 1e6).toFixed(2)} s`;
    byId("clock").value = text;
    slider.setAttribute("aria-valuetext", text);
    if (Math.abs(performance.now() - told) < 120 && playing) return;
    told = performance.now();
    byId("moment").textContent = countsText(run, method, now);
  }
  function moveTo(t) {
    now = Math.min(Math.max(t, run.begin_us), run.end_us);
    render();
  }
  function seek(t) {
    play(false);
    moveTo(t);
    writeAddress();
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
    if (playing && !on) writeAddress(); // not while it plays: browsers bound how often an address may change
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
  function chooseByHand(id) {
    choose(id);
    writeAddress();
  }
  function chooseMethod(chosen) {
    method = chosen;
    byId("method").value = run.methods.indexOf(method);
    showLegend(run, method);
  }
  function chooseNumber() {
    const stream = run.streams[Number(byId("which-stream").value)], first = run.frames.number[stream.first];
    chooseByHand(stream.first + Math.min(Math.max(Number(byId("which-frame").value) - first, 0), stream.count - 1));
  }
  function beside(step) {
    const stream = run.streams[run.frames.stream[selected]];
    chooseByHand(Math.min(Math.max(selected + step, stream.first), stream.first + stream.count - 1));
  }
  function keys(event) {
    const place = run.methods.indexOf(method), time = { ArrowLeft: now - STEP_US, ArrowRight: now + STEP_US, Home: run.begin_us, End: run.end_us }[event.key];
    const other = { ArrowUp: Math.max(place - 1, 0), ArrowDown: Math.min(place + 1, run.methods.length - 1) }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === " ") play(!playing);
    else if (event.target.id !== "strip" && time !== undefined) seek(time);
    else if (event.target.id !== "strip" && other !== undefined) changeMethod(run.methods[other]);
    else return;
    event.preventDefault();
  }
  function changeMethod(chosen) {
    chooseMethod(chosen);
    choose(selected, now);
    writeAddress();
  }
  // An instant of the replay: #t=12.3&method=genie.
  const writeAddress = () => history.replaceState(null, "", `#t=${(now / 1e6).toFixed(3)}&method=${encodeURIComponent(method.name)}`);
  function followAddress() {
    const fields = new URLSearchParams(location.hash.slice(1)), t = Number(fields.get("t") || NaN) * 1e6;
    if (!Number.isFinite(t)) return false;
    chooseMethod(run.methods.find(({ name }) => name === fields.get("method")) ?? method);
    choose(Math.max(latestFrame(run, run.cars[0], t), 0), t);
    byId("replay").scrollIntoView({ behavior: "instant" });
    return true;
  }

  byId("which-stream").append(...run.streams.map((one, i) => option(i, `${one.car} ${one.name}`)));
  byId("method").append(...run.methods.map((one, place) => option(place, one.title)));
  byId("method").parentElement.hidden = run.methods.length === 1;
  byId("believed").parentElement.hidden = !run.methods.some(({ beliefs }) => beliefs.begin.length);
  byId("method").addEventListener("change", () => changeMethod(run.methods[Number(byId("method").value)]));
  byId("which").addEventListener("submit", (event) => { event.preventDefault(); chooseNumber(); });
  for (const id of ["which-stream", "which-frame"]) byId(id).addEventListener("change", chooseNumber);
  byId("earlier").addEventListener("click", () => beside(-1));
  byId("later").addEventListener("click", () => beside(1));
  byId("play").addEventListener("click", () => play(!playing));
  slider.addEventListener("input", () => seek(run.begin_us + Number(slider.value) * 10000));
  for (const id of ["speed", "trail", "views", "believed"]) byId(id).addEventListener("input", render);
  for (const id of ["map", "strip"]) byId(id).addEventListener("keydown", keys);
  window.addEventListener("hashchange", followAddress);
  new ResizeObserver(render).observe(byId("map"));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) byId("speed").value = "0.1";
  if (followAddress()) return;
  chooseMethod(method);
  choose(interesting(run, method, run.begin_us + (run.end_us - run.begin_us) * 0.4)); // somewhere with something to see
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
    ...(run.edges.length ? [sign("edge: has no place on the street, stands above it", draw("rect", { x: 1, y: 3, width: 14, height: 8, rx: 2, ...stroke("muted", 1.2) })),
      sign("link of a car to its edge", across(stroke("line", 1.5)))] : []),
    sign("message to an edge; small: to a car", draw("circle", { cx: 5, cy: 7, r: 4.5, ...solid("ink") }), draw("circle", { cx: 13, cy: 7, r: 2.5, ...solid("ink") })),
    sign("the chosen frame", draw("circle", { cx: 8, cy: 7, r: 6, ...stroke("ink", 1.5) })),
    ...(method.beliefs.begin.length ? [sign("held and there", draw("path", { d: "M8 2L13 11H3Z", ...solid("hit") })), sign("false: held, but not there", draw("path", { d: "M4 3L12 11M4 11L12 3", ...stroke("ghost") })),
      sign("missed: visible, but not held", draw("path", { d: "M8 2L13 11H3Z", ...stroke("hit", 1.5) }))] : []));
  byId("strip-about").textContent = `${method.title}: a cell for each frame, in the colour of its outcome; filled where a fresh result came, ` +
    "framed: the chosen one. Click one, or use the arrow keys.";
}

const shown = unpacked(byId("data").textContent).then((replay) => showReplay(decode(replay)), () => { byId("moment").textContent = OLD_BROWSER; });
