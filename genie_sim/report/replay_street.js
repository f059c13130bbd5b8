// The street from above at one instant of simulated time, under one method.
// Uses replay_elements.js, replay_model.js, replay_canvas.js.

const HOLD_US = 260000; // how long, of a watcher's time, a look-up flashes
const LEAST_US = 150000; // how long, of a watcher's time, a message is under way at least
const TRAIL_US = 12e6; // how much of the past stays painted on the road
const OUTERMOST = 0.01; // of what is held, on each side: it may lie outside
const NAME_PX = 14; // height of a car's name: of cars close to each other one stands above the other
const EDGE_BAND = 58; // pixels above the street for the edges, which have no place on the map
const BARS_M = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 5000]; // lengths of the scale's bar

// From where to where the drive reaches along one axis, and all but the outermost of what is held or missed.
function bounds(points, held, axis, margin) {
  let low = Infinity,
    high = -Infinity;
  for (const point of points) {
    low = Math.min(low, point[axis]);
    high = Math.max(high, point[axis]);
  }
  if (!held.length) return [low - margin, high + margin];
  const places = held.map((point) => point[axis]).sort((a, b) => a - b);
  const at = (share) => places[Math.round(share * (places.length - 1))];
  return [Math.min(low - margin, at(OUTERMOST) - 2), Math.max(high + margin, at(1 - OUTERMOST) + 2)];
}

// The direction [rad from east] of the longer side of the drive, the way the first car drives.
function directionOf(run, e0, n0) {
  const { east, north } = run.frames;
  let ee = 0,
    en = 0,
    nn = 0;
  for (let i = 0; i < east.length; i += 1) {
    ee += (east[i] - e0) ** 2;
    nn += (north[i] - n0) ** 2;
    en += (east[i] - e0) * (north[i] - n0);
  }
  const axis = 0.5 * Math.atan2(2 * en, ee - nn);
  const { first, count } = run.streams[0],
    last = first + count - 1;
  const along = (east[last] - east[first]) * Math.cos(axis) + (north[last] - north[first]) * Math.sin(axis);
  return along < 0 ? axis + Math.PI : axis;
}

// Turns the street so that it uses the canvas well: where a place [m] is on it, how long a metre is, and the turn.
function viewOf(run, width, height) {
  const { east, north } = run.frames,
    mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const e0 = mean(east),
    n0 = mean(north),
    free = height - EDGE_BAND,
    isWide = width >= free;
  const turn = (isWide ? 0 : Math.PI / 2) - directionOf(run, e0, n0),
    cos = Math.cos(turn),
    sin = Math.sin(turn);
  const rotate = (e, n) => [(e - e0) * cos - (n - n0) * sin, (e - e0) * sin + (n - n0) * cos];
  const [marginX, marginY] = isWide ? [9, 4] : [4, 9]; // metres around the drive
  const points = east.map((value, i) => rotate(value, north[i]));
  const held = run.methods.flatMap(({ heldObjects: { east_cm, north_cm } }) =>
    east_cm.map((cm, row) => rotate(cm / 100, north_cm[row] / 100)),
  );
  const [x0, x1] = bounds(points, held, 0, marginX),
    [y0, y1] = bounds(points, held, 1, marginY);
  const scale = Math.min(width / (x1 - x0), free / (y1 - y0)),
    cx = (x0 + x1) / 2,
    cy = (y0 + y1) / 2;
  const place = (e, n) => {
    const [x, y] = rotate(e, n);
    return [width / 2 + (x - cx) * scale, EDGE_BAND + free / 2 - (y - cy) * scale];
  };
  return { place, scale, turn };
}

// `options` says what is shown, and takes the frame that is chosen; see `Replay`.
class Street {
  constructor(run, canvas, tip, options) {
    Object.assign(this, { run, canvas, tip, options, size: "", held: [], places: {} });
    canvas.addEventListener("pointermove", (event) => this.showTip(event));
    canvas.addEventListener("pointerleave", () => {
      tip.hidden = true;
    });
    canvas.addEventListener("click", (event) => this.chooseCar(event));
  }

  paint(t) {
    this.tip.hidden = true; // of what stood here before
    const { run, options } = this,
      { pen, width, height } = prepareCanvas(this.canvas);
    if (this.size !== `${width} ${height}`) this.view = viewOf(run, width, height);
    this.size = `${width} ${height}`;
    Object.assign(this, { pen, look: looks(), method: options.method(), held: [] });
    pen.font = "12px system-ui, sans-serif";
    pen.lineCap = pen.lineJoin = "round";
    const cars = run.cars.map((car) => ({ car, at: carAt(run, car, t) }));
    this.places = Object.fromEntries(cars.map(({ car, at }) => [car.name, this.view.place(at.east, at.north)]));
    run.edges.forEach((edge, i) => {
      this.places[edge] = [((i + 0.5) * width) / run.edges.length, 22];
    });

    for (const {
      streams: [stream],
    } of run.cars)
      this.drawRoad(stream);
    if (options.trail()) run.cars.forEach((car, lane) => this.drawTrail(car, lane, t));
    if (options.heldObjects()) this.drawHeldObjects(t);
    if (options.views()) for (const { car, at } of cars) if (car.cameras && at.there) this.drawView(at);
    this.drawLookups(t);
    if (options.selected() >= 0) this.drawChosen(options.selected());
    this.drawMessages(t);
    const names = []; // that are written
    for (const { car, at } of cars) this.drawCar(car, at, names);
    for (const edge of run.edges) this.drawEdge(edge, width);
    this.drawScale(width, height);
  }

