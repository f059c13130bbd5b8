// The street from above at one instant of simulated time, under one method.

const HOLD_US = 260000; // how long, of a watcher's time, a look-up flashes
const LEAST_US = 150000; // how long, of a watcher's time, a message is under way at least
const TRAIL_US = 12e6;  // how much of the past stays painted on the road
const OUTERMOST = 0.01; // of what is held, on each side: it may lie outside
const NAME_PX = 14;     // height of a car's name: of cars close to each other one stands above the other
const EDGE_BAND = 58;   // pixels above the street for the edges, which have no place on the map

// From where to where the drive reaches along one axis, and all but the outermost of what is held or missed.
function bounds(points, held, axis, margin) {
  let low = Infinity, high = -Infinity;
  for (const point of points) { low = Math.min(low, point[axis]); high = Math.max(high, point[axis]); }
  const places = held.map((point) => point[axis]).sort((a, b) => a - b), at = (share) => places[Math.round(share * (places.length - 1))];
  return places.length ? [Math.min(low - margin, at(OUTERMOST) - 2), Math.max(high + margin, at(1 - OUTERMOST) + 2)] : [low - margin, high + margin];
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
  const free = height - EDGE_BAND, wide = width >= free, [marginX, marginY] = wide ? [9, 4] : [4, 9]; // metres around the drive
  const points = east.map((value, i) => rotate(value, north[i]));
  const held = run.methods.flatMap(({ beliefs }) => beliefs.begin.map((_, row) => rotate(beliefs.east_cm[row] / 100, beliefs.north_cm[row] / 100)));
  const [x0, x1] = bounds(points, held, 0, marginX), [y0, y1] = bounds(points, held, 1, marginY);
  const scale = Math.min(width / (x1 - x0), free / (y1 - y0)), cx = (x0 + x1) / 2, cy = (y0 + y1) / 2;
  const place = (e, n) => {
    const [x, y] = rotate(e, n);
    return [width / 2 + (x - cx) * scale, EDGE_BAND + free / 2 - (y - cy) * scale];
  };
  return { place, scale, turn };
}

