// Ticks, what every chart has, and lines over a linear or logarithmic axis.

function linearTicks(low, high, count) {
  const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((width) => width >= rough);
  const ticks = [];
  for (let tick = Math.ceil(low / step - 1e-9); tick * step <= high + step * 1e-9; tick += 1) ticks.push(tick * step);
  return ticks;
}
function logTicks(low, high, sparse) {
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
    for (const digit of sparse ? [1] : [1, 2, 5]) {
      if (digit * 10 ** power >= low && digit * 10 ** power <= high) ticks.push(digit * 10 ** power);
    }
  }
  return ticks;
}

// What every chart has: keys that switch a series off, and a cursor that reads the others off, by pointer or by key.
// `sample` is the mark in a series' key; `parts` what is drawn; `moved` the cursor at a pixel, or some steps on from where
// it is; `told` is where the cursor stands, how far down it reaches, and its lines of text.
function chart(host, { title, note, label, height, series }, { sample, parts, moved, told }) {
  const hidden = new Set(), visible = () => series.filter((one) => !hidden.has(one.name));
  const svg = draw("svg", { height, tabindex: 0, role: "img", "aria-label": `${label}; left and right arrow read values off` });
  const tip = make("div", { class: "tip", role: "status", hidden: true });
  const keys = series.map((one) => make("button", { type: "button", "aria-pressed": "true", onclick: (event) => {
    if (!hidden.delete(one.name)) hidden.add(one.name);
    event.currentTarget.setAttribute("aria-pressed", String(!hidden.has(one.name)));
    render();
  } }, draw("svg", { width: 22, height: 10, class: one.color, "aria-hidden": "true" }, ...sample(one)), one.name));
  let cursor = null, width = 0;
  host.replaceChildren(...(title ? [make("h3", {}, title)] : []), make("div", { class: "keys" }, ...keys), svg, tip, ...(note ? [make("p", { class: "small" }, note)] : []));
  host.classList.add("chart");

  function render() {
    width = host.clientWidth || 600;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.replaceChildren(...parts(width, visible()));
    tip.hidden = cursor === null;
    if (cursor === null) return;
    const [at, foot, lines] = told(cursor, visible());
    svg.append(draw("line", { class: "cursor", x1: at, x2: at, y1: 10, y2: foot }));
    tip.textContent = lines.join("\n");
    tip.style.top = `${svg.offsetTop + 6}px`;
    tip.style.left = `${Math.max(0, at > width / 2 ? at - tip.offsetWidth - 10 : at + 10)}px`;
  }
  const move = (to) => { cursor = to; render(); };
  svg.addEventListener("pointermove", (event) => move(moved(event.clientX - svg.getBoundingClientRect().left, 0)));
  for (const gone of ["pointerleave", "blur"]) svg.addEventListener(gone, () => move(null));
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    move(moved(cursor === null ? null : told(cursor, [])[0], step));
  });
  new ResizeObserver(() => { if (host.clientWidth !== width) render(); }).observe(host);
  render();
}
// Horizontal lines with their values, and what the axis below is.
function axes({ low, high, up, format, log }, left, right, label, base) {
  const ticks = log ? logTicks(low, high, Math.log10(high / low) > 2.2) : linearTicks(low, high, 5);
  const lines = ticks.flatMap((tick) => [draw("line", { class: "grid", x1: left, x2: right, y1: up(tick), y2: up(tick) }),
    draw("text", { x: left - 8, y: up(tick) + 4, "text-anchor": "end" }, format(tick))]);
  return [...lines, draw("text", { x: (left + right) / 2, y: base, "text-anchor": "middle" }, label)];
}
const markLine = (at, foot, label, y) => [draw("line", { class: "mark", x1: at, x2: at, y1: 10, y2: foot }), draw("text", { x: at + 5, y }, label)];

// The marks that tell lines apart without colour, as in figures: disc, square, triangle, diamond, triangle on its tip, plus,
// cross and star. With its colour, no method's mark is that of another.
const MARKERS = ["M-3.2 0a3.2 3.2 0 1 0 6.4 0a3.2 3.2 0 1 0 -6.4 0Z", "M-3 -3H3V3H-3Z", "M0 -3.8L3.8 3H-3.8Z", "M0 -4L4 0L0 4L-4 0Z",
  "M0 3.8L3.8 -3H-3.8Z", "M-1.3 -4H1.3V-1.3H4V1.3H1.3V4H-1.3V1.3H-4V-1.3H-1.3Z",
  "M-1.9 -3.8L0 -1.9L1.9 -3.8L3.8 -1.9L1.9 0L3.8 1.9L1.9 3.8L0 1.9L-1.9 3.8L-3.8 1.9L-1.9 0L-3.8 -1.9Z",
  "M0 -4.4L1.1 -1.4H4.2L1.7 .5L2.6 3.6L0 1.8L-2.6 3.6L-1.7 .5L-4.2 -1.4H-1.1Z"];
