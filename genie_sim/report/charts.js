// Lines over a linear or logarithmic axis, with a cursor that reads every line off.

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

// series: {name, color (a CSS class), dash, x, y, steps}; the value at x is the last one up to x.
function lineChart(host, { title, series, x, y, marks = [], height = 240 }) {
  const hidden = new Set();
  const svg = draw("svg", { height, tabindex: 0, role: "img",
    "aria-label": `${title || y.label} over ${x.label}; left and right arrow read values off` });
  const tip = make("div", { class: "tip", role: "status", hidden: true });
  const keys = make("div", { class: "keys" }, ...series.map((one) => key(one)));
  host.replaceChildren(...(title ? [make("h3", {}, title)] : []), keys, svg, tip);
  host.classList.add("chart");
  const low = x.log ? Math.log(x.min) : x.min, high = x.log ? Math.log(x.max) : x.max;
  const left = 52, right = 12, top = 10, bottom = 38;
  let cursor = null, width = 0;
  const across = (value) => left + ((x.log ? Math.log(Math.max(value, x.min)) : value) - low) / (high - low || 1) * (width - left - right);
  const back = (pixel) => {
    const place = low + (pixel - left) / (width - left - right) * (high - low);
    return Math.min(Math.max(x.log ? Math.exp(place) : place, x.min), x.max);
  };
  const up = (value) => height - bottom - (value - y.min) / (y.max - y.min || 1) * (height - top - bottom);

  function key(one) {
    return make("button", { type: "button", "aria-pressed": "true", onclick: (event) => {
      if (!hidden.delete(one.name)) hidden.add(one.name);
      event.currentTarget.setAttribute("aria-pressed", String(!hidden.has(one.name)));
      render();
    } }, draw("svg", { width: 22, height: 8, class: one.color, "aria-hidden": "true" },
      draw("path", { d: "M0 4H22", "stroke-dasharray": one.dash })), one.name);
  }
  function path(one) {
    let text = "", before = null;
    for (let i = 0; i < one.x.length; i += 1) {
      const px = across(one.x[i]).toFixed(1), py = up(one.y[i]).toFixed(1);
      text += before === null ? (one.steps ? `M${px} ${up(y.min).toFixed(1)}V${py}` : `M${px} ${py}`) : one.steps ? `H${px}V${py}` : `L${px} ${py}`;
      before = py;
    }
    return one.steps && before !== null ? `${text}H${across(x.max).toFixed(1)}` : text;
  }
  function render() {
    width = host.clientWidth || 600;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const xs = x.log ? logTicks(x.min, x.max, width < 420) : linearTicks(x.min, x.max, Math.max(3, Math.min(8, width / 90)));
    const parts = [];
    for (const tick of linearTicks(y.min, y.max, 5)) {
      parts.push(draw("line", { class: "grid", x1: left, x2: width - right, y1: up(tick), y2: up(tick) }),
        draw("text", { x: left - 8, y: up(tick) + 4, "text-anchor": "end" }, y.format(tick)));
    }
    for (const tick of xs) parts.push(draw("text", { x: across(tick), y: height - bottom + 17, "text-anchor": "middle" }, digits(tick, 6)));
    parts.push(draw("text", { x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, x.label));
    for (const mark of marks) {
      parts.push(draw("line", { class: "mark", x1: across(mark.x), x2: across(mark.x), y1: top, y2: height - bottom }),
        draw("text", { x: across(mark.x) + 5, y: top + 24 }, mark.label));
    }
    for (const one of series) {
      if (!hidden.has(one.name) && one.x.length) parts.push(draw("path", { class: one.color, d: path(one), "stroke-dasharray": one.dash }));
    }
    if (cursor !== null) parts.push(draw("line", { class: "cursor", x1: across(cursor), x2: across(cursor), y1: top, y2: height - bottom }));
    svg.replaceChildren(...parts);
    tip.hidden = cursor === null;
    if (cursor === null) return;
    const lines = series.filter((one) => !hidden.has(one.name)).map((one) => {
      const i = lastUpTo(one.x, cursor);
      return `${one.name}: ${i < 0 ? (one.steps ? y.read(0) : "nothing yet") : y.read(one.y[i])}`;
    });
    tip.textContent = [x.read(cursor), ...lines].join("\n");
    const at = across(cursor);
    tip.style.top = `${svg.offsetTop + 6}px`;
    tip.style.left = `${Math.max(0, at > width / 2 ? at - tip.offsetWidth - 10 : at + 10)}px`;
  }
  svg.addEventListener("pointermove", (event) => { cursor = back(event.clientX - svg.getBoundingClientRect().left); render(); });
  svg.addEventListener("pointerleave", () => { cursor = null; render(); });
  svg.addEventListener("blur", () => { cursor = null; render(); });
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    cursor = back(across(cursor === null ? back(width / 2) : cursor) + step * width / 80);
    render();
  });
  new ResizeObserver(() => { if (host.clientWidth !== width) render(); }).observe(host);
  render();
}