  drawRoad(stream) {
    const {
      pen,
      view,
      run: { frames },
    } = this;
    pen.strokeStyle = this.look.road;
    pen.lineWidth = Math.max(4 * view.scale, 8);
    pen.beginPath();
    for (let i = 0; i < stream.count; i += 1) {
      const id = stream.first + i,
        place = view.place(frames.east[id], frames.north[id]);
      if (i === 0 || stream.laps.has(id)) pen.moveTo(...place);
      else pen.lineTo(...place);
    }
    pen.stroke();
  }

  // Each car paints a lane of its own: one dot a frame, where it was taken, in the colour of its outcome.
  drawTrail(car, lane, t) {
    const { run, view } = this,
      { cars, frames } = run;
    const aside = (lane - (cars.length - 1) / 2) * Math.min(7, 42 / cars.length);
    for (const { first, stamp } of car.streams) {
      const until = lastUpTo(stamp, t);
      for (let i = Math.max(0, lastUpTo(stamp, t - TRAIL_US)); i <= until; i += 1) {
        const id = first + i,
          heading = frames.heading[id] + view.turn;
        const [x, y] = view.place(frames.east[id], frames.north[id]),
          outcome = outcomeOf(run, this.method, id);
        mark(this.pen, this.look, outcome, x - Math.sin(heading) * aside, y - Math.cos(heading) * aside, 2.2);
      }
    }
  }

  // Ghosts come last: they lie on top.
  drawHeldObjects(t) {
    const { clientWidth, clientHeight } = this.canvas;
    for (const object of heldObjectsAt(this.run, this.method, t).sort((a, b) => isGhost(a) - isGhost(b))) {
      const [x, y] = this.view.place(object.east, object.north);
      if (x < 0 || x > clientWidth || y < EDGE_BAND - 10 || y > clientHeight) continue;
      const text = `${object.label}: ${heldText(object)}\nsince ${(object.since / 1e6).toFixed(2)} s`;
      this.held.push({ x, y, text });
      heldMark(this.pen, this.look, object, x, y);
    }
  }

  // A car's field of view.
  drawView(at) {
    const { pen, view } = this,
      [x, y] = view.place(at.east, at.north);
    const heading = at.heading + view.turn,
      reach = 22 * view.scale;
    const shade = pen.createRadialGradient(x, y, 0, x, y, reach);
    shade.addColorStop(0, `color-mix(in srgb, ${this.look.car} 22%, transparent)`);
    shade.addColorStop(1, "transparent");
    pen.fillStyle = shade;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.arc(x, y, reach, -heading - at.fov / 2, -heading + at.fov / 2);
    pen.fill();
  }

  drawCar(car, at, names) {
    const { pen, look, view } = this,
      [x, y] = this.places[car.name];
    const length = Math.max(4.4 * view.scale, 20),
      breadth = length * 0.42;
    pen.save();
    pen.globalAlpha = at.there ? 1 : 0.35;
    pen.translate(x, y);
    pen.rotate(-(at.heading + view.turn));
    Object.assign(pen, { fillStyle: look.car, strokeStyle: look.bg, lineWidth: 1.5 });
    pen.beginPath();
    pen.roundRect(-length / 2, -breadth / 2, length, breadth, breadth / 3);
    pen.fill();
    pen.stroke();
    pen.fillStyle = look.bg;
    pen.beginPath();
    pen.moveTo(length * 0.34, 0);
    pen.lineTo(length * 0.12, -breadth * 0.3);
    pen.lineTo(length * 0.12, breadth * 0.3);
    pen.fill();
    pen.restore();
    const name = { x, y: y - breadth - 9, half: pen.measureText(car.name).width / 2 + 2 };
    const hides = (other) =>
      Math.abs(other.x - name.x) < other.half + name.half && Math.abs(other.y - name.y) < NAME_PX;
    while (names.some(hides)) name.y -= NAME_PX;
    names.push(name);
    label(pen, look, car.name, name.x, name.y, at.there ? look.ink : look.muted);
  }

  drawEdge(edge, width) {
    const { pen, look } = this,
      [x, y] = this.places[edge],
      half = Math.min(52, width / this.run.edges.length / 2 - 6);
    Object.assign(pen, { fillStyle: look.bg, strokeStyle: look.muted, lineWidth: 1.2 });
    pen.beginPath();
    pen.roundRect(x - half, y - 13, 2 * half, 26, 4);
    pen.fill();
    pen.stroke();
    pen.save();
    pen.clip();
    Object.assign(pen, { fillStyle: look.ink, textAlign: "center" });
    pen.fillText(edge, x, y + 4);
    pen.restore();
  }

