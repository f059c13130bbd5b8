// The page of a run, from its data.

const keyOf = (name, method, placement = "all", component = "") => [name, method, placement, component].join("|");
const FOUND = new Map(DATA.metrics.map(([name, method, placement, component, value, unit, low, high, n, from, to]) =>
  [keyOf(name, method, placement, component), { value, unit, low, high, n, range: from === null ? null : { low: from, high: to, unit } }]));
const metric = (...key) => FOUND.get(keyOf(...key));
const valueOf = (...key) => metric(...key)?.value ?? null;

function showAbout() {
  const frames = Math.max(...METHODS.map((one) => one.frames), 0);
  table(byId("cars"), "Cars", ["car", "computer", "edge", "link", "route", "has"], ABOUT.cars.map((car) => [car.name, car.device,
    car.edge || "none", car.link || "none", car.route, [car.cameras ? "cameras" : "no cameras", car.genie ? "a Genie" : "no Genie"].join(", ")]));
  table(byId("edges"), "Edges", ["edge", "computer"], ABOUT.edges.map((edge) => [edge.name, edge.device]));
  byId("yaml").textContent = ABOUT.yaml;
  showFrame("one run", { run: ABOUT.run_id, seed: ABOUT.seed, simulated: `${ABOUT.seconds.toFixed(2)} s`, ...(ABOUT.warm_up ? { counted: ABOUT.warm_up } : {}),
    cars: ABOUT.how_many.cars.toLocaleString("en"), edges: ABOUT.how_many.edges ?? "not counted", "cameras per car": ABOUT.cameras.length,
    frames: `${frames.toLocaleString("en")} under each method`, model: ABOUT.model, similarity: ABOUT.similarity,
    eviction: ABOUT.eviction, "confidence rule": ABOUT.rule, "C_T": ABOUT.threshold, "on a miss": ABOUT.miss_policy },
  `run ${ABOUT.run_id}. Versions, digests and the sources of the traces are in run.json beside this page.`);
}

// A sentence or two on each of the first methods that are no baselines; of baselines alone, on each of these.
const TOLD = 2;
function headline() {
  const baselines = METHODS.filter((one) => one.baseline), others = METHODS.filter((one) => !one.baseline);
  const told = others.length ? others : baselines, left = told.length - TOLD;
  return [...told.slice(0, TOLD).flatMap((one) => aboutMethod(one, others.length ? baselines : [])),
    ...(left > 0 ? [`The figure and the table tell of the other ${left}, too.`] : [])];
}
function aboutMethod({ name, title, from_map }, baselines) {
  const first = valueOf("first_answer_mean", name), fresh = valueOf("fresh_answer_mean", name), ghosts = valueOf("ghost_share", name);
  if (first === null) return [`With ${title} no frame was answered. `];
  const parts = [`With ${title} the first answer came after `, strong(asText(first, "ms")), " on average"];
  const gains = baselines.map((other) => [other.title, valueOf("improvement_first_answer", name, "all", other.name)]).filter(([, gain]) => gain !== null);
  if (gains.length) parts.push(`, ${gains.map(([other, gain]) => `${percent(Math.abs(gain))} ${gain >= 0 ? "sooner" : "later"} than ${other}`).join(" and ")}`);
  parts.push(from_map ? `; ${percent(from_map)} of these answers were what the object map knew. ` : ". ");
  const compared = (share) => {
    const found = baselines.map((other) => [other.title, valueOf(share, other.name)]).filter(([, value]) => value !== null);
    return found.length ? ` (${found.map(([other, value]) => `${other} ${percent(value)}`).join(", ")}). ` : ". ";
  };
  if (fresh !== null) {
    parts.push("A fresh result took ", strong(asText(fresh, "ms")), `; ${percent(valueOf("fresh_answered_share", name))} of the frames got one${compared("fresh_answered_share")}`);
  }
  if (ghosts !== null) parts.push("Of the objects that its consumers held, ", strong(percent(ghosts)), ` were not there${compared("ghost_share")}`);
  return parts;
}

// 338 to 360 ms: the unit once where it is the same.
function rangeText({ low, high, unit }) {
  const [from, to] = [asText(low, unit), asText(high, unit)], word = / \S+$/.exec(to);
  return `${word && from.endsWith(word[0]) ? from.slice(0, -word[0].length) : from} to ${to}`;
}

// In brackets an interval; what has a range says so.
function cell(found, best) {
  if (!found || found.value === null) return make("td", {}, "none");
  const interval = found.low === null ? null : make("small", {}, `(${rangeText(found)})`);
  const range = found.range && make("small", {}, `range ${rangeText(found.range)}`);
  return make("td", { class: best ? "number best" : "number" }, asText(found.value, found.unit), interval, range);
}

// Whether a value is better than all others, with an interval that lies apart from theirs.
function isBest(entry, metrics, better) {
  const others = metrics.filter((other) => other && other !== entry && other.value !== null);
  if (!entry || entry.value === null || !others.length) return false;
  const [low, high] = ["low", "high"].map((end) => (of) => of[end] ?? of.value);
  return others.every((other) => (better === "lower" ? high(entry) < low(other) : low(entry) > high(other)));
}

