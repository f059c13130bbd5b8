// The replay's clock and controls: one instant for two streets, the lanes of all methods and the strip of frames.

const STEP_US = 100000; // of an arrow key
const ANY_MAP = -1;     // the highest confidence in any Genie's map

function showReplay() {
  if (!DATA.replay || !DATA.replay.methods.length) { byId("told").hidden = byId("street").hidden = byId("frame").hidden = true; return; }
  const run = decode(DATA.replay, ABOUT), slider = byId("time"), suffixes = ["", "-b"];
  let now = run.begin_us, selected = -1, playing = false, before = 0, told = 0, moments = [], car = run.cars.find((entry) => entry.cameras) ?? run.cars[0];
  // The left method is also that of the frames and of the story.
  const left = run.methods.find((method) => method.caches) ?? run.methods[0];
  let pair = [left, run.methods.findLast((method) => method !== left)].filter(Boolean);
  slider.max = Math.round((run.end_us - run.begin_us) / 10000);
  const options = { speed: () => Number(byId("speed").value), genie: () => Number(byId("map-of").value), trail: () => byId("trail").checked,
    views: () => byId("views").checked, held: () => byId("believed").checked, selected: () => selected, now: () => now, method: () => pair[0],
    pair: () => pair, moments: () => moments, car: () => car, moveTo: seek, choose: chooseByHand, chooseUnder };
  const axis = timeAxis(run);
  const panels = pair.map((_, side) => {
    const own = { ...options, method: () => pair[side], genie: () => (side && options.genie() >= 0 ? ANY_MAP : options.genie()) }, id = (name) => byId(name + suffixes[side]);
    const views = [streetView(run, id("map"), id("map-tip"), own), hostsView(run, id("hosts"), own)];
    return run.judges || run.pictures ? [...views, cameraView(run, id("camera"), own)] : views;
  });
  const paints = [...panels.flat(), differenceView(run, byId("difference"), options), lanesView(run, byId("lanes"), axis, options), stripView(run, byId("strip"), axis, options)];

  function render() {
    axis.follow(now, byId("strip").clientWidth);
    for (const paint of paints) paint(now);
    slider.value = Math.round((now - run.begin_us) / 10000);
    const text = `${(now / 1e6).toFixed(2)} s of ${(run.end_us / 1e6).toFixed(2)} s`;
    byId("clock").value = text;
    slider.setAttribute("aria-valuetext", text);
    if (Math.abs(performance.now() - told) > 120 || !playing) { told = performance.now(); showNow(run, now); showGhosts(run, pair[0], now); }
  }
  function moveTo(t) {
    now = Math.min(Math.max(t, run.begin_us), run.end_us);
    render();
  }
  function seek(t) {
    play(false);
    moveTo(t);
    writeAddress(now, pair);
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
    if (playing && !on) writeAddress(now, pair);
    playing = on;
    byId("play").textContent = on ? "Pause" : "Play";
    if (on) { if (now >= run.end_us) now = run.begin_us; before = performance.now(); requestAnimationFrame(tick); }
  }
  function choose(id, t) {
    selected = id;
    play(false);
    const owner = run.cars.find((entry) => entry.name === run.streams[run.frames.stream[id]].car);
    if (owner.cameras) chooseCar(owner);
    byId("which-stream").value = run.frames.stream[id];
    byId("which-frame").value = run.frames.number[id];
    byId("story").replaceChildren(...storyOf(run, pair[0], id));
    byId("frame-told").textContent = shortStory(run, pair[0], id);
    moveTo(t ?? run.frames.stamp[id] + Math.max(pair[0].rows.first_answer_us[id], 0));
    byId("frame").style.scrollMarginTop = `${byId("frames").offsetHeight}px`;
  }
  function chooseByHand(id) {
    choose(id);
    writeAddress(now, pair);
  }
  function chooseCar(chosen) {
    car = chosen;
    byId("camera-of").value = run.cars.indexOf(car);
  }
  // Puts two methods side by side. Whoever is asked for on one side and stands on the other changes places with it.
  function choosePair(methods) {
    pair = methods;
    pair.forEach((method, side) => { byId(`method${suffixes[side]}`).value = run.methods.indexOf(method); });
    moments = pair.length > 1 ? momentsOf(run, pair) : [];
    byId("differ").hidden = byId("moment").hidden = !moments.length;
    byId("moment").textContent = "";
    const lines = pair.map((method, side) => `${side ? "dashed" : "solid"}: ${method.title}`).join(", ");
    byId("difference-keys").textContent = `${lines}${moments.length ? "; triangles: where the two differ most" : ""}. Click to go there.`;
    const genies = [...new Set(pair[0].lookups.genie)].map((code) => [run.names[code], code]).sort();
    byId("map-of").replaceChildren(option(NO_MAP, "none"), option(ANY_MAP, "of any Genie, the highest"), ...genies.map(([name, code]) => option(code, name)));
    byId("map-of").value = run.judges ? NO_MAP : ANY_MAP;
    byId("map-of").parentElement.hidden = !pair.some((method) => method.objects.length);
    showMarks();
  }
  const showMarks = () => showLegend(run, pair[0], options.genie() !== NO_MAP && pair.some((method) => method.objects.length));
  function chooseSide(side, method) {
    const other = pair[1 - side];
    choosePair(side ? [other === method ? pair[1] : other, method] : [method, ...(other === undefined ? [] : [other === method ? pair[0] : other])]);
    choose(selected, now);
  }
  function chooseUnder(place, id, t) {
    selected = id;
    now = t;
    chooseSide(0, run.methods[place]);
    writeAddress(now, pair);
  }
  function chooseNumber() {
    const stream = run.streams[Number(byId("which-stream").value)], first = run.frames.number[stream.first];
    chooseByHand(stream.first + Math.min(Math.max(Number(byId("which-frame").value) - first, 0), stream.count - 1));
  }
  function beside(step) {
    const stream = run.streams[run.frames.stream[selected]];
    chooseByHand(Math.min(Math.max(selected + step, stream.first), stream.first + stream.count - 1));
  }
  // To the moments at which the two differ most, the greatest difference first.
  function differ(step) {
    if (!moments.length) return;
    const shown = moments.findIndex((moment) => Math.abs(moment.t - now) < 1), next = (Math.max(shown, step > 0 ? -1 : 0) + step + moments.length) % moments.length;
    seek(moments[next].t);
    byId("moment").textContent = `${next + 1} of ${moments.length}: ${momentText(run, moments[next], pair)}`;
  }
  function keys(event) {
    const place = run.methods.indexOf(pair[0]), time = { ArrowLeft: now - STEP_US, ArrowRight: now + STEP_US, Home: run.begin_us, End: run.end_us }[event.key];
    const other = { ArrowUp: Math.max(place - 1, 0), ArrowDown: Math.min(place + 1, run.methods.length - 1) }[event.key];
    const step = { n: 1, p: -1 }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === " ") play(!playing);
    else if (step !== undefined) differ(step);
    else if (event.target.id !== "strip" && time !== undefined) seek(time);
    else if (event.target.id !== "strip" && other !== undefined) chooseUnder(other, selected, now);
    else return;
    event.preventDefault();
  }
  const showStreet = () => byId("street").scrollIntoView({ behavior: "instant" });
  function followAddress() {
    const address = readAddress(run);
    if (address === null) return false;
    const methods = [...address.methods, ...pair.filter((method) => !address.methods.includes(method))].slice(0, pair.length);
    choosePair(methods);
    choose(Math.max(latestFrame(run, car, address.t), 0), address.t);
    showStreet();
    return true;
  }

  byId("side-b").hidden = pair.length < 2;
  byId("replay").classList.toggle("alone", pair.length < 2);
  if (pair.length < 2) { byId("h-street").textContent = "Replay"; byId("method").parentElement.hidden = true; }
  for (const canvas of ["camera", "camera-b"]) byId(canvas).parentElement.hidden = !(run.judges || run.pictures);
  byId("camera-of").parentElement.hidden = !(run.judges || run.pictures);
  byId("camera-of").append(...run.cars.flatMap((entry, place) => (entry.cameras ? [option(place, entry.name)] : [])));
  byId("difference-about").textContent = run.judges ? "False or missed objects, over all cars" : "Mean age of the cars' newest answers";
  byId("attribution").textContent = run.pictures?.attribution ?? "";
  byId("which-stream").append(...run.streams.map((one, i) => option(i, `${one.car} ${one.name}`)));
  pair.forEach((_, side) => {
    const select = byId(`method${suffixes[side]}`);
    select.append(...run.methods.map((method, place) => option(place, method.title)));
    select.addEventListener("change", () => { chooseSide(side, run.methods[Number(select.value)]); writeAddress(now, pair); });
  });
  byId("camera-of").addEventListener("change", () => { chooseCar(run.cars[Number(byId("camera-of").value)]); render(); });
  byId("which").addEventListener("submit", (event) => { event.preventDefault(); chooseNumber(); });
  for (const id of ["which-stream", "which-frame"]) byId(id).addEventListener("change", chooseNumber);
  byId("earlier").addEventListener("click", () => beside(-1));
  byId("later").addEventListener("click", () => beside(1));
  byId("play").addEventListener("click", () => play(!playing));
  byId("differ").addEventListener("click", () => differ(1));
  slider.addEventListener("input", () => seek(run.begin_us + Number(slider.value) * 10000));
  for (const id of ["speed", "map-of", "trail", "views", "believed"]) byId(id).addEventListener("input", () => { showMarks(); render(); });
  for (const id of ["map", "map-b", "difference", "lanes", "strip"]) byId(id).addEventListener("keydown", keys);
  window.addEventListener("hashchange", followAddress);
  new ResizeObserver(render).observe(byId("replay"));
  byId("ages").addEventListener("toggle", render);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) byId("speed").value = "0.1";
  if (followAddress()) { window.addEventListener("load", showStreet); return; } // what stands above has its place then
  const begin = run.begin_us + (run.end_us - run.begin_us) * 0.4; // somewhere with something to see
  choosePair(pair);
  choose(interesting(run, pair[0], begin));
}
