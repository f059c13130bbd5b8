// One frame's story: what became of it, and step by step what happened, under one method. Milliseconds count from the
// camera's stamp, as in the metrics.

import { bytesText, countText, make, makeSvg, msText } from "./replay_elements.js";
import { isDriven, outcomeOf, outcomeText, rowOf } from "./replay_model.js";

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
export function shortStory(run, method, id) {
  const words = isDriven(run, method, id) ? `; ${inWords(method.frames, id)}` : "";
  return `${frameName(run, id)}, ${method.title}: ${outcomeText(run, method, id)}${words}.`;
}
function frameName({ frames: { stream, number } }, id) {
  return `${stream[id].car}, ${stream[id].stream}, frame ${number[id]}`;
}
function inWords(frames, id) {
  const first = frames.first_answer_us[id],
    fresh = frames.fresh_answer_us[id],
    drop = frames.drop[id];
  if (first < 0) return drop ? `no answer: dropped at ${drop}` : "no answer";
  if (fresh < 0) return `first ${msText(first)}, no fresh one`;
  return fresh === first ? `fresh ${msText(fresh)}` : `first ${msText(first)}, fresh ${msText(fresh)}`;
}

export function storyOf(run, method, id) {
  const outcome = make("span", { class: `outcome o-${outcomeOf(method, id)}` }, outcomeText(run, method, id));
  const title = make("h3", {}, `${frameName(run, id)}, under ${method.title}: `, outcome);
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
function stepsTo(run, { frames, steps }, id) {
  const all = steps.of_frame.get(id) ?? [],
    fresh = all.filter((row) => ["fresh", "both"].includes(steps.which[row])),
    rows = fresh.length ? fresh : all.filter((row) => steps.which[row] === "first");
  if (!rows.length) return [];
  let from_ns = Math.max(frames.received_ns[id], 0);
  const told = [{ part: "hop", place: run.frames.stream[id].car, from_ns: 0, took_ns: from_ns }];
  for (const row of rows) {
    told.push({ part: steps.part[row], place: steps.place[row], from_ns, took_ns: steps.took_ns[row] });
    from_ns += steps.took_ns[row];
  }
  return told;
}

// A table of the steps, with their sum; nothing where none was recorded.
function partsOfFrame(run, method, id) {
  const steps = stepsTo(run, method, id),
    cell = (text) => make("td", {}, text);
  const number = (ns) => cell(`${(ns / 1e6).toFixed(6)} ms`);
  if (!steps.length) return [];
  const tableRow = (title, ...cells) => make("tr", {}, make("th", { scope: "row" }, ...title), ...cells);
  const rows = steps.map(({ part, place, from_ns, took_ns }) =>
    tableRow([partSquare(part), ` ${run.parts[part]}`], cell(place), number(from_ns), number(took_ns)),
  );
  const whole = tableRow(["all"], cell(""), cell(""), number(steps.reduce((sum, { took_ns }) => sum + took_ns, 0)));
  const headings = ["step", "at", "since the stamp", "took"].map((text) => make("th", { scope: "col" }, text));
  const table = make("table", {}, make("thead", {}, make("tr", {}, ...headings)), make("tbody", {}, ...rows, whole));
  const about = { class: "scroll", tabindex: 0, role: "region", "aria-label": "Steps of the frame" };
  return [make("div", about, table)];
}
function partSquare(part) {
  const square = makeSvg("rect", { class: `part-${part}`, x: 1, y: 1, width: 12, height: 10 });
  return makeSvg("svg", { width: 14, height: 12, "aria-hidden": "true" }, square);
}

// An event: when [us], what, in which tone, and what else.
function eventLine({ t, tone, text, small }) {
  const more = small ? make("span", { class: "small" }, small) : null;
  const told = make("span", { class: tone ? `o-${tone}` : null }, text, more);
  return make("li", {}, make("span", {}, t >= LAST ? "" : msText(t)), told);
}

function eventsOf(run, method, id) {
  const { stream, east_m, north_m } = run.frames,
    { car, stream: camera } = stream[id],
    sees = run.cars.find(({ name }) => name === car).cameras;
  const text = sees ? `${car} takes the picture with ${camera}` : `${car}, without cameras, asks with its position`;
  const place = `${east_m[id].toFixed(1)} m east, ${north_m[id].toFixed(1)} m north`;
  const events = [{ t: 0, text, small: place }, ...lookupsOf(run, method, id), ...answersOf(method, id)];
  return events.sort((a, b) => a.t - b.t);
}

function answersOf({ frames: rows }, id) {
  const first = rows.first_answer_us[id],
    fresh = rows.fresh_answer_us[id],
    result = rows.result_answer_us[id];
  const events = [],
    after = (us) => `${msText(us)} after the picture`;
  const dropped = rows.drop[id] && `dropped at ${rows.drop[id]}`;
  const add = (t, tone, text, small) => events.push({ t, tone, text, small });
  if (rows.received_ns[id] >= 0) add(rows.received_ns[id] / 1000, null, "The queue of the first node receives it");
  if (first >= 0) {
    const by = rows.served_by[id] ? `served by ${rows.served_by[id]}, ` : "";
    const objects = countText(rows.objects_served[id]);
    const title = fresh === first ? "First answer and fresh result" : "First answer";
    add(first, "hit", `${title}: ${objects} from ${SOURCES[rows.source[id]]}`, `${by}${after(first)}`);
  }
  if (result >= 0 && result !== first && result !== fresh) {
    add(result, "hit", `Result of another frame: ${countText(rows.objects_result[id])}`, after(result));
  }
  if (fresh >= 0 && fresh !== first) {
    add(fresh, "hit", `Fresh result: ${countText(rows.objects_fresh[id])} of this very frame`, after(fresh));
  }
  if (first < 0) add(LAST, "miss", dropped ? `Never answered: ${dropped}` : "Never answered");
  else if (fresh < 0) add(LAST, "none", "No fresh result ever came", dropped);
  const up = rows.bytes_up[id],
    down = rows.bytes_down[id];
  if (up > 0 || down > 0) add(2 * LAST, "none", `On the car's link: ${bytesText(up)} up, ${bytesText(down)} down`);
  return events;
}

function lookupsOf(run, { lookups }, id) {
  return (lookups.of_frame.get(id) ?? []).map((row) => {
    const lookup = rowOf(lookups, row),
      words = lookup.kind === "image" ? imageLookup(lookup) : objectLookups(lookup);
    return { t: lookup.t_us - run.frames.stamp_us[id], ...words };
  });
}
function imageLookup({ genie, outcome, edge, neighbour, entries }) {
  const asked = neighbour ? "by another edge" : edge ? "by the car" : "in its own car";
  const meaning = {
    hit: "a stored answer is replayed",
    coalesced: "an equal frame is pending: it waits for that one's answer",
    miss: neighbour ? "it has nothing to offer" : "the frame goes to the detector and on",
  }[outcome];
  const text = `${genie} looks into its message cache: ${outcome}`;
  return { tone: outcome, text, small: `asked ${asked}; ${meaning}; ${entries} entries` };
}
function objectLookups({ genie, kind, requests, hits, updates, boost_sum, entries }) {
  const did = kind === "sighting" ? "takes the objects of an answer into its map" : "adds what its map knows";
  const looked = `${requests} looked up, ${hits} found with enough confidence`;
  const changed = `; ${updates} confidences changed, ${boost_sum >= 0 ? "+" : ""}${boost_sum.toFixed(3)} in all`;
  return { text: `${genie} ${did}`, small: `${looked}${updates ? changed : ""}; ${entries} objects stored` };
}
