// What a replay knows: frames, look-ups and held objects of every method, found by frame or by instant. The page's
// data are those that `replay.py` tells of, field by field; instants are microseconds since the start of the run,
// places metres east and north.
// Uses replay_elements.js.

const inMs = (us) => `${us < 0 ? "\u2212" : ""}${(Math.abs(us) / 1000).toFixed(1)} ms`;
const countOf = (objects) => `${objects} object${objects === 1 ? "" : "s"}`;

function undelta(deltas, scale = 1) {
  let sum = 0;
  return deltas.map((delta) => (sum += delta) * scale);
}

// What all functions take, as `decode` makes it of the page's data; what is not named here is as `replay.py` tells it.
//
// `run`:
//   frames    by id: stamp [us], east, north [m], heading [rad], stream (its place in streams), number (in its stream)
//   streams   car, name, first (id), count, stamp (of each frame), laps (Set of the ids that begin one), fov [rad]
//   cars      those with frames: name, edge, cameras, and streams, its own ones
//   parts     Map of each part's name to its title
//   names     texts; a code in a column is a place here
//   methods   of each a `method`
// `method`:
//   name, title, cars
//   rows      the columns of its frames, by id
//   lookups   columns, with t [us] and of_frame (Map of a frame's id to its rows)
//   images    the rows of lookups that are of message caches, image_t their instants
//   steps     columns, with of_frame
//   messages  all (from, to, begin, end [us], in order of begin), begin (of each), longest (the longest that one took)
//   caches    whether any frame was looked up in a message cache
//   heldObjects   columns, with begin [us]
function decode(replay) {
  const frames = { stamp: [], east: [], north: [], heading: [], stream: [], number: [] };
  const streams = replay.streams.map((of, index) => {
    const stamp = undelta(of.stamp_us);
    frames.stamp.push(...stamp);
    frames.east.push(...undelta(of.east_cm, 0.01));
    frames.north.push(...undelta(of.north_cm, 0.01));
    frames.heading.push(...undelta(of.heading_mrad, 0.001));
    stamp.forEach((_, i) => {
      frames.stream.push(index);
      frames.number.push(of.first_frame + i);
    });
    const laps = new Set(of.lap_ids),
      fov = of.fov_mrad / 1000;
    return { car: of.car, name: of.stream, first: of.first_id, count: stamp.length, stamp, laps, fov };
  });
  const cars = replay.cars
    .map((car) => ({ ...car, streams: streams.filter((stream) => stream.car === car.name) }))
    .filter((car) => car.streams.length);
  const run = { ...replay, parts: new Map(replay.parts), frames, streams, cars };
  run.methods = replay.methods.map((of) => methodOf(run, of));
  return run;
}

// What happened under one method. `rows` are the columns of its frames.
function methodOf(run, { frames: rows, lookups: { t_us, ...columns }, held_objects, steps, ...about }) {
  const lookups = { ...columns, t: undelta(t_us), of_frame: byFrame(columns.frame_id) };
  const images = lookups.kind.flatMap((kind, row) => (run.names[kind] === "image" ? [row] : []));
  return {
    ...about,
    rows,
    lookups,
    steps: { ...steps, of_frame: byFrame(steps.frame_id) },
    images,
    image_t: images.map((row) => lookups.t[row]),
    caches: rows.outcome.some((outcome) => outcome >= 0),
    messages: messagesOf(run, rows, steps),
    heldObjects: { ...held_objects, begin: undelta(held_objects.begin_us) },
  };
}

// The messages on the way of the answers, in order of time: from where to where each went over a link, and when.
function messagesOf(run, rows, steps) {
  const messages = new Map();
  let t = 0;
  steps.frame_id.forEach((id, row) => {
    const goesOn = row > 0 && steps.frame_id[row - 1] === id && steps.which[row - 1] === steps.which[row];
    const begin = goesOn ? t : run.frames.stamp[id] + Math.max(rows.received_ns[id], 0) / 1000;
    t = begin + steps.took_ns[row] / 1000;
    const place = run.names[steps.place[row]],
      [from, to] = place.split("->");
    if (to === undefined || run.names[steps.part[row]] === "queueing") return;
    // One message may be on the way of both answers to a frame.
    messages.set(`${place} ${id} ${Math.round(begin)}`, { from, to, begin, end: t });
  });
  const all = [...messages.values()].sort((a, b) => a.begin - b.begin);
  const longest = Math.max(0, ...all.map(({ begin, end }) => end - begin));
  return { all, begin: all.map(({ begin }) => begin), longest };
}

