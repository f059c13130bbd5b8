// One frame's story: what became of it, and step by step what happened, under one method. Milliseconds count from the
// camera's stamp, as in the metrics.
// Uses replay_elements.js, replay_model.js.

const SOURCES = {
  own_cache: "the message cache of its own Genie",
  own_detector: "its own detector",
  edge_cache: "its edge's message cache",
  edge_detector: "its edge's detector",
  peer_cache: "another edge's message cache",
  map: "the object map",
  none: "nobody",
};
const LAST = 1e15; // after everything that has an instant
const EVENTS = "What happened to it, from the camera's stamp on";
const OPENED = new Set([EVENTS]); // folds, which stay open for the next frames

// The title of the story in one line, for the strip of frames.
function shortStory(run, method, id) {
  const { car, name } = run.streams[run.frames.stream[id]],
    words = isDriven(run, method, id) ? `; ${inWords(run, method.rows, id)}` : "",
    outcome = `${outcomeText(run, method, id)}${words}`;
  return `${car}, ${name}, frame ${run.frames.number[id]}, ${method.title}: ${outcome}.`;
}
function inWords(run, rows, id) {
  const first = rows.first_answer_us[id],
    fresh = rows.fresh_answer_us[id],
    drop = rows.drop[id];
  if (first < 0) return drop >= 0 ? `no answer: dropped at ${run.names[drop]}` : "no answer";
  if (fresh < 0) return `first ${inMs(first)}, no fresh one`;
  return fresh === first ? `fresh ${inMs(fresh)}` : `first ${inMs(first)}, fresh ${inMs(fresh)}`;
}

function storyOf(run, method, id) {
  const { frames } = run,
    { car, name } = run.streams[frames.stream[id]];
  const outcome = make("span", { class: `outcome o-${outcomeOf(run, method, id)}` }, outcomeText(run, method, id));
  const title = make("h3", {}, `${car}, ${name}, frame ${frames.number[id]}, under ${method.title}: `, outcome);
  if (!isDriven(run, method, id)) return [title];
  return [
    title,
    ...folded("Where its time went", partsOfFrame(run, method, id)),
    ...folded(EVENTS, [make("ol", {}, ...eventsOf(run, method, id).map(eventLine))]),
  ];
}

function folded(title, children) {
  if (!children.length) return [];
  const note = ({ currentTarget: { open } }) => {
    OPENED[open ? "add" : "delete"](title);
  };
  return [make("details", { open: OPENED.has(title), ontoggle: note }, make("summary", {}, title), ...children)];
}

// The steps of a frame to its fresh result, or to the first answer if no fresh one came, from the camera's stamp on
// [ns].
function stepsTo(run, { rows, steps }, id) {
  const all = steps.of_frame.get(id) ?? [],
    which = (row) => run.names[steps.which[row]];
  const fresh = all.filter((row) => ["fresh", "both"].includes(which(row)));
  const shown = fresh.length ? fresh : all.filter((row) => which(row) === "first");
  if (!shown.length) return [];
  let t = Math.max(rows.received_ns[id], 0);
  const toFirstNode = { part: "hop", place: run.streams[run.frames.stream[id]].car, from: 0, took: t };
  return [
    toFirstNode,
    ...shown.map((row) => {
      const [part, place] = [steps.part[row], steps.place[row]].map((code) => run.names[code]);
      const step = { part, place, from: t, took: steps.took_ns[row] };
      t += step.took;
      return step;
    }),
  ];
}

// A table of the steps, with their sum; nothing where none was recorded.
function partsOfFrame(run, method, id) {
  const steps = stepsTo(run, method, id),
    cell = (text) => make("td", {}, text);
  const number = (ns) => cell(`${(ns / 1e6).toFixed(6)} ms`);
  if (!steps.length) return [];
  const line = (title, ...cells) => make("tr", {}, make("th", { scope: "row" }, ...title), ...cells);
  const lines = steps.map(({ part, place, from, took }) =>
    line([partSquare(part), ` ${run.parts.get(part)}`], cell(place), number(from), number(took)),
  );
  const whole = line(["all"], cell(""), cell(""), number(steps.reduce((sum, { took }) => sum + took, 0)));
  const headings = ["step", "at", "since the stamp", "took"].map((text) => make("th", { scope: "col" }, text));
  const table = make("table", {}, make("thead", {}, make("tr", {}, ...headings)), make("tbody", {}, ...lines, whole));
  const about = { class: "scroll", tabindex: 0, role: "region", "aria-label": "Steps of the frame" };
  return [make("div", about, table)];
}
function partSquare(part) {
  const square = draw("rect", { class: `part-${part}`, x: 1, y: 1, width: 12, height: 10 });
  return draw("svg", { width: 14, height: 12, "aria-hidden": "true" }, square);
}