function streetView(run, canvas, tip, options) {
  let view = null, size = "", shown = [], places = {};
  const { edges } = run;

  function paint(t) {
    const { pen, width, height } = prepareCanvas(canvas);
    if (size !== `${width} ${height}`) { size = `${width} ${height}`; view = viewOf(run, width, height); }
    const look = looks();
    pen.font = "12px system-ui, sans-serif";
    pen.lineCap = pen.lineJoin = "round";
    road(pen, look);
    if (options.trail()) trail(pen, look, t);
    shown = [];
    if (options.held()) beliefs(pen, look, t);
    places = {};
    edges.forEach((edge, i) => { places[edge] = [(i + 0.5) * width / edges.length, 22]; });
    const cars = run.cars.map((car) => ({ car, at: carAt(run, car, t) }));
    for (const { car, at } of cars) places[car.name] = view.place(at.east, at.north);
    if (options.views()) for (const { car, at } of cars) if (car.cameras) wedge(pen, look, at);
    flashes(pen, look, t);
    messages(pen, look, t);
    const taken = []; // places of names that are written
    for (const { car, at } of cars) vehicle(pen, look, car, at, taken);
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
          mark(pen, look, outcomeOf(run, options.method(), id), x - Math.sin(heading) * aside, y - Math.cos(heading) * aside, 2.2);
        }
      }
    });
  }

  const inside = (x, y) => x >= 0 && y >= EDGE_BAND - 10 && x <= canvas.clientWidth && y <= canvas.clientHeight;

  // Ghosts come last: they lie on top.
  function beliefs(pen, look, t) {
    for (const one of [...believed(run, options.method(), t)].sort((a, b) => isGhost(a) - isGhost(b))) {
      const [x, y] = view.place(one.east, one.north);
      if (!inside(x, y)) continue;
      const means = isGhost(one) ? `a false object that ${one.car} holds:\n${GHOSTS[one.judged]}` : one.judged === "missed" ? `visible, but not held by ${one.car}` : `held by ${one.car}, and there`;
      shown.push({ x, y, text: () => `${one.label}: ${means}\nsince ${(one.since / 1e6).toFixed(2)} s` });
      beliefMark(pen, look, one, x, y);
    }
  }

  function wedge(pen, look, at) {
    if (!at.there) return;
    const [x, y] = view.place(at.east, at.north), heading = at.heading + view.turn, reach = 22 * view.scale;
    const shade = pen.createRadialGradient(x, y, 0, x, y, reach);
    shade.addColorStop(0, `color-mix(in srgb, ${look.car} 22%, transparent)`);
    shade.addColorStop(1, "transparent");
    pen.fillStyle = shade;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.arc(x, y, reach, -heading - at.fov / 2, -heading + at.fov / 2);
    pen.fill();
  }

  function vehicle(pen, look, car, at, taken) {
    const [x, y] = places[car.name], length = Math.max(4.4 * view.scale, 20), breadth = length * 0.42;
    pen.save();
    pen.globalAlpha = at.there ? 1 : 0.35;
    pen.translate(x, y);
    pen.rotate(-(at.heading + view.turn));
    pen.fillStyle = look.car;
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
    const name = { x, y: y - breadth - 9, half: pen.measureText(car.name).width / 2 + 2 };
    while (taken.some((other) => Math.abs(other.x - name.x) < other.half + name.half && Math.abs(other.y - name.y) < NAME_PX)) name.y -= NAME_PX;
    taken.push(name);
    label(pen, look, car.name, name.x, name.y, at.there ? look.ink : look.muted);
  }

  function server(pen, look, edge, width) {
    const [x, y] = places[edge], half = Math.min(52, width / edges.length / 2 - 6);
    pen.fillStyle = look.bg;
    pen.strokeStyle = look.muted;
    pen.lineWidth = 1.2;
    pen.beginPath();
    pen.roundRect(x - half, y - 13, 2 * half, 26, 4);
    pen.fill(); pen.stroke();
    pen.save(); pen.clip();
    pen.fillStyle = look.ink;
    pen.textAlign = "center";
    pen.fillText(edge, x, y + 4);
    pen.restore();
  }

  function flashes(pen, look, t) {
    const hold = Math.max(HOLD_US * options.speed(), 45000), { lookups, images, image_t } = options.method();
    for (const car of run.cars) if (places[car.edge]) line(pen, places[car.name], places[car.edge], look.line, 1, 1);
    for (let i = lastUpTo(image_t, t - hold) + 1; i < images.length && image_t[i] <= t; i += 1) {
      const row = images[i], age = (t - lookups.t[row]) / hold, outcome = run.outcomes[lookups.outcome[row]];
      const where = run.names[lookups.genie[row]].split("/")[0], id = lookups.frame_id[row];
      const car = run.cars.find((one) => one.name === run.streams[run.frames.stream[id]].car);
      if (!places[where] || !car) continue;
      const tone = look[outcome];
      if (lookups.neighbour[row]) {
        if (car.edge && outcome === "hit") line(pen, places[car.edge], places[where], tone, 2, 1 - age);
        continue;
      }
      if (lookups.edge[row]) {
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

  // A dot on its way along each link: large to an edge, with a picture; small with an answer.
  function messages(pen, look, t) {
    const { all, begin, longest } = options.method().messages, least = LEAST_US * options.speed();
    for (let i = lastUpTo(begin, t - Math.max(longest, least)) + 1; i < all.length && begin[i] <= t; i += 1) {
      const message = all[i], share = (t - message.begin) / Math.max(message.end - message.begin, least);
      if (share > 1 || !places[message.from]) continue;
      const goals = places[message.to] ? [message.to] : edges.filter((name) => name !== message.from);
      for (const goal of goals) {
        const [[x, y], [toX, toY]] = [places[message.from], places[goal]], isUp = edges.includes(goal);
        pen.fillStyle = look.ink;
        pen.strokeStyle = look.bg;
        pen.lineWidth = 1.5;
        pen.beginPath();
        pen.arc(x + share * (toX - x), y + share * (toY - y), isUp ? 5 : 3.5, 0, 2 * Math.PI);
        pen.fill(); pen.stroke();
      }
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
    tip.textContent = best.text();
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
