// What a replay knows: frames, look-ups and held objects of every method, found by frame or by instant. All names are
// those of `replay.py`; instants are microseconds since the start of the run.

import { countText } from "./replay_elements.js";

const SCALES = { _cm: ["_m", 0.01], _mrad: ["_rad", 0.001], _e4: ["", 0.0001] };

// The columns as they were before `replay.py` packed them: texts for places in `names` (@), sums for differences (+),
// metres and radians. What is not packed stays.
function restored(table, names) {
  const columns = {};
  for (const [key, packed] of Object.entries(table)) {
    const [, name, unit, sign] = /^(.+?)(_cm|_mrad|_e4)?([@+]?)$/.exec(key),
      [suffix, scale] = SCALES[unit] ?? ["", 1];
    let sum = 0;
    let values = packed;
    if (sign === "@") values = packed.map((place) => names[place]);
    if (sign === "+") values = packed.map((difference) => (sum += difference));
    columns[name + suffix] = unit ? values.map((value) => value * scale) : values;
  }
  return columns;
}

// What all functions take: the page's data, as `replay.py` tells of them, restored; and derived from them
//
// `run`:
//   frames    the columns of all streams by a frame's id, and of each frame its stream and its number in it
//   streams   lap_ids are a Set
//   cars      those with frames, and of each its streams
// each `method` of run.methods:
//   lookups, steps    with of_frame, a Map of a frame's id to its rows
//   images    the rows of lookups that are of message caches; image_t_us: their instants
//   messages  all (from, to, begin_us, end_us, in order of begin_us), begin_us (of each), longest_us (that one took)
//   caches    whether any frame was looked up in a message cache
export function decode(replay) {
  const streams = replay.streams
    .map((stream) => restored(stream, replay.names))
    .map((stream) => ({ ...stream, lap_ids: new Set(stream.lap_ids) }));
  const ofAll = (name) => streams.flatMap((stream) => stream[name]);
  const frames = {
    stamp_us: ofAll("stamp_us"),
    east_m: ofAll("east_m"),
    north_m: ofAll("north_m"),
    heading_rad: ofAll("heading_rad"),
    stream: streams.flatMap((stream) => stream.stamp_us.map(() => stream)),
    number: streams.flatMap(({ first_frame, stamp_us }) => stamp_us.map((_, place) => first_frame + place)),
  };
  const cars = replay.cars
    .map((car) => ({ ...car, streams: streams.filter((stream) => stream.car === car.name) }))
    .filter((car) => car.streams.length);
  const methods = replay.methods.map((method) => methodOf(replay.names, frames, method));
  return { ...replay, streams, frames, cars, methods };
}

function methodOf(names, run_frames, method) {
  const [frames, lookups, held_objects, steps] = ["frames", "lookups", "held_objects", "steps"].map((name) =>
    restored(method[name], names),
  );
  const images = lookups.kind.flatMap((kind, row) => (kind === "image" ? [row] : []));
  return {
    ...method,
    frames,
    held_objects,
    lookups: { ...lookups, of_frame: byFrame(lookups.frame_id) },
    steps: { ...steps, of_frame: byFrame(steps.frame_id) },
    images,
    image_t_us: images.map((row) => lookups.t_us[row]),
    caches: frames.outcome.some(Boolean),
    messages: messagesOf(run_frames, frames, steps),
  };
}

// The messages on the way of the answers, in order of time: from where to where each went over a link, and when.
function messagesOf({ stamp_us }, { received_ns }, { frame_id, which, part, place, took_ns }) {
  const messages = new Map();
  let t = 0;
  frame_id.forEach((id, row) => {
    const goesOn = row > 0 && frame_id[row - 1] === id && which[row - 1] === which[row];
    const begin_us = goesOn ? t : stamp_us[id] + Math.max(received_ns[id], 0) / 1000;
    t = begin_us + took_ns[row] / 1000;
    const [from, to] = place[row].split("->");
    if (to === undefined || part[row] === "queueing") return;
    // One message may be on the way of both answers to a frame.
    messages.set(`${place[row]} ${id} ${Math.round(begin_us)}`, { from, to, begin_us, end_us: t });
  });
  const all = [...messages.values()].sort((a, b) => a.begin_us - b.begin_us);
  const longest_us = all.reduce((longest, { begin_us, end_us }) => Math.max(longest, end_us - begin_us), 0);
  return { all, begin_us: all.map(({ begin_us }) => begin_us), longest_us };
}

