// Puts the page together from its data.

const DATA = JSON.parse(byId("data").textContent);
const ABOUT = DATA.about;
const FOUND = new Map(DATA.metrics.map(([name, role, value, unit, low, high, n]) => [`${name} ${role}`, { value, unit, low, high, n }]));
const metric = (name, role) => FOUND.get(`${name} ${role}`);
const valueOf = (name, role) => { const found = metric(name, role); return found ? found.value : null; };

function showAbout() {
  byId("version").textContent = ABOUT.genie_sim;
  byId("name").textContent = ABOUT.name;
  byId("description").textContent = ABOUT.description;
  const frames = Math.max(...Object.values(ABOUT.frames), 0);
  const facts = { run: ABOUT.run_id, seed: ABOUT.seed, "simulated": `${digits(ABOUT.seconds)} s`,
    cars: ABOUT.how_many.cars.toLocaleString("en"), edges: ABOUT.how_many.edges ?? "not counted", "cameras a car": ABOUT.cameras.length,
    frames: `${frames.toLocaleString("en")} under each method`, model: ABOUT.model, similarity: ABOUT.similarity,
    eviction: ABOUT.eviction, "confidence rule": ABOUT.rule, "C_T": ABOUT.threshold, "on a miss": ABOUT.miss_policy };
  byId("about").replaceChildren(...Object.entries(facts).map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, String(value)))));
  table(byId("cars"), "Cars", ["car", "computer", "edge", "link", "route", "has"], ABOUT.cars.map((car) => [car.name, car.device,
    car.edge || "none", car.link || "none", car.route, [car.cameras ? "cameras" : "no cameras", car.genie ? "a Genie" : "no Genie"].join(", ")]));
  table(byId("edges"), "Edges", ["edge", "computer"], ABOUT.edges.map((edge) => [edge.name, edge.device]));
  byId("yaml").textContent = ABOUT.yaml;
  byId("notes").replaceChildren(...[...DATA.notes, `Made by genie-sim ${ABOUT.genie_sim} from run ${ABOUT.run_id}. Versions, ` +
    "digests and the sources of the traces are in run.json beside this page."].map((note) => make("li", {}, note)));
}

function headline() {
  const first = valueOf("first_answer_mean", "genie"), fresh = valueOf("fresh_answer_mean", "genie");
  if (first === null) return ["Genie was not simulated in this run."];
  const strong = (text) => make("b", {}, text), parts = ["With Genie the first answer came after ", strong(asText(first, "ms")), " on average"];
  const against = ["local", "remote"].flatMap((name) => {
    const gain = valueOf("improvement_first_answer", name);
    return gain === null ? [] : [`${percent(Math.abs(gain))} ${gain >= 0 ? "sooner" : "later"} than ${name} execution`];
  });
  if (against.length) parts.push(`, ${against.join(" and ")}`);
  parts.push(ABOUT.from_map ? `; ${percent(ABOUT.from_map)} of these answers were what the object map knew. ` : ". ");
  const share = valueOf("fresh_answered_share", "genie");
  if (fresh !== null) {
    parts.push("A fresh answer took ", strong(asText(fresh, "ms")), `; ${percent(share)} of the frames got one`);
    const others = ["local", "remote"].flatMap((name) => {
      const other = valueOf("fresh_answered_share", name);
      return other === null ? [] : [`${percent(other)} ${name}`];
    });
    parts.push(others.length ? ` (${others.join(", ")}).` : ".");
  }
  const ghosts = valueOf("ghost_share", "genie");
  if (ghosts !== null) {
    const others = ["local", "remote"].flatMap((name) => {
      const other = valueOf("ghost_share", name);
      return other === null ? [] : [`${percent(other)} ${name}`];
    });
    parts.push(" Of the objects in first answers, ", strong(percent(ghosts)), ` were not there${others.length ? ` (${others.join(", ")})` : ""}.`);
  }
  return parts;
}

