// One frame's whole story: what became of it under each method, and step by step what happened under one of them.
// Milliseconds count from the camera's stamp, as in the metrics.

const SOURCES = {
  own_cache: "the message cache of its own Genie", own_detector: "its own detector", edge_cache: "its edge's message cache",
  edge_detector: "its edge's detector", peer_cache: "another edge's message cache", map: "the object map", none: "nobody",
};
const LETTER_PX = 7.2; // of a method's title
const LAST = 1e15; // after everything that has an instant

const partTitle = (run, part) => run.parts[part].title;
const partSquare = (part) => draw("svg", { width: 14, height: 12, "aria-hidden": "true" }, draw("rect", { class: `part-${part}`, x: 1, y: 1, width: 12, height: 10 }));

// The steps of a frame to its fresh result, or to the first answer if no fresh one came, from the camera's stamp on [ns].
function stepsTo(run, { rows, steps }, id) {
  const all = steps.of_frame.get(id) ?? [], kind = (row) => run.whichs[steps.which[row]];
  const fresh = all.filter((row) => ["fresh", "both"].includes(kind(row)));
  const shown = fresh.length ? fresh : all.filter((row) => kind(row) === "first");
  if (!shown.length) return [];
  let t = Math.max(rows.received_ns[id], 0);
  const first = { part: run.parts.findIndex(({ name }) => name === "hop"), place: run.streams[run.frames.stream[id]].car, from: 0, took: t };
  return [first, ...shown.map((row) => {
    const from = t;
    t += steps.took_ns[row];
    return { part: steps.part[row], place: run.names[steps.place[row]], from, took: steps.took_ns[row] };
  })];
}
function partsOfFrame(run, method, id) {
  const steps = stepsTo(run, method, id), number = (ns) => make("td", {}, `${(ns / 1e6).toFixed(6)} ms`);
  if (!steps.length) return [];
  const line = (title, ...cells) => make("tr", {}, make("th", { scope: "row" }, ...title), ...cells);
  const head = ["step", "at", "since the stamp", "took"].map((text) => make("th", { scope: "col" }, text));
  const whole = steps.reduce((sum, one) => sum + one.took, 0);
  return [make("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Steps of the frame" }, make("table", {}, make("thead", {}, make("tr", {}, ...head)), make("tbody", {},
    ...steps.map(({ part, place, from, took }) => line([partSquare(part), ` ${partTitle(run, part)}`], make("td", {}, place), number(from), number(took))),
    line(["all"], make("td", {}), make("td", {}), number(whole)))))];
}

function storyOf(run, method, id) {
  const { frames } = run, stream = run.streams[frames.stream[id]];
  const place = `${frames.east[id].toFixed(1)} m east, ${frames.north[id].toFixed(1)} m north`;
  const title = make("h3", {}, `${stream.car}, ${stream.name}, frame ${frames.number[id]}, under `, methodKey(method), ": ",
    make("span", { class: `outcome o-${outcomeOf(run, method, id)}` }, outcomeText(run, method, id)));
  const sees = run.cars.find((one) => one.name === stream.car).cameras;
  const begin = sees ? `${stream.car} takes the picture with ${stream.name}` : `${stream.car}, without cameras, asks with its position`;
  const steps = [{ t: 0, text: begin, small: place }, ...stepsOf(run, method, id)];
  steps.sort((one, other) => one.t - other.t);
  return [comparison(run, id), make("div", {}, title, make("p", { class: "small" }, "Times count from the camera's stamp."),
    ...folded("Where its time went", partsOfFrame(run, method, id)),
    ...folded("What happened to it", [make("ol", {}, ...steps.map((step) => make("li", {}, make("span", {}, step.t >= LAST ? "" : inMs(step.t)),
      make("span", { class: step.tone ? `o-${step.tone}` : null }, step.text, step.small ? make("span", { class: "small" }, step.small) : null))))]))];
}

