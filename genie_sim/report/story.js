// One frame's whole story: what became of it under each method, and step by step what the Genies did with it.

const SOURCES = {
  own_cache: "the message cache of its own Genie", own_detector: "its own detector", edge_cache: "its edge's message cache",
  edge_detector: "its edge's detector", peer_cache: "another edge's message cache", map: "the object map", none: "nobody",
};
const METHOD_NAMES = { local: "local (L)", remote: "remote (R)", genie: "Genie (DG)" };
const LAST = 1e15; // after everything that has an instant
const inMs = (us) => `${(us / 1000).toFixed(1)} ms`;

function storyOf(run, id) {
  const { frames } = run, stream = run.streams[frames.stream[id]], stamp = frames.stamp[id];
  const place = `${frames.east[id].toFixed(1)} m east, ${frames.north[id].toFixed(1)} m north`;
  const title = make("h3", {}, `${stream.car}, ${stream.name}, frame ${frames.number[id]}: `,
    make("span", { class: `outcome o-${outcomeOf(run, id)}` }, outcomeText(run, id)));
  const sees = run.cars.find((one) => one.name === stream.car).cameras;
  const begin = sees ? `${stream.car} takes the picture with ${stream.name}` : `${stream.car}, without cameras, asks with its position`;
  const steps = [{ t: 0, text: begin, small: place }, ...stepsOf(run, id, stamp)];
  steps.sort((one, other) => one.t - other.t);
  return [title, comparison(run, id),
    make("ol", {}, ...steps.map((step) => make("li", {}, make("span", {}, step.t >= LAST ? "" : `+${inMs(step.t)}`),
      make("span", { class: step.tone ? `o-${step.tone}` : null }, step.text, step.small ? make("span", { class: "small" }, step.small) : null))))];
}

function stepsOf(run, id, stamp) {
  const rows = run.rows, { lookups, names } = run, steps = [];
  const first = rows.first_answer_us[id], fresh = rows.fresh_answer_us[id], received = rows.received_us[id];
  if (received >= 0) steps.push({ t: received, text: "it is in the queue of the first node" });
  for (const row of run.of_frame.get(id) || []) {
    const genie = names[lookups.genie[row]], t = lookups.t[row] - stamp;
    if (lookups.kind[row] === 0) {
      const outcome = run.outcomes[lookups.outcome[row]];
      const asker = lookups.neighbour[row] ? "asked by another edge" : lookups.remote[row] ? "asked by the car" : "asked in its own car";
      const meaning = { hit: "a stored answer is replayed", coalesced: "an equal frame is under way: it waits for that one's answer",
        miss: lookups.neighbour[row] ? "it has nothing to offer" : "the frame goes to the detector and on" }[outcome];
      steps.push({ t, tone: outcome, text: `${genie} looks into its message cache: ${outcome}`,
        small: `${asker}; ${meaning}; ${lookups.entries[row]} entries` });
    } else {
      const sighting = run.kinds[lookups.kind[row]] === "sighting", boost = lookups.boost_e4[row] / 10000;
      steps.push({ t, text: sighting ? `${genie} takes the objects of an answer into its map` : `${genie} adds what its map knows`,
        small: `${lookups.requests[row]} looked up, ${lookups.hits[row]} found with enough confidence` +
          (lookups.updates[row] ? `; ${lookups.updates[row]} confidences changed, ${boost >= 0 ? "+" : ""}${boost.toFixed(3)} in all` : "") +
          `; ${lookups.entries[row]} objects stored` });
    }
  }
  if (first >= 0) {
    steps.push({ t: first, tone: "hit", text: `First answer: ${count(rows.objects_served[id])} from ${SOURCES[names[rows.source[id]]]}`,
      small: [rows.served_by[id] >= 0 ? `served by ${names[rows.served_by[id]]}` : null, received >= 0 ? `${inMs(first - received)} after it was received` : null].filter(Boolean).join(", ") });
  }
  if (fresh >= 0 && fresh !== first) {
    steps.push({ t: fresh, tone: "hit", text: `Fresh answer: ${count(rows.objects_detected[id])} of this very frame`,
      small: received >= 0 ? `${inMs(fresh - received)} after it was received` : null });
  }
  if (first < 0) steps.push({ t: LAST, tone: "miss", text: rows.drop[id] >= 0 ? `Never answered: dropped at ${names[rows.drop[id]]}` : "Never answered" });
  else if (fresh < 0) {
    steps.push({ t: LAST, tone: "none", text: "No detection of this very frame ever came", small: rows.drop[id] >= 0 ? `dropped at ${names[rows.drop[id]]}` : null });
  }
  if (rows.bytes_up[id] > 0 || rows.bytes_down[id] > 0) {
    steps.push({ t: 2 * LAST, tone: "none", text: `On the car's link: ${bytes(rows.bytes_up[id])} up, ${bytes(rows.bytes_down[id])} down` });
  }
  return steps;
}
const count = (objects) => `${objects} object${objects === 1 ? "" : "s"}`;

