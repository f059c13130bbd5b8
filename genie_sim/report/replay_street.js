// The street from above at one instant of simulated time, under one method.

import { cleared, drawHeld, drawLabel, drawLine, drawOutcome, drawRing } from "./replay_canvas.js";
import { carAt, edgeAt, heldObjectsAt, heldText, isDriven, isFalse, lastUpTo, latestFrame, outcomeOf } from "./replay_model.js";

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
  const { east_m: east, north_m: north } = run.frames;
  let ee = 0,
    en = 0,
    nn = 0;
  for (let i = 0; i < east.length; i += 1) {
    ee += (east[i] - e0) ** 2;
    nn += (north[i] - n0) ** 2;
    en += (east[i] - e0) * (north[i] - n0);
  }
  const axis = 0.5 * Math.atan2(2 * en, ee - nn);
  const { first_id: first, stamp_us } = run.streams[0],
    last = first + stamp_us.length - 1;
  const along = (east[last] - east[first]) * Math.cos(axis) + (north[last] - north[first]) * Math.sin(axis);
  return along < 0 ? axis + Math.PI : axis;
}

// Turns the street so that it uses the canvas well: where a place [m] is on it, how long a metre is, and the turn.
export function viewOf(run, width, height) {
  const { east_m: east, north_m: north } = run.frames,
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
  const held = run.methods.flatMap(({ held_objects: { east_m, north_m } }) =>
    east_m.map((value, row) => rotate(value, north_m[row])),
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

// `choose` takes the id of the frame that is chosen in it.
export class Street {
  constructor(run, canvas, tip, choose) {
    Object.assign(this, { run, canvas, tip, choose, size: "", held: [], places: {}, now: 0 });
    canvas.addEventListener("pointermove", (event) => this.showTip(event));
    canvas.addEventListener("pointerleave", () => {
      tip.hidden = true;
    });
    canvas.addEventListener("click", (event) => this.chooseCar(event));
  }

  // `state`: now [us]; method; selected, the id of the chosen frame; speed, simulated time in a watcher's second [s];
  // and whether it has a trail of outcomes, the views of cameras, and heldObjects.
  paint({ now, method, selected, speed, trail, views, heldObjects }) {
    this.tip.hidden = true; // of what stood here before
    const { run } = this,
      { pen, look, width, height } = cleared(this.canvas);
    if (this.size !== `${width} ${height}`) this.view = viewOf(run, width, height);
    Object.assign(this, { pen, look, now, method, held: [], size: `${width} ${height}` });
    pen.font = "12px system-ui, sans-serif";
    pen.lineCap = pen.lineJoin = "round";
    const cars = run.cars.map((car) => ({ car, at: carAt(run, method, car, now) }));
    this.places = Object.fromEntries(cars.map(({ car, at }) => [car.name, this.view.place(at.east_m, at.north_m)]));
    run.edges.forEach((edge, i) => {
      this.places[edge] = [((i + 0.5) * width) / run.edges.length, 22];
    });

    for (const { streams } of run.cars) this.drawRoad(streams[0]);
    if (trail) run.cars.forEach((car, lane) => this.drawTrail(car, lane));
    if (heldObjects) this.drawHeldObjects(width, height);
    if (views) for (const { car, at } of cars) if (car.cameras && at.isThere) this.drawView(car, at);
    this.drawLookups(Math.max(HOLD_US * speed, 45000), width);
    this.drawChosen(selected);
    this.drawMessages(LEAST_US * speed);
    const names = []; // that are written
    for (const { car, at } of cars) this.drawCar(car, at, names);
    for (const edge of run.edges) this.drawEdge(edge, width);
    this.drawScale(width, height);
  }

  // Where a frame was taken.
  placeOf(id) {
    const { east_m, north_m } = this.run.frames;
    return this.view.place(east_m[id], north_m[id]);
  }

  drawRoad({ first_id, stamp_us, lap_ids }) {
    const { pen } = this;
    pen.strokeStyle = this.look.road;
    pen.lineWidth = Math.max(4 * this.view.scale, 8);
    pen.beginPath();
    for (let id = first_id; id < first_id + stamp_us.length; id += 1) {
      if (id === first_id || lap_ids.has(id)) pen.moveTo(...this.placeOf(id));
      else pen.lineTo(...this.placeOf(id));
    }
    pen.stroke();
  }

  // Each car paints a lane of its own: one dot a frame, where it was taken, in the colour of its outcome.
  drawTrail(car, lane) {
    const { run, method, now } = this;
    const aside = (lane - (run.cars.length - 1) / 2) * Math.min(7, 42 / run.cars.length);
    for (const { first_id, stamp_us } of car.streams) {
      if (!isDriven(run, method, first_id)) return;
      const until = lastUpTo(stamp_us, now);
      for (let place = Math.max(0, lastUpTo(stamp_us, now - TRAIL_US)); place <= until; place += 1) {
        const id = first_id + place,
          heading = run.frames.heading_rad[id] + this.view.turn,
          [x, y] = this.placeOf(id),
          outcome = outcomeOf(method, id);
        drawOutcome(this.pen, this.look, outcome, x - Math.sin(heading) * aside, y - Math.cos(heading) * aside, 2.2);
      }
    }
  }

  // False objects come last: they lie on top.
  drawHeldObjects(width, height) {
    for (const object of heldObjectsAt(this.method, this.now).sort((a, b) => isFalse(a) - isFalse(b))) {
      const [x, y] = this.view.place(object.east_m, object.north_m);
      if (x < 0 || x > width || y < EDGE_BAND - 10 || y > height) continue;
      const text = `${object.label}: ${heldText(object)}\nsince ${(object.begin_us / 1e6).toFixed(2)} s`;
      this.held.push({ x, y, text });
      drawHeld(this.pen, this.look, object, x, y);
    }
  }

  // A car's field of view.
  drawView({ name, streams }, { heading_rad }) {
    const { pen, view } = this,
      [x, y] = this.places[name],
      heading = heading_rad + view.turn,
      half = streams[0].horizontal_fov_rad / 2,
      reach = 22 * view.scale;
    const shade = pen.createRadialGradient(x, y, 0, x, y, reach);
    shade.addColorStop(0, `color-mix(in srgb, ${this.look.car} 22%, transparent)`);
    shade.addColorStop(1, "transparent");
    pen.fillStyle = shade;
    pen.beginPath();
    pen.moveTo(x, y);
    pen.arc(x, y, reach, -heading - half, -heading + half);
    pen.fill();
  }

  drawCar(car, at, names) {
    const { pen, look, view } = this,
      [x, y] = this.places[car.name];
    const length = Math.max(4.4 * view.scale, 20),
      breadth = length * 0.42;
    pen.save();
    pen.globalAlpha = at.isThere ? 1 : 0.35;
    pen.translate(x, y);
    pen.rotate(-(at.heading_rad + view.turn));
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
    drawLabel(pen, look, car.name, name.x, name.y, at.isThere ? look.ink : look.muted);
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

  // The links of cars to their edges, and what was looked up less than `hold_us` ago.
  drawLookups(hold_us, width) {
    const { run, pen, look, places, now } = this,
      { lookups, images, image_t_us } = this.method;
    for (const car of run.cars) {
      const edge = places[edgeAt(car, now)];
      if (edge) drawLine(pen, places[car.name], edge, look.line, 1);
    }
    for (let i = lastUpTo(image_t_us, now - hold_us) + 1; i < images.length && image_t_us[i] <= now; i += 1) {
      const row = images[i],
        outcome = lookups.outcome[row],
        left = 1 - (now - image_t_us[i]) / hold_us,
        place = places[lookups.genie[row].split("/")[0]],
        camera = run.frames.stream[lookups.frame_id[row]],
        car = run.cars.find(({ name }) => name === camera.car);
      if (!place || !car) continue;
      if (lookups.neighbour[row]) {
        const edge = places[edgeAt(car, image_t_us[i])];
        if (edge && outcome === "hit") drawLine(pen, edge, place, look[outcome], 2, left);
      } else if (lookups.edge[row]) {
        drawLine(pen, places[car.name], place, look[outcome], 2.5, left);
        Object.assign(pen, { globalAlpha: left, fillStyle: look[outcome] });
        const half = Math.min(58, width / run.edges.length / 2 - 1);
        pen.fillRect(place[0] - half, place[1] - 19, 2 * half, 38);
        pen.globalAlpha = 1;
      } else drawRing(pen, look, outcome, ...place, 32 - 20 * left, left);
    }
  }

  drawChosen(id) {
    const { pen } = this;
    Object.assign(pen, { strokeStyle: this.look.ink, lineWidth: 1.5 });
    pen.beginPath();
    pen.arc(...this.placeOf(id), 9, 0, 2 * Math.PI);
    pen.stroke();
  }

  // A dot on its way along each link, for `least_us` at least: large to an edge, with a picture; small with an answer.
  drawMessages(least_us) {
    const { pen, look, places, now } = this,
      { edges } = this.run,
      { all, begin_us, longest_us } = this.method.messages;
    Object.assign(pen, { fillStyle: look.ink, strokeStyle: look.bg, lineWidth: 1.5 });
    const before = lastUpTo(begin_us, now - Math.max(longest_us, least_us));
    for (let i = before + 1; i < all.length && begin_us[i] <= now; i += 1) {
      const { from, to, end_us } = all[i],
        share = (now - begin_us[i]) / Math.max(end_us - begin_us[i], least_us);
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
    const { pen, look } = this,
      { scale, turn } = this.view,
      metres = BARS_M.find((length) => length * scale >= 70) || 10000;
    drawLine(pen, [14, height - 14], [14 + metres * scale, height - 14], look.muted, 1.5);
    Object.assign(pen, { fillStyle: look.muted, textAlign: "left" });
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
    const [nearest] = this.held.filter((mark) => away(mark) <= 12).sort((a, b) => away(a) - away(b));
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
    const id = latestFrame(this.run, nearest, this.now);
    if (id >= 0) this.choose(id);
  }
}
