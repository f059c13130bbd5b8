// The street from above at one instant of simulated time, and every frame of every camera as a strip below it.
// Instants are microseconds since the start of the run, places metres east and north.

const HOLD_US = 260000; // how long, of a watcher's time, a look-up flashes
const TRAIL_US = 12e6;  // how much of the past stays painted on the road
const CELL_PX = 6;      // a frame in the strip is at least about that broad
const EDGE_BAND = 58;   // pixels above the street for the edges, which have no place on the map

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function undelta(deltas, scale = 1) {
  let sum = 0;
  return deltas.map((delta) => (sum += delta) * scale);
}

// The columns of the page's data as arrays by the frame's id, with look-ups and changes of the maps found by it.
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
  const lookups = { ...replay.lookups, t: undelta(replay.lookups.t_us) };
  const of_frame = new Map();
  lookups.frame_id.forEach((id, row) => { if (of_frame.has(id)) of_frame.get(id).push(row); else of_frame.set(id, [row]); });
  const images = lookups.kind.flatMap((kind, row) => kind === 0 ? [row] : []);
  const objects = new Map();
  for (const [genie, label, east, north, t, confidence] of replay.objects) {
    const key = `${label} ${east} ${north}`;
    if (!objects.has(key)) objects.set(key, { label: replay.names[label], east: east / 100, north: north / 100, maps: [] });
    objects.get(key).maps.push({ genie, t: undelta(t, 1000), confidence });
  }
  const method = replay.methods.genie ? "genie" : Object.keys(replay.methods)[0];
  return { ...replay, frames, streams, cars, lookups, of_frame, images, image_t: images.map((row) => lookups.t[row]),
    objects: [...objects.values()], method, rows: replay.methods[method] };
}

// hit, miss or coalesced for a Genie; answered or not otherwise.
function outcomeOf(run, id, rows = run.rows) {
  if (rows.outcome[id] >= 0) return run.outcomes[rows.outcome[id]];
  return rows.first_answer_us[id] >= 0 ? "hit" : "none";
}
function outcomeText(run, id) {
  const outcome = outcomeOf(run, id), found = run.rows.outcome[id] >= 0;
  if (outcome === "none") return "no answer";
  return found ? outcome : "answered";
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

// The newest frame that a car has taken by `t`, or the newest that is `answered` by then; -1 for none.
function latestFrame(run, car, t, answered = false) {
  const first = run.rows.first_answer_us, late = (stream, i) => first[stream.first + i] < 0 || stream.stamp[i] + first[stream.first + i] > t;
  let best = -1;
  for (const stream of car.streams) {
    let i = lastUpTo(stream.stamp, t);
    while (answered && i >= 0 && late(stream, i)) i -= 1;
    if (i >= 0 && (best < 0 || stream.stamp[i] > run.frames.stamp[best])) best = stream.first + i;
  }
  return best;
}

// Below 0 where no map holds the object, or none holds it any more.
function confidenceAt(object, t, genie) {
  let best = -1;
  for (const map of object.maps) {
    if (genie >= 0 && map.genie !== genie) continue;
    const i = lastUpTo(map.t, t);
    if (i >= 0) best = Math.max(best, map.confidence[i] / 1000);
  }
  return best;
}

function prepareCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { pen, width, height };
}

// Turns the street so that it uses the canvas well: along its longer side, the way the cars drive.
function viewOf(run, width, height) {
  const { east, north } = run.frames, mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const e0 = mean(east), n0 = mean(north);
  let ee = 0, en = 0, nn = 0;
  for (let i = 0; i < east.length; i += 1) {
    ee += (east[i] - e0) ** 2; nn += (north[i] - n0) ** 2; en += (east[i] - e0) * (north[i] - n0);
  }
  let axis = 0.5 * Math.atan2(2 * en, ee - nn);
  const stream = run.streams[0], last = stream.first + stream.count - 1;
  const drive = (east[last] - east[stream.first]) * Math.cos(axis) + (north[last] - north[stream.first]) * Math.sin(axis);
  if (drive < 0) axis += Math.PI;
  const turn = width >= height - EDGE_BAND ? -axis : Math.PI / 2 - axis;
  const cos = Math.cos(turn), sin = Math.sin(turn);
  const rotate = (e, n) => [(e - e0) * cos - (n - n0) * sin, (e - e0) * sin + (n - n0) * cos];
  let x0 = Infinity, x1 = -Infinity, y0 = Infinity, y1 = -Infinity;
  for (let i = 0; i < east.length; i += 1) {
    const [x, y] = rotate(east[i], north[i]);
    x0 = Math.min(x0, x); x1 = Math.max(x1, x); y0 = Math.min(y0, y); y1 = Math.max(y1, y);
  }
  const free = height - EDGE_BAND, wide = width >= free, along = 9, beside = 15; // metres around the drive
  const scale = Math.min(width / (x1 - x0 + 2 * (wide ? along : beside)), free / (y1 - y0 + 2 * (wide ? beside : along)));
  const cx = (x0 + x1) / 2, cy = (y0 + y1) / 2;
  const place = (e, n) => {
    const [x, y] = rotate(e, n);
    return [width / 2 + (x - cx) * scale, EDGE_BAND + free / 2 - (y - cy) * scale];
  };
  return { place, scale, turn };
}

