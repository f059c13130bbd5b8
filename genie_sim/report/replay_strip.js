// Every frame of every camera under one method, on an axis of time.
// Uses replay_elements.js, replay_model.js, replay_canvas.js.

const CELL_PX = 6; // a frame in the strip is at least about that broad
const ROW_PX = 15; // a camera
const MOST_STREAMS = 6; // of more, those of one car

// The stretch of time that is shown. It stays where it is as long as `t` is in it, so that what is clicked does not
// run away from the pointer.
class TimeAxis {
  constructor(run) {
    const { stamp, count } = run.streams[0];
    const interval = (stamp[count - 1] - stamp[0]) / Math.max(count - 1, 1) || 1e5;
    Object.assign(this, { run, interval, begin: run.begin_us, span: 1, width: 0, left: 0 });
  }

  follow(t, width) {
    const { begin_us, end_us } = this.run;
    this.width = width;
    this.left = width < 520 ? 74 : 112;
    this.span = Math.min(Math.max(end_us - begin_us, 1), (width / CELL_PX) * this.interval);
    const begin = Math.min(Math.max(this.begin, t - 0.98 * this.span), t - 0.02 * this.span);
    this.begin = Math.min(Math.max(begin, begin_us), end_us - this.span);
  }

  get broad() {
    return this.width - this.left - 10;
  }
  across(t) {
    return this.left + ((t - this.begin) / this.span) * this.broad;
  }
  back(x) {
    return this.begin + ((x - this.left) / this.broad) * this.span;
  }
}

// One row a camera, one cell a frame. `options` as of `Street`.
class Strip {
  constructor(run, canvas, axis, options) {
    Object.assign(this, { run, canvas, axis, options, visible: run.streams });
    canvas.addEventListener("click", (event) => this.chooseCell(event));
    canvas.addEventListener("keydown", (event) => this.chooseByKey(event));
  }

  paint(t) {
    const { run, axis, canvas } = this,
      chosen = this.options.selected();
    const car = chosen >= 0 ? run.streams[run.frames.stream[chosen]].car : run.cars[0].name;
    this.visible = run.streams.filter((stream) => run.streams.length <= MOST_STREAMS || stream.car === car);
    canvas.style.height = `${this.visible.length * ROW_PX + 22}px`;
    const { pen, width, height } = prepareCanvas(canvas),
      look = looks();
    pen.font = "11.5px system-ui, sans-serif";
    this.visible.forEach((stream, index) => {
      Object.assign(pen, { fillStyle: look.muted, textAlign: "left" });
      const name = width < 520 ? stream.name.replace(/^camera_/, "") : stream.name;
      pen.fillText(`${stream.car} ${name}`, 0, index * ROW_PX + 11, axis.left - 4);
      this.drawCells(pen, look, stream, index * ROW_PX);
    });
    line(pen, [axis.across(t), 0], [axis.across(t), height - 18], look.ink, 1.2, 1);
    Object.assign(pen, { fillStyle: look.muted, textAlign: "center" });
    for (const tick of linearTicks(axis.begin / 1e6, (axis.begin + axis.span) / 1e6, width / 110)) {
      pen.fillText(`${tick} s`, axis.across(tick * 1e6), height - 4);
    }
  }

  drawCells(pen, look, { stamp, first, count }, y) {
    const { run, axis } = this,
      method = this.options.method(),
      chosen = this.options.selected();
    const broad = (1.5 * (axis.width - axis.left) * axis.interval) / axis.span;
    const last = lastUpTo(stamp, axis.begin + axis.span);
    for (let i = Math.max(0, lastUpTo(stamp, axis.begin)); i <= last; i += 1) {
      const id = first + i,
        x = axis.across(stamp[i]),
        next = i + 1 < count ? axis.across(stamp[i + 1]) : x + 8;
      if (x < axis.left - 1) continue;
      const breadth = Math.max(1, Math.min(next - x, broad, 12) - (next - x > 4 ? 1.5 : 0));
      pen.fillStyle = pen.strokeStyle = look[outcomeOf(run, method, id)];
      pen.lineWidth = 1.1;
      if (method.rows.fresh_answer_us[id] >= 0) pen.fillRect(x, y + 1, breadth, ROW_PX - 3);
      else pen.strokeRect(x + 0.6, y + 1.6, Math.max(breadth - 1.2, 0.5), ROW_PX - 4.2);
      if (id !== chosen) continue;
      Object.assign(pen, { strokeStyle: look.ink, lineWidth: 2 });
      pen.strokeRect(x - 1, y, breadth + 2, ROW_PX - 1);
    }
  }

  chooseCell(event) {
    const box = this.canvas.getBoundingClientRect(),
      x = event.clientX - box.left;
    const stream = this.visible[Math.floor((event.clientY - box.top) / ROW_PX)];
    if (stream && x >= this.axis.left) this.options.choose(frameAt(stream, this.axis.back(x)));
  }

  chooseByKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { frames, streams } = this.run,
      id = Math.max(this.options.selected(), 0),
      place = frames.stream[id];
    const { first, count } = streams[place],
      other = (stream) => (stream ? frameAt(stream, frames.stamp[id]) : id);
    const target = {
      ArrowLeft: Math.max(id - 1, first),
      ArrowRight: Math.min(id + 1, first + count - 1),
      ArrowUp: other(streams[place - 1]),
      ArrowDown: other(streams[place + 1]),
      Home: first,
      End: first + count - 1,
    }[event.key];
    if (event.key === "Enter") byId("frame").scrollIntoView();
    if (target === undefined) return;
    event.preventDefault();
    this.options.choose(target);
  }
}

// The last frame of a camera up to `t`, else its first.
const frameAt = ({ first, stamp }, t) => first + Math.max(0, lastUpTo(stamp, t));