// An event: when [us], what, in which tone, and what else.
function eventLine({ t, tone, text, small }) {
  const more = small ? make("span", { class: "small" }, small) : null;
  const told = make("span", { class: tone ? `o-${tone}` : null }, text, more);
  return make("li", {}, make("span", {}, t >= LAST ? "" : inMs(t)), told);
}

function eventsOf(run, method, id) {
  const { frames } = run,
    { car, name } = run.streams[frames.stream[id]];
  const sees = run.cars.find((of) => of.name === car).cameras;
  const text = sees ? `${car} takes the picture with ${name}` : `${car}, without cameras, asks with its position`;
  const place = `${frames.east[id].toFixed(1)} m east, ${frames.north[id].toFixed(1)} m north`;
  const events = [{ t: 0, text, small: place }, ...lookupsOf(run, method, id), ...answersOf(run, method, id)];
  return events.sort((a, b) => a.t - b.t);
}

function answersOf(run, { rows }, id) {
  const first = rows.first_answer_us[id],
    fresh = rows.fresh_answer_us[id],
    result = rows.result_answer_us[id];
  const name = (column) => run.names[rows[column][id]],
    events = [],
    after = (us) => `${inMs(us)} after the picture`;
  const dropped = rows.drop[id] >= 0 ? `dropped at ${name("drop")}` : "";
  const add = (t, tone, text, small) => events.push({ t, tone, text, small });
  if (rows.received_ns[id] >= 0) add(rows.received_ns[id] / 1000, null, "The queue of the first node receives it");
  if (first >= 0) {
    const by = rows.served_by[id] >= 0 ? `served by ${name("served_by")}, ` : "";
    const objects = countOf(rows.objects_served[id]);
    const title = fresh === first ? "First answer and fresh result" : "First answer";
    add(first, "hit", `${title}: ${objects} from ${SOURCES[name("source")]}`, `${by}${after(first)}`);
  }
  if (result >= 0 && result !== first && result !== fresh) {
    add(result, "hit", `Result of another frame: ${countOf(rows.objects_result[id])}`, after(result));
  }
  if (fresh >= 0 && fresh !== first) {
    add(fresh, "hit", `Fresh result: ${countOf(rows.objects_fresh[id])} of this very frame`, after(fresh));
  }
  if (first < 0) add(LAST, "miss", dropped ? `Never answered: ${dropped}` : "Never answered");
  else if (fresh < 0) add(LAST, "none", "No fresh result ever came", dropped);
  const up = rows.bytes_up[id],
    down = rows.bytes_down[id];
  if (up > 0 || down > 0) add(2 * LAST, "none", `On the car's link: ${bytes(up)} up, ${bytes(down)} down`);
  return events;
}

function lookupsOf(run, { lookups }, id) {
  return (lookups.of_frame.get(id) || []).map((row) => {
    const t = lookups.t[row] - run.frames.stamp[id],
      kind = run.names[lookups.kind[row]];
    return kind === "image" ? imageLookup(run, lookups, row, t) : objectLookups(run, lookups, row, t);
  });
}
function imageLookup(run, lookups, row, t) {
  const outcome = run.names[lookups.outcome[row]],
    isNeighbour = lookups.neighbour[row];
  const asked = isNeighbour ? "by another edge" : lookups.edge[row] ? "by the car" : "in its own car";
  const meaning = {
    hit: "a stored answer is replayed",
    coalesced: "an equal frame is pending: it waits for that one's answer",
    miss: isNeighbour ? "it has nothing to offer" : "the frame goes to the detector and on",
  }[outcome];
  const text = `${run.names[lookups.genie[row]]} looks into its message cache: ${outcome}`;
  return { t, tone: outcome, text, small: `asked ${asked}; ${meaning}; ${lookups.entries[row]} entries` };
}
function objectLookups(run, lookups, row, t) {
  const genie = run.names[lookups.genie[row]],
    boost = lookups.boost_e4[row] / 10000,
    updates = lookups.updates[row];
  const isSighting = run.names[lookups.kind[row]] === "sighting";
  const text = isSighting
    ? `${genie} takes the objects of an answer into its map`
    : `${genie} adds what its map knows`;
  const looked = `${lookups.requests[row]} looked up, ${lookups.hits[row]} found with enough confidence`;
  const changed = `; ${updates} confidences changed, ${boost >= 0 ? "+" : ""}${boost.toFixed(3)} in all`;
  return { t, text, small: `${looked}${updates ? changed : ""}; ${lookups.entries[row]} objects stored` };
}