function streetView(run, canvas, tip, options) {
  let view = null, size = "", shown = [], places = {};
  const edges = run.about.edges;

  function paint(t) {
    const { pen, width, height } = prepareCanvas(canvas);
    if (size !== `${width} ${height}`) { size = `${width} ${height}`; view = viewOf(run, width, height); }
    const look = Object.fromEntries(["ink", "muted", "line", "bg", "road", "hit", "miss", "coalesced", "none", "sure", "unsure", "genie", "soft"]
      .map((name) => [name, colour(name)]));
    pen.font = "12px system-ui, sans-serif";
    pen.lineCap = pen.lineJoin = "round";
    road(pen, look);
    if (options.trail()) trail(pen, look, t);
    objects(pen, look, t);
    places = {};
    edges.forEach((edge, i) => { places[edge.name] = [(i + 0.5) * width / edges.length, 22]; });
    const cars = run.cars.map((car) => ({ car, at: carAt(run, car, t) }));
    for (const { car, at } of cars) places[car.name] = view.place(at.east, at.north);
    if (options.views()) for (const { car, at } of cars) if (car.cameras) wedge(pen, look, at);
    flashes(pen, look, t);
    for (const { car, at } of cars) vehicle(pen, look, car, at);
    edges.forEach((edge) => server(pen, look, edge, width));
    scaleBar(pen, look, width, height);
  }

  function road(pen, look) {
    pen.strokeStyle = look.road;
    pen.lineWidth = Math.max(4 * view.scale, 8);
    for (const { streams: [stream] } of run.cars) {
      pen.beginPath();
      for (let i = 0; i < stream.count; i += 1) {
        const id = stream.first + i, [x, y] = view.place(run.frames.east[id], run.frames.north[id]);
        const jump = i > 0 && stream.stamp[i] - stream.stamp[i - 1] > 500000;
        if (i === 0 || jump) pen.moveTo(x, y); else pen.lineTo(x, y);
      }
      pen.stroke();
    }
  }

  // Each car paints a lane of its own: one dot a frame, where it was taken, in the colour of its outcome.
  function trail(pen, look, t) {
    run.cars.forEach((car, lane) => {
      const aside = (lane - (run.cars.length - 1) / 2) * Math.min(7, 42 / run.cars.length);
      for (const stream of car.streams) {
        const until = lastUpTo(stream.stamp, t);
        for (let i = Math.max(0, lastUpTo(stream.stamp, t - TRAIL_US)); i <= until; i += 1) {
          const id = stream.first + i, heading = run.frames.heading[id] + view.turn;
          const [x, y] = view.place(run.frames.east[id], run.frames.north[id]);
          mark(pen, look, outcomeOf(run, id), x - Math.sin(heading) * aside, y - Math.cos(heading) * aside, 2.2);
        }
      }
    });
  }

  function objects(pen, look, t) {
    shown = [];
    const chosen = options.genie(), threshold = typeof run.about.threshold === "number" ? run.about.threshold : null;
    for (const object of run.objects) {
      const confidence = confidenceAt(object, t, chosen);
      if (confidence < 0) continue;
      const [x, y] = view.place(object.east, object.north);
      if (x < 0 || y < EDGE_BAND - 10 || x > canvas.clientWidth || y > canvas.clientHeight) continue;
      shown.push({ x, y, object, confidence });
    }
    shown.sort((one, other) => one.confidence - other.confidence);
    for (const { x, y, object, confidence } of shown) {
      shape(pen, object.label, x, y);
      const tone = `color-mix(in oklab, ${look.sure} ${Math.round(100 * Math.max(0, (confidence - 0.3) / 0.7))}%, ${look.unsure})`;
      if (threshold !== null && confidence < threshold) { pen.strokeStyle = tone; pen.lineWidth = 1.4; pen.stroke(); }
      else { pen.fillStyle = tone; pen.fill(); }
    }
  }

  function wedge(pen, look, at) {
    if (!at.there) return;
    const [x, y] = view.place(at.east, at.north), heading = at.heading + view.turn, reach = 22 * view.scale;
    const shade = pen.createRadialGradient(x, y, 0, x, y, reach);
    shade.addColorStop(0, `color-mix(in srgb, ${look.genie} 22%, transparent)`);
    shade.addColorStop(1, "transparent");
    pen.fillStyle = shade;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.arc(x, y, reach, -heading - at.fov / 2, -heading + at.fov / 2);
    pen.fill();
  }

  function vehicle(pen, look, car, at) {
    const [x, y] = places[car.name], length = Math.max(4.4 * view.scale, 20), breadth = length * 0.42;
    pen.save();
    pen.globalAlpha = at.there ? 1 : 0.35;
    pen.translate(x, y);
    pen.rotate(-(at.heading + view.turn));
    pen.fillStyle = look.genie;
    pen.strokeStyle = look.bg;
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.roundRect(-length / 2, -breadth / 2, length, breadth, breadth / 3);
    pen.fill(); pen.stroke();
    pen.fillStyle = look.bg;
    pen.beginPath();
    pen.moveTo(length * 0.34, 0); pen.lineTo(length * 0.12, -breadth * 0.3); pen.lineTo(length * 0.12, breadth * 0.3);
    pen.fill();
    pen.restore();
    label(pen, look, car.name, x, y - breadth - 9, at.there ? look.ink : look.muted);
  }

  function server(pen, look, edge, width) {
    const [x, y] = places[edge.name], half = Math.min(52, width / edges.length / 2 - 6);
    pen.fillStyle = look.bg;
    pen.strokeStyle = look.muted;
    pen.lineWidth = 1.2;
    pen.beginPath();
    pen.roundRect(x - half, y - 13, 2 * half, 26, 4);
    pen.fill(); pen.stroke();
    pen.save(); pen.clip();
    pen.fillStyle = look.ink;
    pen.textAlign = "center";
    pen.fillText(edge.name, x, y + 4);
    pen.restore();
  }

  function flashes(pen, look, t) {
    const hold = Math.max(HOLD_US * options.speed(), 45000), { lookups } = run;
    for (const car of run.cars) if (places[car.edge]) line(pen, places[car.name], places[car.edge], look.line, 1, 1);
    for (let i = lastUpTo(run.image_t, t - hold) + 1; i < run.images.length && run.image_t[i] <= t; i += 1) {
      const row = run.images[i], age = (t - lookups.t[row]) / hold, outcome = run.outcomes[lookups.outcome[row]];
      const where = run.names[lookups.genie[row]].split("/")[0], id = lookups.frame_id[row];
      const car = run.cars.find((one) => one.name === run.streams[run.frames.stream[id]].car);
      if (!places[where] || !car) continue;
      const tone = look[outcome];
      if (lookups.neighbour[row]) {
        if (car.edge && outcome === "hit") line(pen, places[car.edge], places[where], tone, 2, 1 - age);
        continue;
      }
      if (lookups.remote[row]) {
        line(pen, places[car.name], places[where], tone, 2.5, 1 - age);
        pen.globalAlpha = 1 - age;
        pen.fillStyle = tone;
        const half = Math.min(58, canvas.clientWidth / edges.length / 2 - 1);
        pen.fillRect(places[where][0] - half, places[where][1] - 19, 2 * half, 38);
        pen.globalAlpha = 1;
      } else ring(pen, look, outcome, ...places[where], 12 + 20 * age, 1 - age);
    }
    if (options.selected() >= 0) {
      const id = options.selected(), [x, y] = view.place(run.frames.east[id], run.frames.north[id]);
      pen.strokeStyle = look.ink;
      pen.lineWidth = 1.5;
      pen.beginPath(); pen.arc(x, y, 9, 0, 2 * Math.PI); pen.stroke();
    }
  }

  function scaleBar(pen, look, width, height) {
    const metres = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 5000].find((one) => one * view.scale >= 70) || 10000;
    pen.strokeStyle = pen.fillStyle = look.muted;
    pen.lineWidth = 1.5;
    pen.beginPath();
    pen.moveTo(14, height - 14); pen.lineTo(14 + metres * view.scale, height - 14);
    pen.stroke();
    pen.textAlign = "left";
    pen.fillText(`${metres} m`, 16, height - 19);
    pen.save();
    pen.translate(width - 26, height - 28);
    pen.rotate(-view.turn);
    pen.beginPath();
    pen.moveTo(0, 12); pen.lineTo(0, -10); pen.moveTo(-4, -4); pen.lineTo(0, -11); pen.lineTo(4, -4);
    pen.stroke();
    pen.restore();
    pen.textAlign = "center";
    pen.fillText("N", width - 26 - 19 * Math.sin(view.turn), height - 24 - 19 * Math.cos(view.turn));
  }

  function hover(event) {
    const box = canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    let best = null, nearest = 12;
    for (const one of shown) {
      const distance = Math.hypot(one.x - x, one.y - y);
      if (distance <= nearest) { best = one; nearest = distance; }
    }
    tip.hidden = best === null;
    if (best === null) return;
    const holds = (map) => confidenceAt({ maps: [map] }, options.now(), -1) >= 0;
    const maps = best.object.maps.filter(holds).map((map) => run.names[map.genie]);
    tip.textContent = `${best.object.label}, C = ${best.confidence.toFixed(2)}\nknown to ${maps.join(", ")}`;
    tip.style.left = `${Math.min(best.x + 12, box.width - tip.offsetWidth)}px`;
    tip.style.top = `${best.y + 12}px`;
  }
  canvas.addEventListener("pointermove", hover);
  canvas.addEventListener("pointerleave", () => { tip.hidden = true; });
  canvas.addEventListener("click", (event) => {
    const box = canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    const distance = (car) => Math.hypot(places[car.name][0] - x, places[car.name][1] - y);
    const [nearest] = [...run.cars].sort((one, other) => distance(one) - distance(other));
    const id = nearest ? latestFrame(run, nearest, options.now()) : -1;
    if (id >= 0) options.choose(id);
  });
  return paint;
}