// What opens on a click, and then stays open for the next frames.
const OPENED = new Set();
function folded(title, children) {
  if (!children.length) return [];
  const noted = (event) => { if (event.currentTarget.open) OPENED.add(title); else OPENED.delete(title); };
  return [make("details", { open: OPENED.has(title), ontoggle: noted }, make("summary", {}, title), ...children)];
}

// The title of the story in one line, for the strip of frames.
function shortStory(run, method, id) {
  const stream = run.streams[run.frames.stream[id]];
  return `${stream.car}, ${stream.name}, frame ${run.frames.number[id]}, ${method.title}: ${outcomeText(run, method, id)}; ${inWords(run, method.rows, id)}.`;
}

function stepsOf(run, method, id) {
  const { rows, lookups } = method, { names } = run, steps = lookupSteps(run, method, id);
  const first = rows.first_answer_us[id], fresh = rows.fresh_answer_us[id], drop = rows.drop[id] >= 0 ? names[rows.drop[id]] : null;
  const after = (us) => `${inMs(us)} after the picture`;
  if (rows.received_ns[id] >= 0) steps.push({ t: rows.received_ns[id] / 1000, text: "The queue of the first node receives it" });
  if (first >= 0) {
    steps.push({ t: first, tone: "hit", text: `First answer: ${countOf(rows.objects_served[id])} from ${SOURCES[names[rows.source[id]]]}`,
      small: [rows.served_by[id] >= 0 ? `served by ${names[rows.served_by[id]]}` : null, after(first)].filter(Boolean).join(", ") });
  }
  const result = rows.result_answer_us[id];
  if (result >= 0 && result !== first && result !== fresh) {
    steps.push({ t: result, tone: "hit", text: `Result of another frame: ${countOf(rows.objects_result[id])}`, small: after(result) });
  }
  if (fresh >= 0 && fresh !== first) steps.push({ t: fresh, tone: "hit", text: `Fresh result: ${countOf(rows.objects_fresh[id])} of this very frame`, small: after(fresh) });
  if (first < 0) steps.push({ t: LAST, tone: "miss", text: drop ? `Never answered: dropped at ${drop}` : "Never answered" });
  else if (fresh < 0) steps.push({ t: LAST, tone: "none", text: "No fresh result ever came", small: drop ? `dropped at ${drop}` : null });
  if (rows.bytes_up[id] > 0 || rows.bytes_down[id] > 0) {
    steps.push({ t: 2 * LAST, tone: "none", text: `On the car's link: ${bytes(rows.bytes_up[id])} up, ${bytes(rows.bytes_down[id])} down` });
  }
  return steps;
}
function lookupSteps(run, { lookups, of_frame }, id) {
  return (of_frame.get(id) || []).map((row) => {
    const genie = run.names[lookups.genie[row]], t = lookups.t[row] - run.frames.stamp[id], kind = run.kinds[lookups.kind[row]];
    if (kind === "image") {
      const outcome = run.outcomes[lookups.outcome[row]];
      const requester = lookups.neighbour[row] ? "asked by another edge" : lookups.edge[row] ? "asked by the car" : "asked in its own car";
      const meaning = { hit: "a stored answer is replayed", coalesced: "an equal frame is pending: it waits for that one's answer",
        miss: lookups.neighbour[row] ? "it has nothing to offer" : "the frame goes to the detector and on" }[outcome];
      return { t, tone: outcome, text: `${genie} looks into its message cache: ${outcome}`, small: `${requester}; ${meaning}; ${lookups.entries[row]} entries` };
    }
    const boost = lookups.boost_e4[row] / 10000;
    return { t, text: kind === "sighting" ? `${genie} takes the objects of an answer into its map` : `${genie} adds what its map knows`,
      small: `${lookups.requests[row]} looked up, ${lookups.hits[row]} found with enough confidence` +
        (lookups.updates[row] ? `; ${lookups.updates[row]} confidences changed, ${boost >= 0 ? "+" : ""}${boost.toFixed(3)} in all` : "") +
        `; ${lookups.entries[row]} objects stored` };
  });
}

