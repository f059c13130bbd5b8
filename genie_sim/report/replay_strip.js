// Every frame of every camera under one method, on an axis of time.

const CELL_PX = 6;      // a frame in the strip is at least about that broad
const ROW_PX = 15;      // a camera
const MOST_STREAMS = 6; // of more, those of one car

// The stretch of time that is shown. It stays where it is as long as `t` is in it, so that what is clicked does not
// run away from the pointer.
function timeAxis(run) {
  const { stamp, count } = run.streams[0], interval = (stamp[count - 1] - stamp[0]) / Math.max(count - 1, 1) || 1e5;
  const axis = { begin: run.begin_us, span: 1, width: 0, left: 0, interval };
  axis.follow = (t, width) => {
    axis.width = width;
    axis.left = width < 520 ? 74 : 112;
    axis.span = Math.min(Math.max(run.end_us - run.begin_us, 1), width / CELL_PX * interval);
    const begin = Math.min(Math.max(axis.begin, t - 0.98 * axis.span), t - 0.02 * axis.span);
    axis.begin = Math.min(Math.max(begin, run.begin_us), run.end_us - axis.span);
  };
  axis.across = (t) => axis.left + (t - axis.begin) / axis.span * (axis.width - axis.left - 10);
  axis.back = (x) => axis.begin + (x - axis.left) / (axis.width - axis.left - 10) * axis.span;
  axis.now = (pen, look, t, height) => {
    pen.strokeStyle = look.ink;
    pen.lineWidth = 1.2;
    pen.beginPath(); pen.moveTo(axis.across(t), 0); pen.lineTo(axis.across(t), height); pen.stroke();
  };
  return axis;
}

// One row a camera, one cell a frame.
function stripView(run, canvas, axis, options) {
  let visible = run.streams;

  function paint(t) {
    const chosen = options.selected(), method = options.method();
    visible = run.streams;
    if (visible.length > MOST_STREAMS) {
      const car = chosen >= 0 ? run.streams[run.frames.stream[chosen]].car : run.cars[0].name;
      visible = run.streams.filter((one) => one.car === car);
    }
    canvas.style.height = `${visible.length * ROW_PX + 22}px`;
    const { pen, width, height } = prepareCanvas(canvas), look = looks();
    pen.font = "11.5px system-ui, sans-serif";
    visible.forEach((stream, index) => {
      pen.fillStyle = look.muted;
      pen.textAlign = "left";
      const name = width < 520 ? stream.name.replace(/^camera_/, "") : stream.name;
      pen.fillText(`${stream.car} ${name}`, 0, index * ROW_PX + 11, axis.left - 4);
      cells(pen, look, stream, index * ROW_PX, method, chosen);
    });
    axis.now(pen, look, t, height - 18);
    pen.fillStyle = look.muted;
    pen.textAlign = "center";
    for (const tick of linearTicks(axis.begin / 1e6, (axis.begin + axis.span) / 1e6, width / 110)) {
      pen.fillText(`${tick} s`, axis.across(tick * 1e6), height - 4);
    }
  }
  function cells(pen, look, stream, y, method, chosen) {
    const broad = 1.5 * (axis.width - axis.left) * axis.interval / axis.span;
    const last = lastUpTo(stream.stamp, axis.begin + axis.span);
    for (let i = Math.max(0, lastUpTo(stream.stamp, axis.begin)); i <= last; i += 1) {
      const id = stream.first + i, x = axis.across(stream.stamp[i]), next = i + 1 < stream.count ? axis.across(stream.stamp[i + 1]) : x + 8;
      if (x < axis.left - 1) continue;
      const breadth = Math.max(1, Math.min(next - x, broad, 12) - (next - x > 4 ? 1.5 : 0));
      pen.fillStyle = pen.strokeStyle = look[outcomeOf(run, method, id)];
      if (method.rows.fresh_answer_us[id] >= 0) pen.fillRect(x, y + 1, breadth, ROW_PX - 3);
      else { pen.lineWidth = 1.1; pen.strokeRect(x + 0.6, y + 1.6, Math.max(breadth - 1.2, 0.5), ROW_PX - 4.2); }
      if (id === chosen) { pen.strokeStyle = look.ink; pen.lineWidth = 2; pen.strokeRect(x - 1, y, breadth + 2, ROW_PX - 1); }
    }
  }
  canvas.addEventListener("click", (event) => {
    const box = canvas.getBoundingClientRect(), x = event.clientX - box.left;
    const stream = visible[Math.floor((event.clientY - box.top) / ROW_PX)];
    if (stream && x >= axis.left) options.choose(stream.first + Math.max(0, lastUpTo(stream.stamp, axis.back(x))));
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