// A metric's title; what it means stands in its tip.
const titleCell = (name) => make("span", { title: infoOf(name).meaning }, metricTitle(name));

// Bytes, computing time and energy, of everything and of cars and edges apart.
function showPrices() {
  const names = Object.keys(DATA.metric_info).filter((name) => infoOf(name).section === "Prices");
  const placements = (name) => (name.startsWith("energy") ? ["all"] : ["all", "car", "edge"]);
  const rows = names.flatMap((name) => placements(name).map((placement) => [name, placement]))
    .filter(([name, placement]) => METHODS.some((method) => metric(name, method.name, placement)))
    .map(([name, placement]) => [
      make("span", { title: infoOf(name).meaning }, metricTitle(name), placement === "all" ? "" : ` ${placementText(placement)}`),
      ...METHODS.map((method) => cell(metric(name, method.name, placement), false))]);
  byId("prices").hidden = !rows.length;
  if (!rows.length) return;
  table(byId("by-price"), null, ["", ...METHODS.map((method) => methodKey(method.name))], rows);
  byId("price-note").textContent = DATA.energy_note.replace("in brackets", "as ranges");
}

function showResults() {
  byId("headline").replaceChildren(...headline());
  const inMain = (name) => infoOf(name).tier <= DATA.main_tier && infoOf(name).section !== "Prices";
  const names = Object.keys(DATA.metric_info).filter((name) => inMain(name) && METHODS.some((method) => metric(name, method.name)));
  table(byId("by-method"), null, ["", ...METHODS.map((method) => methodKey(method.name))], names.map((name) => {
    const metrics = METHODS.map((method) => metric(name, method.name));
    return [titleCell(name), ...metrics.map((entry) => cell(entry, isBest(entry, metrics, infoOf(name).better)))];
  }));
  const placed = METHODS.flatMap(({ name }) => ["car", "edge"].map((placement) => [name, placement])).filter((key) => metric("image_reuse", ...key));
  if (!placed.length) return;   // no Genie, or no look-ups recorded
  const several = new Set(placed.map(([name]) => name)).size > 1;
  const ofGenies = Object.keys(DATA.metric_info).filter((name) => inMain(name) && infoOf(name).section === "Genies");
  table(byId("by-placement"), null, ["", ...placed.map(([name, placement]) => `${several ? `${methodTitle(name)}, ` : ""}Genies ${placementText(placement)}`)],
    ofGenies.map((name) => [titleCell(name), ...placed.map((key) => {
      const entry = metric(name, ...key);
      return cell(entry && !isShare(name) ? { ...entry, unit: infoOf(name).unit } : entry, false);
    })]));
  byId("placement-note").textContent = `Reuse: hits / requests, mean over Genies; the range is from the lowest to the ` +
    "highest running ratio of any Genie. A coalesced request is not a hit. Confidence boost: confidence added over the objects stored.";
}

// How early the first answers come, against how right they are: what consumers hold where the truth is known, else the proxy.
function showAccuracy() {
  const common = (name) => METHODS.every((one) => valueOf(name, one.name) !== null && valueOf("first_answer_mean", one.name) !== null);
  const name = ["streaming_f1", "first_proxy_f1"].find(common);
  if (!name) return;
  const streaming = name === "streaming_f1", bound = METHODS.map((one) => valueOf(name, one.name, "all", DATA.zero_delay.component)).find((value) => value !== null);
  const series = METHODS.map((one) => {
    const { value, low, high } = metric(name, one.name);
    return { name: one.title, color: methodClass(one.name), marker: methodMarker(one.name), points: [{ x: valueOf("first_answer_mean", one.name), found: [value, low, high] }] };
  });
  intervalChart(byId("accuracy"), { height: 210, title: "Accuracy versus latency", series, x: { log: true, label: `${metricTitle("first_answer_mean")} [ms], logarithmic`, read: (value) => asText(value, "ms") },
    y: { label: metricTitle(name), most: 1, format: percent, read: percent, levels: bound ? [{ y: bound, label: DATA.zero_delay.title }] : [] },
    note: `${infoOf(name).meaning}${streaming ? "" : " 'genie-sim import truth' adds the truth of a labelled drive."} Up and to the left is better.` });
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
      name: `${methodTitle(curve.method)}${curve.answer === "fresh" ? ", fresh" : ""}`, color: `${methodClass(curve.method)} ${curve.answer}`,
      marker: methodMarker(curve.method), hollow: curve.answer === "fresh",
      x: curve.ms, y: curve.rank.map((rank) => rank / curve[of]), steps: true }));
    lineChart(byId("cdf"), { series, height: 250, x: { log: true, min: Math.max(0.8 * Math.min(...all), 0.1), max: 1.25 * Math.max(...all, DATA.deadline_ms),
      label: "response time since the camera's stamp [ms], logarithmic", read: (value) => `within ${read(value)}` },
      y: { min: 0, max: 1, label: `share of ${of} frames`, format: percent, read: percent }, marks: [{ x: DATA.deadline_ms, label: `${DATA.deadline_ms} ms` }] });
  };
  byId("cdf-of").addEventListener("change", render);
  render();
}