// 338 to 360 ms: the unit once where it is the same.
function rangeText({ low, high, unit }) {
  const [from, to] = [asText(low, unit), asText(high, unit)], word = / \S+$/.exec(to);
  return `${word && from.endsWith(word[0]) ? from.slice(0, -word[0].length) : from} to ${to}`;
}

function cell(found, best) {
  if (!found || found.value === null) return make("td", {}, "none");
  const range = found.low === null ? null : make("small", {}, rangeText(found));
  return make("td", { class: best ? "number best" : "number" }, asText(found.value, found.unit), range);
}

function showResults() {
  byId("headline").replaceChildren(...headline());
  const rows = [["First answer, mean", "first_answer_mean", Math.min], ["First answer, 95th percentile", "first_answer_p95", Math.min],
    [`First answer within ${DATA.deadline_ms} ms`, "under_deadline_share", Math.max], ["Fresh answer, mean", "fresh_answer_mean", Math.min],
    ["Fresh answer, 95th percentile", "fresh_answer_p95", Math.min], [`Fresh answer within ${DATA.deadline_ms} ms`, "fresh_under_deadline_share", Math.max],
    ["Frames answered at all", "answered_share", Math.max], ["Frames answered afresh", "fresh_answered_share", Math.max], ["Frames dropped", "dropped_share", Math.min]];
  if (ABOUT.methods.some((name) => metric("ghost_share", name))) {   // in a town, where the truth is known
    rows.push(["Served objects that are not there", "ghost_share", Math.min], ["Cache hits that show what is not in view", "wrong_hit_share", Math.min],
      ["Objects in view that were served", "object_recall", Math.max]);
  }
  table(byId("by-method"), null, ["", ...ABOUT.methods.map((name) => METHOD_NAMES[name])], rows.map(([text, name, better]) => {
    const found = ABOUT.methods.map((method) => metric(name, method));
    const known = found.filter((one) => one && one.value !== null).map((one) => one.value);
    return [text, ...found.map((one) => cell(one, one && known.length > 1 && one.value === better(...known)))];
  }));
  const roles = [["Image reuse", "image_reuse"], ["Object reuse", "object_reuse"], ["Confidence boost an update", "confidence_boost"],
    ["Coalesced requests", "coalesced_share"], ["Stored images a Genie", "stored_images"], ["Stored objects a Genie", "stored_objects"]];
  if (!roles.some(([, name]) => metric(name, "local") || metric(name, "remote"))) return;   // no Genie, or no look-ups recorded
  table(byId("by-role"), null, ["", "Genies on cars", "Genies on edges"],
    roles.map(([text, name]) => [text, ...["local", "remote"].map((role) => {
      const found = metric(name, role);
      return cell(found && /^(stored|confidence)/.test(name) ? { ...found, unit: "" } : found, false);
    })]));
  byId("role-note").textContent = `Reuse: hits / requests, mean over Genies; in small print the lowest and the highest ratio in any ` +
    `${DATA.window_requests} requests of one Genie. A coalesced request is not a hit.`;
}

function showLatency() {
  const all = DATA.cdf.flatMap((curve) => curve.ms);
  if (!all.length) { byId("latency").hidden = true; return; }
  const same = (curve) => curve.answer === "fresh" && DATA.cdf.some((other) => other.method === curve.method && other.answer === "first" &&
    other.answered === curve.answered && String(other.ms) === String(curve.ms));
  const read = (value) => asText(value, "ms");
  const render = () => {
    const of = byId("cdf-of").value;
    const series = DATA.cdf.filter((curve) => curve.ms.length && !same(curve)).map((curve) => ({
      name: `${METHOD_NAMES[curve.method]}${curve.answer === "fresh" ? ", fresh" : ""}`, color: `c-${curve.method}`,
      dash: curve.answer === "fresh" ? "6 4" : null, x: curve.ms, y: curve.rank.map((rank) => rank / curve[of]), steps: true }));
    lineChart(byId("cdf"), { series, height: 320, x: { log: true, min: Math.max(0.8 * Math.min(...all), 0.1), max: 1.25 * Math.max(...all, DATA.deadline_ms),
      label: "response time [ms], logarithmic", read: (value) => `within ${read(value)}` },
      y: { min: 0, max: 1, label: `share of ${of} frames`, format: percent, read: percent }, marks: [{ x: DATA.deadline_ms, label: `${DATA.deadline_ms} ms` }] });
  };
  byId("cdf-of").addEventListener("change", render);
  render();
}