// The same frame under every method, on one axis of milliseconds since the picture was taken.
function comparison(run, id) {
  const methods = Object.keys(run.methods), width = Math.max(300, Math.min(byId("story").clientWidth || 640, 830));
  const narrow = width < 560, row = narrow ? 44 : 30, left = 92;
  const ends = methods.map((name) => Math.max(run.methods[name].first_answer_us[id], run.methods[name].fresh_answer_us[id], 1000));
  const span = 1.05 * Math.max(...ends), across = (us) => left + us / span * (width - left - 40);
  const svg = draw("svg", { width, height: row * methods.length + 29, role: "img",
    "aria-label": methods.map((name) => `${METHOD_NAMES[name]}: ${inWords(run, run.methods[name], id)}`).join("; ") });
  methods.forEach((name, index) => {
    const rows = run.methods[name], y = index * row + 20, received = rows.received_us[id];
    const first = rows.first_answer_us[id], fresh = rows.fresh_answer_us[id], last = Math.max(first, fresh);
    svg.append(draw("text", { x: 0, y: y + 4 }, METHOD_NAMES[name]));
    if (narrow || last < 0) svg.append(draw("text", { class: "quiet", x: narrow ? 0 : left, y: narrow ? y + 20 : y + 4 }, inWords(run, rows, id)));
    if (last < 0) return;
    svg.append(draw("path", { class: `c-${name}`, d: `M${across(Math.max(received, 0))} ${y}H${across(last)}`, stroke: `var(--${name})`, "stroke-width": 3 }),
      draw("circle", { cx: across(first), cy: y, r: 5.5, fill: `var(--${name})` }));
    if (fresh >= 0) svg.append(draw("circle", { cx: across(fresh), cy: y, r: 5.5, fill: fresh === first ? `var(--${name})` : "var(--bg)", stroke: `var(--${name})`, "stroke-width": 2.5 }));
    if (!narrow) svg.append(draw("text", { class: "quiet", x: Math.min(across(last) + 10, width - 2), y: y - 7, "text-anchor": across(last) > width - 150 ? "end" : "start" }, inWords(run, rows, id)));
  });
  const y = row * methods.length + 19;
  for (const tick of linearTicks(0, span / 1000, 5)) svg.append(draw("text", { class: "quiet", x: across(tick * 1000), y, "text-anchor": "middle" }, `${digits(tick)} ms`));
  return make("div", { class: "scroll" }, svg);
}
function inWords(run, rows, id) {
  const first = rows.first_answer_us[id], fresh = rows.fresh_answer_us[id], drop = rows.drop[id];
  if (first < 0) return drop >= 0 ? `no answer: dropped at ${run.names[drop]}` : "no answer";
  if (fresh < 0) return `first ${inMs(first)}, no fresh one`;
  return fresh === first ? `fresh ${inMs(fresh)}` : `first ${inMs(first)}, fresh ${inMs(fresh)}`;
}