const timeAxisOf = (series) => ({ min: 0, max: Math.max(...series.flatMap((one) => one.x), 1e-3), label: "simulated time [s]", read: (value) => `at ${value.toFixed(2)} s` });
const faultSpans = (method) => DATA.faults.filter((fault) => fault.method === method).map(({ fault, target, from, to }) => ({ from, to, text: `${fault} of ${target}` }));
const highest = (series, least) => Math.max(1.08 * Math.max(...series.flatMap((one) => one.y), 0), least);

// Which method a section is about: the choice starts with the last one that is no baseline, and hides if it is the only one.
function chooseMethod(id, shown, render) {
  const methods = METHODS.filter((one) => shown(one.name));
  byId(id).closest("section").hidden = !methods.length;
  byId(id).replaceChildren(...methods.map((one) => option(one.name, one.title)));
  if (!methods.length) return;
  byId(id).value = (methods.findLast((one) => !one.baseline) ?? methods.at(-1)).name;
  byId(id).closest(".controls").hidden = methods.length === 1;
  byId(id).addEventListener("change", render);
  render();
}

function showOverTime() {
  const charts = [["image_reuse", "Image reuse of each Genie so far"], ["object_reuse", "Object reuse of each Genie so far"],
    ["confidence_boost", "Confidence added so far over the objects then stored"]];
  const dashes = [null, "7 3", "2 3", "9 3 2 3"], lineOf = (number) => ({ dash: dashes[number % dashes.length], marker: number < dashes.length ? undefined : number });
  const of = (name, method) => DATA.over_time[name].filter((one) => one.method === method && one.x.length);
  chooseMethod("reuse-of", (method) => charts.some(([name]) => of(name, method).length), () => {
    byId("over-time").replaceChildren();
    for (const [name, title] of charts) {
      const places = { car: 0, edge: 0 };
      const series = of(name, byId("reuse-of").value).map((one) => ({ ...one, name: one.name || placementText(one.placement),
        color: `p-${one.placement}`, ...lineOf(places[one.placement]++) }));
      if (!series.length) continue;
      const boost = name === "confidence_boost", low = Math.min(0, ...series.flatMap((one) => one.y));
      lineChart(byId("over-time").appendChild(make("div")), { title, series, height: 190, x: timeAxisOf(series), spans: faultSpans(byId("reuse-of").value),
        y: { min: boost ? low : 0, max: boost ? highest(series, 1e-4) : Math.min(1, highest(series, 0.05)), label: title, format: boost ? (value) => digits(value) : percent, read: boost ? (value) => value.toFixed(4) : percent } });
    }
  });
}

function showUse() {
  const hostOf = (name) => name.split(/[./]|->/)[0], dashes = [null, "7 3", "2 3"];
  const hosts = [...new Set(DATA.use.map((one) => hostOf(one.name)))].sort((one, other) => one.localeCompare(other, "en", { numeric: true }));
  const kinds = { accelerator: "Utilization of accelerators", cpu: "Utilization of CPUs", link: "Utilization of links", cell: "Utilization of radio cells", queue: "Messages waiting" };
  chooseMethod("use-of", (method) => DATA.use.some((one) => one.method === method), () => {
    byId("use-charts").replaceChildren();
    for (const [kind, title] of Object.entries(kinds)) {
      const series = DATA.use.filter((one) => one.method === byId("use-of").value && one.kind === kind)
        .map((one, i, all) => ({ ...one, name: one.name.replace(/\.(accelerator|cpu)$/, ""), color: `h${hosts.indexOf(hostOf(one.name)) % DATA.hosts}`, marker: hosts.indexOf(hostOf(one.name)),
          dash: dashes[Math.min(all.slice(0, i).filter((other) => hostOf(other.name) === hostOf(one.name)).length, 2)] }));
      if (!series.length) continue;
      const queue = kind === "queue";
      lineChart(byId("use-charts").appendChild(make("div")), { title, series, height: 180, x: timeAxisOf(series), spans: faultSpans(byId("use-of").value),
        y: { min: 0, max: queue ? highest(series, 1) : Math.min(1, highest(series, 0.1)), label: title, format: queue ? (value) => digits(value) : percent, read: queue ? (value) => value.toFixed(2) : percent } });
    }
  });
}

function showMetrics() {
  const text = (value) => (value === null ? "" : digits(value, 4));
  filteredTable("metric", ["title", "metric", "method", "placement", "component", "value", "unit", "low", "high", "n"],
    DATA.metrics.map(([name, method, placement, component, value, unit, low, high, n, from, to]) =>
      [titleCell(name), name, method, placement, component, text(value), unit, text(low), text(high), n.toLocaleString("en")]), 5);
}

showResults();
showPrices();
showAccuracy();
showLatency();
showParts();
showOverTime();
showUse();
showMetrics();
showReplay();
showFleet();
showAbout();
