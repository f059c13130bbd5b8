// What a replay knows: frames, look-ups and held objects of every method, found by frame or by instant.
// Instants are microseconds since the start of the run, places metres east and north.

const inMs = (us) => `${us < 0 ? "\u2212" : ""}${(Math.abs(us) / 1000).toFixed(1)} ms`;
const countOf = (objects) => `${objects} object${objects === 1 ? "" : "s"}`;

function undelta(deltas, scale = 1) {
  let sum = 0;
  return deltas.map((delta) => (sum += delta) * scale);
}

// The columns of the page's data as arrays by the frame's id.
function decode(replay) {
  const frames = { stamp: [], east: [], north: [], heading: [], stream: [], number: [] };
  const streams = replay.streams.map((one, index) => {
    const stamp = undelta(one.stamp_us);
    frames.stamp.push(...stamp);
    frames.east.push(...undelta(one.east_cm, 0.01));
    frames.north.push(...undelta(one.north_cm, 0.01));
    frames.heading.push(...undelta(one.heading_mrad, 0.001));
    stamp.forEach((_, i) => { frames.stream.push(index); frames.number.push(one.first_frame + i); });
    return { car: one.car, name: one.stream, first: one.first_id, count: stamp.length, stamp, fov: one.fov_mrad / 1000 };
  });
  const cars = replay.cars.map((car) => ({ ...car, streams: streams.filter((one) => one.car === car.name) })).filter((car) => car.streams.length);
  const run = { ...replay, frames, streams, cars };
  run.methods = replay.methods.map((one) => methodOf(run, one));
  return run;
}

// What happened under one method. `rows` are the columns of its frames.
function methodOf(run, { frames: rows, lookups: { t_us, ...columns }, held_objects, steps, ...about }) {
  const lookups = { ...columns, t: undelta(t_us) };
  const images = lookups.kind.flatMap((kind, row) => run.kinds[kind] === "image" ? [row] : []);
  return { ...about, rows, lookups, of_frame: byFrame(lookups.frame_id), steps: { ...steps, of_frame: byFrame(steps.frame_id) },
    images, image_t: images.map((row) => lookups.t[row]), caches: rows.outcome.some((one) => one >= 0), messages: messagesOf(run, rows, steps),
    beliefs: { ...held_objects, begin: undelta(held_objects.begin_us) } };
}

// The messages on the way of the answers, in order of time: from where to where each went over a link, and when.
function messagesOf(run, rows, steps) {
  const messages = new Map();
  let t = 0;
  steps.frame_id.forEach((id, row) => {
    const goesOn = row > 0 && steps.frame_id[row - 1] === id && steps.which[row - 1] === steps.which[row];
    const begin = goesOn ? t : run.frames.stamp[id] + Math.max(rows.received_ns[id], 0) / 1000, place = run.names[steps.place[row]];
    t = begin + steps.took_ns[row] / 1000;
    const [from, to] = place.split("->");
    // One message may be on the way of both answers to a frame.
    if (to !== undefined && run.parts[steps.part[row]].name !== "queueing") messages.set(`${place} ${id} ${Math.round(begin)}`, { from, to, begin, end: t });
  });
  const inOrder = [...messages.values()].sort((a, b) => a.begin - b.begin);
  return { all: inOrder, begin: inOrder.map((message) => message.begin), longest: Math.max(0, ...inOrder.map(({ begin, end }) => end - begin)) };
}

function byFrame(ids) {
  const found = new Map();
  ids.forEach((id, row) => { if (found.has(id)) found.get(id).push(row); else found.set(id, [row]); });
  return found;
}

// What consumers hold or miss at `t`, judged by what is there: the rows of `beliefs` that are open then.
function believed(run, { beliefs }, t) {
  const open = [];
  for (let row = 0, last = lastUpTo(beliefs.begin, t); row <= last; row += 1) {
    if (beliefs.took_us[row] >= 0 && t >= beliefs.begin[row] + beliefs.took_us[row]) continue;
    open.push({ car: run.names[beliefs.car[row]], label: run.names[beliefs.label[row]], judged: run.judged[beliefs.judged[row]],
      since: beliefs.begin[row], east: beliefs.east_cm[row] / 100, north: beliefs.north_cm[row] / 100 });
  }
  return open;
}
const GHOSTS = { moved_away: "it was there in the last 10 s", never_there: "it was not there in the last 10 s", duplicate: "what is there is held once more" };
const isGhost = (one) => one.judged in GHOSTS;

// What all cars together hold at `t`, in words.
function countsText(run, method, t) {
  if (!method.beliefs.begin.length) return `${(t / 1e6).toFixed(2)} s under ${method.title}.`;
  const objects = believed(run, method, t), count = (test) => objects.filter(test).length, ghosts = count(isGhost);
  return `${(t / 1e6).toFixed(2)} s under ${method.title}: the cars hold ${count((one) => one.judged === "right")} objects that are there ` +
    `and ${ghosts} false one${ghosts === 1 ? "" : "s"}, and miss ${count((one) => one.judged === "missed")} in view.`;
}

// hit, miss or coalesced at the car's Genie; where there is none, whether it was answered.
function outcomeOf(run, { rows }, id) {
  if (rows.outcome[id] >= 0) return run.outcomes[rows.outcome[id]];
  return rows.first_answer_us[id] >= 0 ? "hit" : "none";
}
function outcomeText(run, method, id) {
  const outcome = outcomeOf(run, method, id);
  return outcome === "none" ? "no answer" : method.rows.outcome[id] >= 0 ? outcome : "answered";
}

function carAt(run, car, t) {
  const stream = car.streams[0], i = lastUpTo(stream.stamp, t), { east, north, heading } = run.frames;
  const id = stream.first + Math.max(i, 0), next = id + 1;
  const here = { east: east[id], north: north[id], heading: heading[id], fov: stream.fov, there: i >= 0 };
  if (i < 0 || i + 1 >= stream.count) return { ...here, there: i >= 0 && t - stream.stamp[i] < 1e6 };
  const gap = stream.stamp[i + 1] - stream.stamp[i];
  if (gap > 500000) return here; // between two laps
  const share = (t - stream.stamp[i]) / gap;
  const turn = Math.atan2(Math.sin(heading[next] - here.heading), Math.cos(heading[next] - here.heading));
  return { ...here, east: here.east + share * (east[next] - here.east), north: here.north + share * (north[next] - here.north),
    heading: here.heading + share * turn };
}

// The newest frame that a car has taken by `t`, -1 for none.
function latestFrame(run, car, t) {
  let best = -1;
  for (const stream of car.streams) {
    const i = lastUpTo(stream.stamp, t);
    if (i >= 0 && (best < 0 || stream.stamp[i] > run.frames.stamp[best])) best = stream.first + i;
  }
  return best;
}

// A frame to begin with: a miss around that time that an edge or a detector answered later, so that there is a story.
function interesting(run, method, t) {
  const near = run.frames.stamp.map((stamp, id) => [Math.abs(stamp - t), id]).sort((one, other) => one[0] - other[0]).slice(0, 400).map(([, id]) => id);
  const told = (id) => (method.of_frame.get(id) || []).some((row) => method.lookups.edge[row]);
  return near.find((id) => outcomeOf(run, method, id) === "miss" && method.rows.fresh_answer_us[id] >= 0 && told(id))
    ?? near.find((id) => method.rows.first_answer_us[id] >= 0) ?? near[0] ?? 0;
}