const methodMarker = (method) => lookOf(method) + Math.floor(lookOf(method) / DATA.palette);
const MARKER_PX = 60; // between two on a line
const markerAt = ({ color, marker, hollow }, x, y) => draw("path", { class: `${color} ${hollow ? "hollow" : "solid"}`, d: MARKERS[marker % 8], transform: `translate(${x} ${y})` });

// series: {name, color (a CSS class), dash, marker (its number), x, y, steps}; the value at x is the last one up to x.
function lineChart(host, { title, series, x, y, marks = [], spans = [], height = 240 }) {
  const low = x.log ? Math.log(x.min) : x.min, high = x.log ? Math.log(x.max) : x.max;
  const left = 52, right = 12, top = title === y.label ? 10 : 22, foot = height - 38;
  let width = 0;
  const across = (value) => left + ((x.log ? Math.log(Math.max(value, x.min)) : value) - low) / (high - low || 1) * (width - left - right);
  const back = (pixel) => {
    const place = low + (pixel - left) / (width - left - right) * (high - low);
    return Math.min(Math.max(x.log ? Math.exp(place) : place, x.min), x.max);
  };
  const up = (value) => foot - (value - y.min) / (y.max - y.min || 1) * (foot - top);
  function path(one) {
    let text = "", before = null;
    for (let i = 0; i < one.x.length; i += 1) {
      const px = across(one.x[i]).toFixed(1), py = up(one.y[i]).toFixed(1);
      text += before === null ? (one.steps ? `M${px} ${up(y.min).toFixed(1)}V${py}` : `M${px} ${py}`) : one.steps ? `H${px}V${py}` : `L${px} ${py}`;
      before = py;
    }
    return one.steps && before !== null ? `${text}H${across(x.max).toFixed(1)}` : text;
  }
  function markers(one) { // each at a point of its line, those of other lines aside
    const found = new Set();
    for (let pixel = left + 15 + 17 * one.marker % MARKER_PX; one.marker !== undefined && pixel < width - right; pixel += MARKER_PX) found.add(lastUpTo(one.x, back(pixel)));
    return [...found].filter((i) => i >= 0).map((i) => markerAt(one, across(one.x[i]).toFixed(1), up(one.y[i]).toFixed(1)));
  }
  chart(host, { title, label: `${title || y.label} over ${x.label}`, height, series }, {
    sample: (one) => [draw("path", { d: "M0 5H22", "stroke-dasharray": one.dash }), ...(one.marker === undefined ? [] : [markerAt(one, 11, 5)])],
    parts: (now, visible) => {
      width = now;
      const few = x.log ? logTicks(x.min, x.max, width < 420) : [];
      const xs = x.log ? (few.length > 1 ? few : logTicks(x.min, x.max, false)) : linearTicks(x.min, x.max, Math.max(3, Math.min(8, width / 90)));
      return [...spans.map(({ from, to, text }) => draw("rect", { class: "span", x: across(from), y: top, width: Math.max(across(Math.min(to ?? x.max, x.max)) - across(from), 1), height: foot - top }, draw("title", {}, text))),
        ...(title === y.label ? [] : [draw("text", { x: 0, y: 10 }, y.label)]),
        ...axes({ low: y.min, high: y.max, up, format: y.format }, left, width - right, x.label, height - 4),
        ...xs.map((tick) => draw("text", { x: across(tick), y: foot + 17, "text-anchor": "middle" }, digits(tick, 6))),
        ...marks.flatMap((mark) => markLine(across(mark.x), foot, mark.label, top + 24)),
        ...visible.filter((one) => one.x.length).flatMap((one) => [draw("path", { class: one.color, d: path(one), "stroke-dasharray": one.dash }), ...markers(one)])];
    },
    moved: (pixel, step) => back((pixel ?? width / 2) + step * width / 80),
    told: (cursor, visible) => [across(cursor), foot, [x.read(cursor), ...visible.map((one) => {
      const i = lastUpTo(one.x, cursor);
      return `${one.name}: ${i < 0 ? (one.steps ? y.read(0) : "nothing yet") : y.read(one.y[i])}`;
    })]],
  });
}