function byFrame(ids) {
  const rows = new Map();
  ids.forEach((id, row) => {
    if (rows.has(id)) rows.get(id).push(row);
    else rows.set(id, [row]);
  });
  return rows;
}

// What consumers hold or miss at `t`, judged by what is there: the rows that are open then. What several cameras of a
// car see has a row for each, and counts once.
function heldObjectsAt(run, { heldObjects: rows }, t) {
  const open = new Map();
  for (let row = 0, last = lastUpTo(rows.begin, t); row <= last; row += 1) {
    if (rows.took_us[row] >= 0 && t >= rows.begin[row] + rows.took_us[row]) continue;
    const key = ["car", "label", "judged", "east_cm", "north_cm"].map((name) => rows[name][row]).join();
    if (open.has(key)) continue;
    open.set(key, {
      car: run.names[rows.car[row]],
      label: run.names[rows.label[row]],
      judged: run.names[rows.judged[row]],
      since: rows.begin[row],
      east: rows.east_cm[row] / 100,
      north: rows.north_cm[row] / 100,
    });
  }
  return [...open.values()];
}
const GHOSTS = {
  moved_away: "it was there in the last 10 s",
  never_there: "it was not there in the last 10 s",
  duplicate: "what is there is held once more",
};
const isGhost = ({ judged }) => judged in GHOSTS;

function heldText({ car, judged }) {
  if (judged in GHOSTS) return `a false object that ${car} holds:\n${GHOSTS[judged]}`;
  return judged === "missed" ? `visible, but not held by ${car}` : `held by ${car}, and there`;
}

// What all cars together hold at `t`, in words.
function countsText(run, method, t) {
  const at = `${(t / 1e6).toFixed(2)} s under ${method.title}`;
  if (!method.heldObjects.begin.length) return `${at}.`;
  const objects = heldObjectsAt(run, method, t),
    ghosts = objects.filter(isGhost).length;
  const count = (judged) => objects.filter((object) => object.judged === judged).length,
    right = count("right");
  return (
    `${at}: the cars hold ${countOf(right)} that ${right === 1 ? "is" : "are"} there ` +
    `and ${ghosts} false one${ghosts === 1 ? "" : "s"}, and miss ${count("missed")} in view.`
  );
}

// Whether the frame's car drives under this method.
function isDriven(run, method, id) {
  return method.cars.includes(run.streams[run.frames.stream[id]].car);
}

// hit, miss or coalesced at the car's Genie; where there is none, whether it was answered.
function outcomeOf(run, { rows }, id) {
  if (rows.outcome[id] >= 0) return run.names[rows.outcome[id]];
  return rows.first_answer_us[id] >= 0 ? "hit" : "none";
}
function outcomeText(run, method, id) {
  const outcome = outcomeOf(run, method, id);
  if (!isDriven(run, method, id)) return "the car does not drive under this method";
  return outcome === "none" ? "no answer" : method.rows.outcome[id] >= 0 ? outcome : "answered";
}

// Where a car is at `t`, between two of its frames.
function carAt(run, car, t) {
  const { stamp, first, count, laps, fov } = car.streams[0],
    i = lastUpTo(stamp, t),
    { east, north, heading } = run.frames;
  const id = first + Math.max(i, 0),
    next = id + 1;
  const here = { east: east[id], north: north[id], heading: heading[id], fov, there: i >= 0 };
  if (i < 0 || i + 1 >= count) return { ...here, there: i >= 0 && t - stamp[i] < 1e6 };
  if (laps.has(next)) return here;
  const share = (t - stamp[i]) / (stamp[i + 1] - stamp[i]);
  const turn = Math.atan2(Math.sin(heading[next] - here.heading), Math.cos(heading[next] - here.heading));
  return {
    ...here,
    east: here.east + share * (east[next] - here.east),
    north: here.north + share * (north[next] - here.north),
    heading: here.heading + share * turn,
  };
}

// The newest frame that a car has taken by `t`, -1 for none.
function latestFrame(run, car, t) {
  let best = -1;
  for (const { stamp, first } of car.streams) {
    const i = lastUpTo(stamp, t);
    if (i >= 0 && (best < 0 || stamp[i] > run.frames.stamp[best])) best = first + i;
  }
  return best;
}