function line(pen, from, to, tone, breadth, alpha) {
  pen.globalAlpha = alpha;
  pen.strokeStyle = tone;
  pen.lineWidth = breadth;
  pen.beginPath();
  pen.moveTo(...from); pen.lineTo(...to);
  pen.stroke();
  pen.globalAlpha = 1;
}
function label(pen, look, text, x, y, tone) {
  pen.textAlign = "center";
  pen.lineWidth = 3;
  pen.strokeStyle = look.bg;
  pen.strokeText(text, x, y);
  pen.fillStyle = tone;
  pen.fillText(text, x, y);
}
// Outcomes differ in shape too: a hit is a disc, a miss a ring, a coalesced request a square.
function mark(pen, look, outcome, x, y, size) {
  pen.fillStyle = pen.strokeStyle = look[outcome];
  pen.lineWidth = 1.1;
  pen.beginPath();
  if (outcome === "coalesced") pen.rect(x - size, y - size, 2 * size, 2 * size);
  else pen.arc(x, y, size, 0, 2 * Math.PI);
  if (outcome === "hit" || outcome === "coalesced") pen.fill(); else pen.stroke();
}
function ring(pen, look, outcome, x, y, radius, alpha) {
  pen.globalAlpha = alpha * (outcome === "hit" ? 0.55 : 1);
  pen.fillStyle = pen.strokeStyle = look[outcome];
  pen.lineWidth = 3;
  pen.setLineDash(outcome === "coalesced" ? [4, 6] : []);
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  if (outcome === "hit") pen.fill(); else pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}
// People and cyclists are discs, cars and trucks squares, all else diamonds.
function shape(pen, name, x, y) {
  pen.beginPath();
  if (name === "person" || name === "bicycle" || name === "motorcycle") pen.arc(x, y, 3.4, 0, 2 * Math.PI);
  else if (name === "car" || name === "truck" || name === "bus" || name === "train") pen.rect(x - 3.6, y - 3.6, 7.2, 7.2);
  else { pen.moveTo(x, y - 4.6); pen.lineTo(x + 4.6, y); pen.lineTo(x, y + 4.6); pen.lineTo(x - 4.6, y); pen.closePath(); }
}