const timeAxis = (series) => ({ min: 0, max: Math.max(...series.flatMap((one) => one.x), 1e-3), label: "simulated time [s]", read: (value) => `at ${value.toFixed(2)} s` });
const highest = (series, least) => Math.max(1.08 * Math.max(...series.flatMap((one) => one.y), 0), least);

function showOverTime() {
  const charts = [["image_reuse", `Image reuse, last ${DATA.window_requests} requests of each Genie`], ["object_reuse", `Object reuse, last ${DATA.window_requests} look-ups of each Genie`],
    ["confidence_boost", "Confidence boost: mean of C(new) - C(old) so far"]];
  byId("over-time").replaceChildren();
  for (const [name, title] of charts) {
    const places = { local: 0, remote: 0 };
    const series = DATA.over_time[name].map((one) => {
      const place = places[one.role]++, dashes = [null, "7 3", "2 3", "9 3 2 3"];
      return { ...one, name: name === "confidence_boost" ? { local: "on cars", remote: "on edges" }[one.role] : one.name,
        color: one.role === "local" ? "c-local" : "c-genie", dash: dashes[place % dashes.length] };
    });
    if (!series.some((one) => one.x.length)) continue;
    const boost = name === "confidence_boost", low = Math.min(0, ...series.flatMap((one) => one.y));
    lineChart(byId("over-time").appendChild(make("div")), { title, series, x: timeAxis(series),
      y: { min: boost ? low : 0, max: boost ? highest(series, 1e-4) : Math.min(1, highest(series, 0.05)), label: title, format: boost ? (value) => digits(value) : percent, read: boost ? (value) => value.toFixed(4) : percent } });
  }
  byId("reuse").hidden = !byId("over-time").children.length;
}

function showUse() {
  const kinds = { accelerator: "Accelerators busy", cpu: "CPUs busy", link: "Links busy", queue: "Messages waiting" };
  const methods = ABOUT.methods.filter((name) => DATA.use.some((one) => one.method === name));
  byId("use").hidden = !methods.length;
  byId("use-of").replaceChildren(...methods.map((name) => make("option", { value: name, selected: name === "genie" }, METHOD_NAMES[name])));
  const render = () => {
    byId("use-charts").replaceChildren();
    for (const [kind, title] of Object.entries(kinds)) {
      const dashes = [null, "7 3", "2 3"];
      const series = DATA.use.filter((one) => one.method === byId("use-of").value && one.kind === kind)
        .map((one, i) => ({ ...one, name: one.name.replace(/\.(accelerator|cpu)$/, ""), color: `c${i % 8}`, dash: dashes[i % 3] }));
      if (!series.length) continue;
      const queue = kind === "queue";
      lineChart(byId("use-charts").appendChild(make("div")), { title, series, height: 210, x: timeAxis(series),
        y: { min: 0, max: queue ? highest(series, 1) : Math.min(1, highest(series, 0.1)), label: title, format: queue ? (value) => digits(value) : percent, read: queue ? (value) => value.toFixed(2) : percent } });
    }
  };
  byId("use-of").addEventListener("change", render);
  if (methods.length) render();
}

