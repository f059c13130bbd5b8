// What a replay knows: frames, look-ups and object maps of every method, found by frame or by instant.
// Instants are microseconds since the start of the run, places metres east and north.

const inMs = (us) => `${us < 0 ? "\u2212" : ""}${(Math.abs(us) / 1000).toFixed(1)} ms`;
const countOf = (objects) => `${objects} object${objects === 1 ? "" : "s"}`;

function undelta(deltas, scale = 1) {
  let sum = 0;
  return deltas.map((delta) => (sum += delta) * scale);
}

// The columns of the page's data as arrays by the frame's id.
function decode(replay, about) {
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
  const cars = about.cars.map((car) => ({ ...car, streams: streams.filter((one) => one.car === car.name) }))
    .filter((car) => car.streams.length);
  const run = { ...replay, about, frames, streams, cars };
  run.methods = replay.methods.map((one) => methodOf(run, one));
  run.judges = run.methods.some(({ beliefs }) => beliefs.begin.length); // whether the truth is known
  const judgedAt = run.methods.flatMap(({ judged }) => judged.flatMap((counts) => counts?.t.at(-1) ?? []));
  run.compared_until_us = run.judges && judgedAt.length ? Math.min(Math.max(...judgedAt), run.end_us) : run.end_us;
  for (const method of run.methods) method.samples = samplesOf(run, method);
  return run;
}

// What happened under one method. `rows` are the columns of its frames; `held` what each car holds from which instant on.
function methodOf(run, { name, frames: rows, lookups: { t_us, ...columns }, objects, held, held_objects, steps, hosts }) {
  const lookups = { ...columns, t: undelta(t_us) }, of_frame = byFrame(lookups.frame_id), places = new Map();
  const images = lookups.kind.flatMap((kind, row) => run.kinds[kind] === "image" ? [row] : []);
  for (const [genie, label, east, north, t, confidence] of objects) {
    const key = `${label} ${east} ${north}`;
    if (!places.has(key)) places.set(key, { label: run.names[label], east: east / 100, north: north / 100, maps: [] });
    places.get(key).maps.push({ genie, t: undelta(t, 1000), confidence });
  }
  return { name, title: methodTitle(name), rows, lookups, of_frame, steps: { ...steps, of_frame: byFrame(steps.frame_id) }, images, image_t: images.map((row) => lookups.t[row]),
    objects: [...places.values()], caches: rows.outcome.some((one) => one >= 0), held: run.cars.map((car) => answersOf(run, car, rows)),
    messages: messagesOf(run, rows, steps), hosts: new Map(Object.entries(hosts).map(([host, samples]) =>
      [host, { ...samples, t: undelta(samples.t_us), lost: undelta(samples.lost) }])),
    beliefs: { ...held_objects, begin: undelta(held_objects.begin_us) },
    judged: run.cars.map(({ name: car }) => held[car] && { ...held[car], t: undelta(held[car].t_us) }) };
}

// The messages on the way of the answers, in order of time: from where to where each went over a link, and when.
function messagesOf(run, rows, steps) {
  const messages = new Map();
  let t = 0;
  steps.frame_id.forEach((id, row) => {
    const goesOn = row > 0 && steps.frame_id[row - 1] === id && steps.which[row - 1] === steps.which[row];
    const begin = goesOn ? t : run.frames.stamp[id] + Math.max(rows.received_us[id], 0), place = run.names[steps.place[row]];
    t = begin + steps.took_ns[row] / 1000;
    const [from, to] = place.split("->");
    // One message may be on the way of both answers to a frame.
    if (to !== undefined && DATA.parts[steps.part[row]].name !== "queueing") messages.set(`${place} ${id} ${Math.round(begin)}`, { from, to, begin, end: t });
  });
  const inOrder = [...messages.values()].sort((a, b) => a.begin - b.begin);
  return { all: inOrder, begin: inOrder.map((message) => message.begin), longest: Math.max(0, ...inOrder.map(({ begin, end }) => end - begin)) };
}

function byFrame(ids) {
  const found = new Map();
  ids.forEach((id, row) => { if (found.has(id)) found.get(id).push(row); else found.set(id, [row]); });
  return found;
}

// The answers to a car, in order of time, that were about a newer frame than any before.
function answersOf(run, car, rows) {
  const { stamp } = run.frames, answered = [];
  for (const { first, count } of car.streams) {
    for (let id = first; id < first + count; id += 1) if (rows.first_answer_us[id] >= 0) answered.push([stamp[id] + rows.first_answer_us[id], id]);
  }
  answered.sort((one, other) => one[0] - other[0]);
  const t = [], ids = [];
  for (const [at, id] of answered) {
    if (ids.length && stamp[id] < stamp[ids.at(-1)]) continue;
    t.push(at);
    ids.push(id);
  }
  return { t, ids };
}

// What a car holds at `t`: the newest frame with an answer, its age since the picture, and what the answer says.
function holding(run, method, place, t) {
  const { t: instants, ids } = method.held[place], i = lastUpTo(instants, t), { rows } = method;
  if (i < 0) return null;
  const id = ids[i], since = t - run.frames.stamp[id], came = (us) => us >= 0 && us <= since;
  const fresh = came(rows.fresh_answer_us[id]), result = came(rows.result_answer_us[id]);
  return { id, age: since, fresh, objects: (fresh ? rows.objects_fresh : result ? rows.objects_result : rows.objects_served)[id],
    source: run.names[rows.source[id]] };
}

// What consumers hold or miss at `t`, judged by what is there: the rows of `beliefs` that are open then.
function believed(run, method, t) {
  if (method.open?.t === t) return method.open.objects;
  const { beliefs } = method, open = [];
  for (let row = 0, last = lastUpTo(beliefs.begin, t); row <= last; row += 1) {
    if (beliefs.took_us[row] >= 0 && t >= beliefs.begin[row] + beliefs.took_us[row]) continue;
    open.push({ car: run.names[beliefs.car[row]], label: run.names[beliefs.label[row]], judged: run.judged[beliefs.judged[row]],
      since: beliefs.begin[row], east: beliefs.east_cm[row] / 100, north: beliefs.north_cm[row] / 100 });
  }
  method.open = { t, objects: open };
  return open;
}
const GHOSTS = { moved_away: "it was there in the last 10 s", never_there: "it was not there in the last 10 s", duplicate: "what is there is held once more" };
const isGhost = (one) => one.judged in GHOSTS;

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

// Of an object in the maps of a method; below 0 where no map holds it, or none holds it any more. Of one Genie's map, or of any (-1).
function confidenceAt(object, t, genie) {
  let best = -1;
  for (const map of object.maps) {
    if (genie >= 0 && map.genie !== genie) continue;
    const i = lastUpTo(map.t, t);
    if (i >= 0) best = Math.max(best, map.confidence[i] / 1000);
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
