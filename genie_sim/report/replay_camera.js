// What a car's first camera looks at, drawn from where the objects are: boxes of usual sizes on a flat road, and under them
// the picture itself where the page has one.

const CAMERA_UP_M = 1.65;       // above the road, as in KITTI's car
const HORIZON = 0.46;           // of the picture's height, from above
const MAX_VIEW_RAD = 1.75;      // of wider sensors the view ahead is drawn
const NEAREST_M = 2;
const ROAD_M = [3.5, 3, 120];   // half the drawn road's breadth, and from where to where it is drawn
const pictures = new Map();     // by address

function pictureOf(run, id, onload) {
  const number = run.pictures ? run.pictures.of_frame[id] : -1;
  if (number === undefined || number < 0) return null;
  const address = run.pictures.addresses[number];
  if (!pictures.has(address)) {
    pictures.set(address, new Image());
    pictures.get(address).src = address;
  }
  const picture = pictures.get(address);
  if (!picture.complete) picture.addEventListener("load", onload, { once: true });
  return picture.complete && picture.naturalWidth ? picture : null;
}

// What a car's consumer holds is judged by what is in view of the first camera.
function firstStream(run, car) {
  const first = Array.isArray(car.cameras) ? car.cameras[0].name : run.about.cameras[0];
  return car.streams.find((stream) => stream.name === first) ?? car.streams[0];
}

function cameraView(run, canvas, options) {
  const { sizes } = DATA.replay;

  function paint(t) {
    const { pen, width, height } = prepareCanvas(canvas), look = looks(), car = options.car();
    pen.font = "11.5px system-ui, sans-serif";
    pen.lineJoin = "round";
    const stream = firstStream(run, car), place = lastUpTo(stream.stamp, t), id = stream.first + place;
    const focus = width / 2 / Math.tan(Math.min(stream.fov, MAX_VIEW_RAD) / 2), horizon = HORIZON * height;
    const picture = place < 0 ? null : pictureOf(run, id, () => paint(options.now()));
    if (picture) pen.drawImage(picture, 0, 0, width, height);
    else road(pen, look, { width, height, focus, horizon });
    const objects = place < 0 ? [] : believed(run, options.method(), t).filter((object) => object.car === car.name);
    const boxes = objects.map((object) => boxOf(run, id, object, { width, focus, horizon })).filter(Boolean);
    for (const box of boxes.sort((a, b) => isGhost(b.object) - isGhost(a.object) || b.ahead - a.ahead)) drawBox(pen, look, box);
    canvas.setAttribute("aria-label", `What ${car.name}'s camera looks at under ${options.method().title}: ${countsText(objects)}`);
    caption(pen, look, place < 0 ? `${car.name}: no picture yet` : `${car.name}, ${stream.name}: ${countsText(objects)}`);
  }

  function road(pen, look, { width, height, focus, horizon }) {
    const [half, near, far] = ROAD_M, at = (aside, ahead) => [width / 2 + focus * aside / ahead, horizon + focus * CAMERA_UP_M / ahead];
    pen.fillStyle = look.soft;
    pen.fillRect(0, 0, width, height);
    pen.fillStyle = look.road;
    pen.beginPath();
    pen.moveTo(...at(-half, near)); pen.lineTo(...at(-half, far)); pen.lineTo(...at(half, far)); pen.lineTo(...at(half, near));
    pen.fill();
    line(pen, [0, horizon], [width, horizon], look.line, 1, 1);
  }

  // The borders of an object in the picture, null for one that is not in front of the camera.
  function boxOf({ frames }, id, object, { width, focus, horizon }) {
    const east = object.east - frames.east[id], north = object.north - frames.north[id];
    const cos = Math.cos(frames.heading[id]), sin = Math.sin(frames.heading[id]), ahead = east * cos + north * sin;
    if (ahead < NEAREST_M) return null;
    const [breadth, high] = sizes[object.label] ?? [1, 1], middle = width / 2 + focus * (east * sin - north * cos) / ahead;
    const half = focus * breadth / 2 / ahead, foot = horizon + focus * CAMERA_UP_M / ahead;
    return middle + half < 0 || middle - half > width ? null
      : { object, ahead, left: middle - half, right: middle + half, foot, top: foot - focus * high / ahead };
  }

  // Held and there: solid. Missed: dashed. A ghost: crossed out.
  function drawBox(pen, look, { object, left, right, foot, top }) {
    const tone = isGhost(object) ? look.ghost : look.hit;
    for (const [stroke, breadth] of isGhost(object) ? [[tone, 1.1]] : [[look.bg, 3.6], [tone, 1.8]]) {
      pen.strokeStyle = stroke;
      pen.lineWidth = breadth;
      pen.setLineDash(object.judged === "missed" ? [5, 4] : []);
      pen.beginPath();
      pen.rect(left, top, right - left, foot - top);
      if (isGhost(object)) { pen.moveTo(left, top); pen.lineTo(right, foot); pen.moveTo(left, foot); pen.lineTo(right, top); }
      pen.stroke();
    }
    pen.setLineDash([]);
    if (right - left > 44 && !isGhost(object)) label(pen, look, object.label, (left + right) / 2, Math.max(top - 4, 24), look.ink);
  }

  function caption(pen, look, text) {
    pen.textAlign = "left";
    pen.lineWidth = 3;
    pen.strokeStyle = look.bg;
    pen.strokeText(text, 8, 15);
    pen.fillStyle = look.ink;
    pen.fillText(text, 8, 15);
  }
  return paint;
}

function countsText(objects) {
  const count = (test) => objects.filter(test).length;
  const ghosts = count(isGhost);
  return `${count((object) => object.judged === "right")} held and there, ${count((object) => object.judged === "missed")} missed, ${ghosts} false object${ghosts === 1 ? "" : "s"}`;
}