function showMetrics() {
  const render = () => {
    const words = byId("metric-filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const rows = DATA.metrics.filter(([name, role]) => words.every((word) => `${name} ${role}`.toLowerCase().includes(word)));
    byId("metric-count").textContent = `${rows.length} of ${DATA.metrics.length}`;
    const text = (value, unit) => value === null ? "" : unit === "1" || unit === "" ? digits(value, 4) : digits(value, 4);
    table(byId("metric-table"), null, ["metric", "role", "value", "unit", "low", "high", "n"], rows.map(([name, role, value, unit, low, high, n]) =>
      [name, role, text(value, unit), unit, text(low, unit), text(high, unit), n.toLocaleString("en")]));
  };
  byId("metric-filter").addEventListener("input", render);
  render();
}

function showReplay() {
  if (!DATA.replay) { byId("street").hidden = byId("frame").hidden = true; return; }
  const run = decode({ ...DATA.replay, about: ABOUT }, ABOUT), slider = byId("time");
  const still = window.matchMedia("(prefers-reduced-motion: reduce)");
  let now = run.begin_us, selected = -1, playing = false, before = 0, told = 0;
  slider.min = 0;
  slider.max = Math.round((run.end_us - run.begin_us) / 10000);
  const genies = [...new Set(run.lookups.genie)].map((code) => [run.names[code], code]).sort();
  byId("map-of").append(make("option", { value: -1 }, "of any Genie, the highest"), ...genies.map(([name, code]) => make("option", { value: code }, name)));
  const options = { speed: () => Number(byId("speed").value), genie: () => Number(byId("map-of").value), trail: () => byId("trail").checked,
    views: () => byId("views").checked, selected: () => selected, now: () => now, choose };
  const street = streetView(run, byId("map"), byId("map-tip"), options), strip = stripView(run, byId("strip"), options);

  function render() {
    street(now);
    strip(now);
    slider.value = Math.round((now - run.begin_us) / 10000);
    const text = `${(now / 1e6).toFixed(2)} s of ${(run.end_us / 1e6).toFixed(2)} s`;
    byId("clock").value = text;
    slider.setAttribute("aria-valuetext", text);
    if (Math.abs(performance.now() - told) > 120 || !playing) { told = performance.now(); showNow(); }
  }
  function showNow() {
    const some = run.cars.slice(0, 12);
    table(byId("now"), null, ["car", "latest answer", "after", run.methods.genie ? "hits so far" : ""], some.map((car) => {
      const id = latestFrame(run, car, now, true), rows = run.rows;
      let hits = 0, all = 0;
      for (const stream of car.streams) {
        for (let i = lastUpTo(stream.stamp, now); i >= 0; i -= 1) { all += 1; hits += rows.outcome[stream.first + i] === 1; }
      }
      const share = run.methods.genie && all ? percent(hits / all) : "";
      if (id < 0) return [car.name, "none yet", "", share];
      return [car.name, make("td", {}, make("span", { class: `outcome o-${outcomeOf(run, id)}` }, outcomeText(run, id)),
        make("small", {}, `${run.streams[run.frames.stream[id]].name} ${run.frames.number[id]}`)),
      make("td", { class: "number" }, inMs(rows.first_answer_us[id] - Math.max(rows.received_us[id], 0))), share];
    }));
  }
  function tick(time) {
    if (!playing) return;
    now += Math.min(time - before, 100) * 1000 * options.speed();
    before = time;
    if (now >= run.end_us) { now = run.end_us; play(false); }
    render();
    requestAnimationFrame(tick);
  }
  function play(on) {
    playing = on;
    byId("play").textContent = on ? "Pause" : "Play";
    byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
    if (on) { if (now >= run.end_us) now = run.begin_us; before = performance.now(); requestAnimationFrame(tick); }
  }
  function choose(id) {
    selected = id;
    play(false);
    const stream = run.frames.stream[id], answer = run.rows.first_answer_us[id];
    now = Math.min(run.frames.stamp[id] + (answer >= 0 ? answer : 0), run.end_us);
    byId("which-stream").value = stream;
    byId("which-frame").value = run.frames.number[id];
    byId("story").replaceChildren(...storyOf(run, id));
    render();
  }
  function chooseNumber() {
    const stream = run.streams[Number(byId("which-stream").value)], first = run.frames.number[stream.first];
    choose(stream.first + Math.min(Math.max(Number(byId("which-frame").value) - first, 0), stream.count - 1));
  }
  function beside(step) {
    const stream = run.streams[run.frames.stream[Math.max(selected, 0)]];
    choose(Math.min(Math.max(selected + step, stream.first), stream.first + stream.count - 1));
  }
  byId("which-stream").append(...run.streams.map((one, i) => make("option", { value: i }, `${one.car} ${one.name}`)));
  byId("which").addEventListener("submit", (event) => { event.preventDefault(); chooseNumber(); });
  byId("which-stream").addEventListener("change", chooseNumber);
  byId("which-frame").addEventListener("change", chooseNumber);
  byId("earlier").addEventListener("click", () => beside(-1));
  byId("later").addEventListener("click", () => beside(1));
  byId("play").addEventListener("click", () => play(!playing));
  slider.addEventListener("input", () => { play(false); now = run.begin_us + Number(slider.value) * 10000; render(); });
  for (const id of ["speed", "map-of", "trail", "views"]) byId(id).addEventListener("input", render);
  new ResizeObserver(render).observe(byId("replay"));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
  if (still.matches) byId("speed").value = "0.1";
  showLegend(run);
  now = run.begin_us + (run.end_us - run.begin_us) * 0.4; // somewhere with something to see
  choose(interesting(run, now));
}

// A frame to begin with: a miss around that time that its edge or a detector answered later, so that there is a story.
function interesting(run, t) {
  const near = run.frames.stamp.map((stamp, id) => [Math.abs(stamp - t), id]).sort((one, other) => one[0] - other[0]).slice(0, 400).map(([, id]) => id);
  const told = (id) => (run.of_frame.get(id) || []).some((row) => run.lookups.remote[row]);
  return near.find((id) => outcomeOf(run, id) === "miss" && run.rows.fresh_answer_us[id] >= 0 && told(id)) ?? near.find((id) => run.rows.first_answer_us[id] >= 0) ?? near[0] ?? 0;
}

function showLegend(run) {
  const sign = (shape, text) => make("span", {}, draw("svg", { width: 14, height: 14, "aria-hidden": "true" }, shape), text);
  const disc = { cx: 7, cy: 7, r: 4.5 }, box = { x: 2.5, y: 2.5, width: 9, height: 9 };
  const genie = run.method === "genie";
  byId("legend").replaceChildren(
    sign(draw("circle", { ...disc, fill: "var(--hit)" }), genie ? "hit" : "answered"),
    ...(genie ? [sign(draw("circle", { ...disc, fill: "none", stroke: "var(--miss)", "stroke-width": 2 }), "miss"),
      sign(draw("rect", { ...box, fill: "var(--coalesced)" }), "coalesced: waits for an equal frame")] : []),
    sign(draw("circle", { ...disc, fill: "none", stroke: "var(--none)", "stroke-width": 2 }), "no answer"),
    ...(run.objects.length ? [sign(draw("rect", { ...box, fill: "var(--sure)" }), "object of high confidence (square: vehicle, disc: person or cycle)"),
      sign(draw("rect", { ...box, fill: "var(--unsure)" }), "of low confidence"),
      sign(draw("rect", { ...box, fill: "none", stroke: "var(--unsure)", "stroke-width": 2 }), "below C_T: not shared")] : []),
    make("span", {}, "Edges have no place on the street; they stand above it. Click a car for its latest frame."));
  byId("strip-about").textContent = `${METHOD_NAMES[run.method]}: a cell a frame, filled where a fresh answer came. Click one, or use the arrow keys.`;
}

showAbout();
showResults();
showLatency();
showOverTime();
showUse();
showMetrics();
showReplay();
for (const link of document.querySelectorAll("nav a")) link.hidden = byId(link.hash.slice(1)).hidden;