  // The links of cars to their edges, and what was looked up a moment ago.
  drawLookups(t) {
    const { run, pen, look, places } = this,
      { lookups, images, image_t } = this.method;
    const hold = Math.max(HOLD_US * this.options.speed(), 45000);
    for (const car of run.cars) if (places[car.edge]) line(pen, places[car.name], places[car.edge], look.line, 1, 1);
    for (let i = lastUpTo(image_t, t - hold) + 1; i < images.length && image_t[i] <= t; i += 1) {
      const row = images[i],
        outcome = run.names[lookups.outcome[row]],
        left = 1 - (t - image_t[i]) / hold;
      const place = places[run.names[lookups.genie[row]].split("/")[0]];
      const camera = run.streams[run.frames.stream[lookups.frame_id[row]]];
      const car = run.cars.find(({ name }) => name === camera.car);
      if (!place || !car) continue;
      if (lookups.neighbour[row]) {
        if (car.edge && outcome === "hit") line(pen, places[car.edge], place, look[outcome], 2, left);
      } else if (lookups.edge[row]) {
        line(pen, places[car.name], place, look[outcome], 2.5, left);
        Object.assign(pen, { globalAlpha: left, fillStyle: look[outcome] });
        const half = Math.min(58, this.canvas.clientWidth / run.edges.length / 2 - 1);
        pen.fillRect(place[0] - half, place[1] - 19, 2 * half, 38);
        pen.globalAlpha = 1;
      } else ring(pen, look, outcome, ...place, 32 - 20 * left, left);
    }
  }

  drawChosen(id) {
    const {
      pen,
      run: { frames },
    } = this;
    Object.assign(pen, { strokeStyle: this.look.ink, lineWidth: 1.5 });
    pen.beginPath();
    pen.arc(...this.view.place(frames.east[id], frames.north[id]), 9, 0, 2 * Math.PI);
    pen.stroke();
  }

  // A dot on its way along each link: large to an edge, with a picture; small with an answer.
  drawMessages(t) {
    const {
        pen,
        look,
        places,
        run: { edges },
      } = this,
      { all, begin, longest } = this.method.messages;
    const least = LEAST_US * this.options.speed();
    Object.assign(pen, { fillStyle: look.ink, strokeStyle: look.bg, lineWidth: 1.5 });
    for (let i = lastUpTo(begin, t - Math.max(longest, least)) + 1; i < all.length && begin[i] <= t; i += 1) {
      const { from, to, end } = all[i],
        share = (t - begin[i]) / Math.max(end - begin[i], least);
      if (share > 1 || !places[from]) continue;
      for (const goal of places[to] ? [to] : edges.filter((name) => name !== from)) {
        const [x, y] = places[from],
          [toX, toY] = places[goal],
          radius = edges.includes(goal) ? 5 : 3.5;
        pen.beginPath();
        pen.arc(x + share * (toX - x), y + share * (toY - y), radius, 0, 2 * Math.PI);
        pen.fill();
        pen.stroke();
      }
    }
  }

  // A bar of so many metres, and an arrow to the north.
  drawScale(width, height) {
    const {
        pen,
        view: { scale, turn },
      } = this,
      metres = BARS_M.find((length) => length * scale >= 70) || 10000;
    pen.strokeStyle = pen.fillStyle = this.look.muted;
    line(pen, [14, height - 14], [14 + metres * scale, height - 14], this.look.muted, 1.5, 1);
    pen.textAlign = "left";
    pen.fillText(`${metres} m`, 16, height - 19);
    pen.save();
    pen.translate(width - 26, height - 28);
    pen.rotate(-turn);
    pen.stroke(new Path2D("M0 12V-10M-4 -4L0 -11L4 -4"));
    pen.restore();
    pen.textAlign = "center";
    pen.fillText("N", width - 26 - 19 * Math.sin(turn), height - 24 - 19 * Math.cos(turn));
  }

  // What the held object under the pointer is.
  showTip(event) {
    const { tip } = this,
      { left, top, width } = this.canvas.getBoundingClientRect();
    const away = ({ x, y }) => Math.hypot(x - event.clientX + left, y - event.clientY + top);
    const nearest = this.held.filter((shown) => away(shown) <= 12).sort((a, b) => away(a) - away(b))[0];
    tip.hidden = !nearest;
    if (!nearest) return;
    tip.textContent = nearest.text;
    tip.style.left = `${Math.min(nearest.x + 12, width - tip.offsetWidth)}px`;
    tip.style.top = `${nearest.y + 12}px`;
  }

  // Chooses the latest frame of the car that is nearest to a click.
  chooseCar(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    const away = ({ name }) =>
      Math.hypot(this.places[name][0] - event.clientX + left, this.places[name][1] - event.clientY + top);
    const [nearest] = [...this.run.cars].sort((a, b) => away(a) - away(b));
    const id = nearest ? latestFrame(this.run, nearest, this.options.now()) : -1;
    if (id >= 0) this.options.choose(id);
  }
}