// One row a camera, one cell a frame; the stretch of time around now.
function stripView(run, canvas, options) {
  const row = 15;
  let left = 0, begin = 0, end = 1, visible = run.streams;

  function paint(t) {
    const chosen = options.selected();
    visible = run.streams;
    if (visible.length > 24) {
      const car = chosen >= 0 ? run.streams[run.frames.stream[chosen]].car : run.cars[0].name;
      visible = run.streams.filter((one) => one.car === car);
    }
    canvas.style.height = `${visible.length * row + 22}px`;
    const { pen, width, height } = prepareCanvas(canvas);
    const stream = visible[0], interval = (stream.stamp[stream.count - 1] - stream.stamp[0]) / Math.max(stream.count - 1, 1) || 1e5;
    const span = Math.min(Math.max(run.end_us - run.begin_us, 1), width / CELL_PX * interval);
    begin = Math.min(Math.max(t - span / 2, run.begin_us), run.end_us - span);
    end = begin + span;
    pen.font = "11.5px system-ui, sans-serif";
    left = width < 520 ? 74 : 112;
    const look = Object.fromEntries(["ink", "muted", "line", "hit", "miss", "coalesced", "none", "bg"].map((name) => [name, colour(name)]));
    visible.forEach((stream, index) => {
      const y = index * row;
      pen.fillStyle = look.muted;
      pen.textAlign = "left";
      pen.fillText(width < 520 ? `${stream.car} ${stream.name.replace(/^camera_/, "")}` : `${stream.car} ${stream.name}`, 0, y + 11, left - 4);
      const first = Math.max(0, lastUpTo(stream.stamp, begin)), last = lastUpTo(stream.stamp, end);
      for (let i = first; i <= last; i += 1) {
        const id = stream.first + i, x = across(stream.stamp[i], width), next = i + 1 < stream.count ? across(stream.stamp[i + 1], width) : x + 8;
        if (x < left - 1) continue;
        const breadth = Math.max(1, Math.min(next - x, 1.5 * (width - left) * interval / span, 12) - (next - x > 4 ? 1.5 : 0)), outcome = outcomeOf(run, id);
        const fresh = run.rows.fresh_answer_us[id] >= 0;
        pen.fillStyle = pen.strokeStyle = look[outcome];
        if (fresh) pen.fillRect(x, y + 1, breadth, row - 3);
        else { pen.lineWidth = 1.1; pen.strokeRect(x + 0.6, y + 1.6, Math.max(breadth - 1.2, 0.5), row - 4.2); }
        if (id === chosen) { pen.strokeStyle = look.ink; pen.lineWidth = 2; pen.strokeRect(x - 1, y, breadth + 2, row - 1); }
      }
    });
    pen.strokeStyle = look.ink;
    pen.lineWidth = 1.2;
    const now = across(t, width);
    pen.beginPath(); pen.moveTo(now, 0); pen.lineTo(now, height - 18); pen.stroke();
    pen.fillStyle = look.muted;
    pen.textAlign = "center";
    for (const tick of linearTicks(begin / 1e6, end / 1e6, width / 110)) pen.fillText(`${digits(tick, 6)} s`, across(tick * 1e6, width), height - 4);
  }
  const across = (t, width) => left + (t - begin) / (end - begin) * (width - left - 10);

  canvas.addEventListener("click", (event) => {
    const box = canvas.getBoundingClientRect();
    const stream = visible[Math.floor((event.clientY - box.top) / row)];
    const t = begin + (event.clientX - box.left - left) / (box.width - left - 10) * (end - begin);
    if (stream && event.clientX - box.left >= left) options.choose(stream.first + Math.max(0, lastUpTo(stream.stamp, t)));
  });
  canvas.addEventListener("keydown", (event) => {
    const id = Math.max(options.selected(), 0), place = run.frames.stream[id], stream = run.streams[place];
    const beside = (other) => other.first + Math.max(0, lastUpTo(other.stamp, run.frames.stamp[id]));
    const target = {
      ArrowLeft: Math.max(id - 1, stream.first), ArrowRight: Math.min(id + 1, stream.first + stream.count - 1),
      ArrowUp: place > 0 ? beside(run.streams[place - 1]) : id,
      ArrowDown: place + 1 < run.streams.length ? beside(run.streams[place + 1]) : id,
      Home: stream.first, End: stream.first + stream.count - 1,
    }[event.key];
    if (event.key === "Enter") byId("frame").scrollIntoView();
    if (target === undefined) return;
    event.preventDefault();
    options.choose(target);
  });
  return paint;
}