// The same frame under every method, on one axis of milliseconds since the camera's stamp.
function comparison(run, id) {
  const room = byId("story").clientWidth || 640, { methods } = run;
  const width = Math.max(300, Math.min(room > 1100 ? room / 2 - 16 : room, 830)); // two columns, or one
  const narrow = width < 560, row = narrow ? 44 : 30;
  const left = Math.min(12 + LETTER_PX * Math.max(...methods.map(({ title }) => title.length)), (narrow ? 0.45 : 0.3) * width);
  const fitting = (title) => (LETTER_PX * title.length + 12 > left ? `${title.slice(0, Math.floor((left - 12) / LETTER_PX) - 1)}\u2026` : title);
  const since = ({ rows }) => ["first_answer_us", "fresh_answer_us"].map((name) => rows[name][id]);
  const span = 1.05 * Math.max(1000, ...methods.flatMap(since)), across = (us) => left + us / span * (width - left - 40);
  const svg = draw("svg", { width, height: row * methods.length + 29, role: "img",
    "aria-label": methods.map(({ title, rows }) => `${title}: ${inWords(run, rows, id)}`).join("; ") });
  const shown = new Set();
  methods.forEach((method, index) => {
    const y = index * row + 20, [first, fresh] = since(method), last = Math.max(first, fresh), told = inWords(run, method.rows, id);
    svg.append(draw("text", { x: 0, y: y + 4 }, draw("title", {}, method.title), fitting(method.title)));
    if (narrow || last < 0) svg.append(draw("text", { class: "quiet", x: narrow ? 0 : left, y: narrow ? y + 20 : y + 4 }, told));
    if (last < 0) return;
    for (const { part, place, from, took } of stepsTo(run, method, id)) {
      svg.append(draw("rect", { class: `step part-${part}`, x: across(from / 1000), y: y - 5, width: Math.max(took / 1000 / span * (width - left - 40), 0.5), height: 10 },
        draw("title", {}, `${partTitle(run, part)}, ${place}: ${inMs(took / 1000)}`)));
      shown.add(part);
    }
    const mine = draw("g", { class: methodClass(method) }, ...(shown.size ? [] : [draw("path", { d: `M${across(0)} ${y}H${across(last)}`, "stroke-width": 3 })]),
      draw("circle", { cx: across(first), cy: y, r: 5.5 }));
    if (fresh >= 0 && fresh !== first) mine.append(draw("circle", { class: "hollow", cx: across(fresh), cy: y, r: 5.5 }));
    svg.append(mine);
    if (!narrow) svg.append(draw("text", { class: "quiet", x: Math.min(across(last) + 10, width - 2), y: y - 7, "text-anchor": across(last) > width - 150 ? "end" : "start" }, told));
  });
  const y = row * methods.length + 19;
  for (const tick of linearTicks(0, span / 1000, 5)) svg.append(draw("text", { class: "quiet", x: across(tick * 1000), y, "text-anchor": "middle" }, `${tick} ms`));
  const sign = (shape, text) => make("span", {}, draw("svg", { width: 14, height: 14, "aria-hidden": "true" }, shape), text);
  return make("div", { class: "scroll" }, svg, make("div", { class: "legend" },
    sign(draw("circle", { cx: 7, cy: 7, r: 5, fill: "currentColor" }), "first answer (or first and fresh in one)"),
    sign(draw("circle", { class: "hollow", cx: 7, cy: 7, r: 5, stroke: "currentColor" }), "fresh result"),
    ...[...shown].sort((one, other) => one - other).map((part) => make("span", {}, partSquare(part), partTitle(run, part)))));
}
function inWords(run, rows, id) {
  const first = rows.first_answer_us[id], fresh = rows.fresh_answer_us[id], drop = rows.drop[id], ms = inMs;
  if (first < 0) return drop >= 0 ? `no answer: dropped at ${run.names[drop]}` : "no answer";
  if (fresh < 0) return `first ${ms(first)}, no fresh one`;
  return fresh === first ? `fresh ${ms(fresh)}` : `first ${ms(first)}, fresh ${ms(fresh)}`;
}