function byFrame(ids) {
  const rows = new Map();
  ids.forEach((id, row) => {
    if (rows.has(id)) rows.get(id).push(row);
    else rows.set(id, [row]);
  });
  return rows;
}

// One row of a table.
export function rowOf(columns, row) {
  return Object.fromEntries(Object.entries(columns).map(([name, column]) => [name, column[row]]));
}

// The edge to which a car is linked at `t`: a hand-over changes it.
export function edgeAt(car, t) {
  return car.edges.findLast(([from_us]) => from_us <= t)[1];
}

// The index of the last value that is not above `x`, or -1.
export function lastUpTo(values, x) {
  let low = 0,
    high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

// What consumers hold or miss at `t`, judged by what is there: the rows that are open then. What several cameras of a
// car see has a row for each, and counts once.
export function heldObjectsAt({ held_objects }, t) {
  const { begin_us, took_us } = held_objects,
    open = new Map();
  for (let row = 0, last = lastUpTo(begin_us, t); row <= last; row += 1) {
    if (took_us[row] >= 0 && t >= begin_us[row] + took_us[row]) continue;
    const object = rowOf(held_objects, row),
      key = [object.car, object.label, object.judged, object.east_m, object.north_m].join();
    if (!open.has(key)) open.set(key, object);
  }
  return [...open.values()];
}

const WHY_FALSE = {
  moved_away: "it was there in the last 10 s",
  never_there: "it was not there in the last 10 s",
  duplicate: "what is there is held once more",
};
export const isFalse = ({ judged }) => judged in WHY_FALSE;

export function heldText({ car, judged }) {
  if (judged in WHY_FALSE) return `a false object that ${car} holds:\n${WHY_FALSE[judged]}`;
  return judged === "missed" ? `visible, but not held by ${car}` : `held by ${car}, and there`;
}

// What all cars together hold at `t`, in words.
export function countsText(method, t) {
  const at = `${(t / 1e6).toFixed(2)} s under ${method.title}`;
  if (!method.held_objects.car.length) return `${at}.`;
  const objects = heldObjectsAt(method, t),
    wrong = objects.filter(isFalse).length;
  const count = (judged) => objects.filter((object) => object.judged === judged).length,
    right = count("right");
  return (
    `${at}: the cars hold ${countText(right)} that ${right === 1 ? "is" : "are"} there ` +
    `and ${wrong} false one${wrong === 1 ? "" : "s"}, and miss ${count("missed")} in view.`
  );
}

// Whether the frame's car drives under this method.
export const isDriven = (run, method, id) => method.cars.includes(run.frames.stream[id].car);

// hit, miss or coalesced at the car's Genie; where there is none, whether it was answered.
export function outcomeOf({ frames: { outcome, first_answer_us } }, id) {
  return outcome[id] ?? (first_answer_us[id] >= 0 ? "hit" : "none");
}
export function outcomeText(run, method, id) {
  if (!isDriven(run, method, id)) return "the car does not drive under this method";
  return method.frames.outcome[id] ?? (outcomeOf(method, id) === "none" ? "no answer" : "answered");
}

// Where a car is at `t`, between two of its frames, and whether it drives then.
export function carAt(run, method, car, t) {
  const { east_m, north_m, heading_rad } = run.frames,
    { stamp_us, first_id, lap_ids } = car.streams[0],
    place = lastUpTo(stamp_us, t),
    id = first_id + Math.max(place, 0),
    next = id + 1,
    isThere = place >= 0 && isDriven(run, method, id);
  const here = { east_m: east_m[id], north_m: north_m[id], heading_rad: heading_rad[id], isThere };
  if (place < 0) return here;
  if (place + 1 >= stamp_us.length) return { ...here, isThere: isThere && t - stamp_us[place] < 1e6 };
  if (lap_ids.has(next)) return here;
  const share = (t - stamp_us[place]) / (stamp_us[place + 1] - stamp_us[place]),
    turn = heading_rad[next] - here.heading_rad;
  return {
    ...here,
    east_m: here.east_m + share * (east_m[next] - here.east_m),
    north_m: here.north_m + share * (north_m[next] - here.north_m),
    heading_rad: here.heading_rad + share * Math.atan2(Math.sin(turn), Math.cos(turn)),
  };
}

// The newest frame that a car has taken by `t`, -1 for none.
export function latestFrame(run, car, t) {
  let latest = -1;
  for (const { stamp_us, first_id } of car.streams) {
    const place = lastUpTo(stamp_us, t);
    if (place >= 0 && (latest < 0 || stamp_us[place] > run.frames.stamp_us[latest])) latest = first_id + place;
  }
  return latest;
}
