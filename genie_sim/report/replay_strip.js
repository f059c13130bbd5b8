// Every frame of every camera under one method, on an axis of time.

import { cleared, drawLine } from "./replay_canvas.js";
import { byId } from "./replay_elements.js";
import { isDriven, lastUpTo, outcomeOf } from "./replay_model.js";

const CELL_PX = 6; // a frame in the strip is at least about that broad
const ROW_PX = 15; // a camera
const MOST_STREAMS = 6; // of more, those of one car

// Round numbers, about so many.
function ticksOf(low, high, count) {
  const rough = (high - low) / count,
    power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((width) => width >= rough);
  const ticks = [];
  for (let tick = Math.ceil(low / step - 1e-9); tick * step <= high + step * 1e-9; tick += 1) {
    ticks.push(Number((tick * step).toPrecision(6)));
  }
  return ticks;
}

// The stretch of time that is shown. It stays where it is as long as `t` is in it, so that what is clicked does not
// run away from the pointer.
class TimeAxis {
  constructor(run) {
    const { stamp_us } = run.streams[0];
    const interval = (stamp_us.at(-1) - stamp_us[0]) / Math.max(stamp_us.length - 1, 1) || 1e5;
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

// One row a camera, one cell a frame. `choose` takes the id of the frame that is chosen in it.
export class Strip {
  constructor(run, canvas, choose) {
    Object.assign(this, { run, canvas, choose, axis: new TimeAxis(run), visible: run.streams, selected: 0 });
    canvas.addEventListener("click", (event) => this.chooseCell(event));
    canvas.addEventListener("keydown", (event) => this.chooseByKey(event));
  }

  // `state`: now [us], method, and selected, the id of the chosen frame.
  paint(state) {
    const { run, axis, canvas } = this,
      { car } = run.frames.stream[state.selected];
    this.selected = state.selected;
    this.visible = run.streams.filter((stream) => run.streams.length <= MOST_STREAMS || stream.car === car);
    canvas.style.height = `${this.visible.length * ROW_PX + 22}px`;
    const { pen, look, width, height } = cleared(canvas);
    axis.follow(state.now, width);
    pen.font = "11.5px system-ui, sans-serif";
    this.visible.forEach((stream, row) => {
      Object.assign(pen, { fillStyle: look.muted, textAlign: "left" });
      const name = width < 520 ? stream.stream.replace(/^camera_/, "") : stream.stream;
      pen.fillText(`${stream.car} ${name}`, 0, row * ROW_PX + 11, axis.left - 4);
      this.drawCells(pen, look, state, stream, row * ROW_PX);
    });
    drawLine(pen, [axis.across(state.now), 0], [axis.across(state.now), height - 18], look.ink, 1.2);
    Object.assign(pen, { fillStyle: look.muted, textAlign: "center" });
    for (const tick of ticksOf(axis.begin / 1e6, (axis.begin + axis.span) / 1e6, width / 110)) {
      pen.fillText(`${tick} s`, axis.across(tick * 1e6), height - 4);
    }
  }

  drawCells(pen, look, { method, selected }, { stamp_us, first_id }, y) {
    const { axis, run } = this,
      broad = (1.5 * (axis.width - axis.left) * axis.interval) / axis.span;
    const last = lastUpTo(stamp_us, axis.begin + axis.span);
    for (let place = Math.max(0, lastUpTo(stamp_us, axis.begin)); place <= last; place += 1) {
      const id = first_id + place,
        x = axis.across(stamp_us[place]),
        next = place + 1 < stamp_us.length ? axis.across(stamp_us[place + 1]) : x + 8;
      if (x < axis.left - 1) continue;
      const breadth = Math.max(1, Math.min(next - x, broad, 12) - (next - x > 4 ? 1.5 : 0));
      pen.fillStyle = pen.strokeStyle = look[outcomeOf(method, id)];
      pen.lineWidth = 1.1;
      if (method.frames.fresh_answer_us[id] >= 0) pen.fillRect(x, y + 1, breadth, ROW_PX - 3);
      else if (isDriven(run, method, id)) {
        pen.strokeRect(x + 0.6, y + 1.6, Math.max(breadth - 1.2, 0.5), ROW_PX - 4.2);
      }
      if (id !== selected) continue;
      Object.assign(pen, { strokeStyle: look.ink, lineWidth: 2 });
      pen.strokeRect(x - 1, y, breadth + 2, ROW_PX - 1);
    }
  }

  chooseCell(event) {
    const box = this.canvas.getBoundingClientRect(),
      x = event.clientX - box.left;
    const stream = this.visible[Math.floor((event.clientY - box.top) / ROW_PX)];
    if (stream && x >= this.axis.left) this.choose(frameAt(stream, this.axis.back(x)));
  }

  chooseByKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { frames, streams } = this.run,
      id = this.selected,
      row = streams.indexOf(frames.stream[id]);
    const { first_id, stamp_us } = streams[row],
      last_id = first_id + stamp_us.length - 1,
      beside = (stream) => (stream ? frameAt(stream, frames.stamp_us[id]) : id);
    const target = {
      ArrowLeft: Math.max(id - 1, first_id),
      ArrowRight: Math.min(id + 1, last_id),
      ArrowUp: beside(streams[row - 1]),
      ArrowDown: beside(streams[row + 1]),
      Home: first_id,
      End: last_id,
    }[event.key];
    if (event.key === "Enter") byId("frame").scrollIntoView();
    if (target === undefined) return;
    event.preventDefault();
    this.choose(target);
  }
}

// The last frame of a camera up to `t`, else its first.
const frameAt = ({ first_id, stamp_us }, t) => first_id + Math.max(0, lastUpTo(stamp_us, t));
