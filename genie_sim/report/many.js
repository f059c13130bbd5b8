// What the pages about many runs share: sortable tables, and charts of means with their intervals.

const isNumber = (value) => value !== null && value !== undefined;

// 338 ms (330 to 360); without an interval the value alone.
function withInterval(found, text) {
  if (!found || !isNumber(found[0])) return "none";
  const [value, low, high] = found;
  return !isNumber(low) || low === high ? text(value) : `${text(value)} (${text(low)} to ${text(high)})`;
}

function intervalCell(found, text) {
  if (!found || !isNumber(found[0])) return make("td", {}, "none");
  const [value, low, high] = found, range = isNumber(low) && low !== high;
  return make("td", { class: "number" }, text(value), range ? make("small", {}, `${text(low)} to ${text(high)}`) : null);
}

// rows: arrays of {key, node}; a click on a column's head sorts by key, nothing known comes last in either direction.
function sortable(node, head, rows) {
  let by = -1, down = false;
  const order = (one, other) => {
    const [a, b] = [one[by].key, other[by].key];
    if (!isNumber(a) || !isNumber(b)) return Number(!isNumber(a)) - Number(!isNumber(b));
    const sign = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
    return down ? -sign : sign;
  };
  const heads = head.map((text, i) => make("th", { scope: "col" }, make("button", { type: "button", class: "sort", onclick: () => {
    down = by === i && !down;
    by = i;
    heads.forEach((one, place) => one.setAttribute("aria-sort", place !== by ? "none" : down ? "descending" : "ascending"));
    show();
  } }, text)));
  const body = make("tbody"), made = rows.map((row) => Object.assign([...row], { tr: make("tr", {}, ...row.map((one) => one.node)) }));
  const show = () => body.replaceChildren(...(by < 0 ? made : [...made].sort(order)).map((row) => row.tr));
  node.replaceChildren(make("thead", {}, make("tr", {}, ...heads)), body);
  show();
}

// series: {name, color, hollow, dash, line, points: [{x, found: [value, low, high]}]}. x is a number, or an index into
// x.names; y.levels and x.marks are lines with a label.
function intervalChart(host, { title, note, series, x, y, height = 260 }) {
  const hidden = new Set(), left = 56, right = 14, top = 12;
  const shown = series.filter((one) => one.points.some((point) => point.found && isNumber(point.found[0])));
  const places = [...new Set(shown.flatMap((one) => one.points.map((point) => point.x)))].sort((a, b) => a - b);
  const svg = draw("svg", { height, tabindex: 0, role: "img", "aria-label": `${title || y.label} over ${x.label}; left and right arrow read values off` });
  const tip = make("div", { class: "tip", role: "status", hidden: true });
  const keys = make("div", { class: "keys" }, ...shown.map(key));
  host.replaceChildren(...(title ? [make("h3", {}, title)] : []), keys, svg, tip, ...(note ? [make("p", { class: "small" }, note)] : []));
  host.classList.add("chart");
  if (!places.length) { svg.replaceWith(make("p", { class: "small" }, "Not defined at any of these points.")); return; }
  const ends = shown.flatMap((one) => one.points.flatMap((point) => point.found || [])).filter(isNumber);
  const levels = y.levels || [], marks = x.marks || [];
  let low = Math.min(0, ...ends), high = Math.max(...ends, ...levels.map((one) => one.y));
  if (y.most !== undefined && high <= y.most * 1.3) { high = Math.max(y.most, high); } else high += 0.06 * (high - low || 1);
  if (low < 0) low -= 0.06 * (high - low);
  if (high === low) high = low + 1;
  const log = x.log && places[0] > 0, scaled = (value) => (log ? Math.log(value) : value);
  const all = [...places, ...marks.map((mark) => mark.x)].map(scaled);
  let from = Math.min(...all), to = Math.max(...all), cursor = -1, width = 0;
  const slack = x.names ? 0.5 : from === to ? 1 : 0.04 * (to - from);
  from -= slack;
  to += slack;
  const across = (value) => left + (scaled(value) - from) / (to - from) * (width - left - right);
  const tilted = () => x.names && x.names.some((name) => name.length * 6.6 > (width - left - right) / x.names.length);
  const bottom = () => (tilted() ? 84 : 40);
  const up = (value) => height - bottom() - (value - low) / (high - low) * (height - top - bottom());
  const aside = (one) => (x.names ? (shown.indexOf(one) - (shown.length - 1) / 2) * Math.min(9, 0.7 * (width - left - right) / places.length / shown.length) : 0);

  function key(one) {
    return make("button", { type: "button", "aria-pressed": "true", onclick: (event) => {
      if (!hidden.delete(one.name)) hidden.add(one.name);
      event.currentTarget.setAttribute("aria-pressed", String(!hidden.has(one.name)));
      render();
    } }, draw("svg", { width: 22, height: 10, class: one.color, "aria-hidden": "true" },
      ...(one.line ? [draw("path", { d: "M0 5H22", "stroke-dasharray": one.dash })] : []),
      draw("circle", { cx: 11, cy: 5, r: 3.2, class: one.hollow ? "hollow" : null })), one.name);
  }
  function drawn(one) {
    const known = one.points.filter((point) => point.found && isNumber(point.found[0])), parts = [], dx = aside(one);
    const at = (point) => (across(point.x) + dx).toFixed(1);
    if (one.line && known.length > 1) {
      parts.push(draw("path", { d: known.map((point, i) => `${i ? "L" : "M"}${at(point)} ${up(point.found[0]).toFixed(1)}`).join(""), "stroke-dasharray": one.dash }));
    }
    for (const point of known) {
      const [value, from_, to_] = point.found;
      if (isNumber(from_)) parts.push(draw("path", { class: "ends", d: `M${at(point)} ${up(from_).toFixed(1)}V${up(to_).toFixed(1)}m-3 0h6M${at(point)} ${up(from_).toFixed(1)}m-3 0h6` }));
      parts.push(draw("circle", { cx: at(point), cy: up(value).toFixed(1), r: known.length > 60 ? 2 : 3.2, class: one.hollow ? "hollow" : null }));
    }
    return draw("g", { class: one.color }, ...parts);
  }
  function xTexts() {
    const base = height - bottom();
    if (!x.names) {
      const low_ = log ? Math.exp(from) : from, high_ = log ? Math.exp(to) : to, fine = log && Math.log10(high_ / low_) < 2.2;
      const ticks = log ? logTicks(low_, high_, !fine) : linearTicks(from, to, Math.max(3, Math.min(8, width / 90)));
      return ticks.map((tick) => draw("text", { x: across(tick), y: base + 17, "text-anchor": "middle" }, digits(tick, 6)));
    }
    const most = Math.ceil(places.length / Math.max((width - left - right) / 16, 1));
    return x.names.map((name, i) => {
      const px = across(i), text = name.length > 16 ? `${name.slice(0, 15)}\u2026` : name;
      if (i % most) return null;
      return tilted() ? draw("text", { transform: `translate(${px + 4} ${base + 14}) rotate(-38)`, "text-anchor": "end" }, text)
        : draw("text", { x: px, y: base + 17, "text-anchor": "middle" }, name);
    });
  }
  function render() {
    width = host.clientWidth || 600;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const parts = [];
    for (const tick of linearTicks(low, high, 5)) {
      parts.push(draw("line", { class: "grid", x1: left, x2: width - right, y1: up(tick), y2: up(tick) }),
        draw("text", { x: left - 8, y: up(tick) + 4, "text-anchor": "end" }, y.format(tick)));
    }
    parts.push(...xTexts().filter(Boolean), draw("text", { x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, x.label));
    for (const level of levels) {
      parts.push(draw("line", { class: "level", x1: left, x2: width - right, y1: up(level.y), y2: up(level.y) }),
        draw("text", { x: width - right, y: up(level.y) - 4, "text-anchor": "end" }, level.label));
    }
    for (const mark of marks) {
      parts.push(draw("line", { class: "mark", x1: across(mark.x), x2: across(mark.x), y1: top, y2: height - bottom() }),
        draw("text", { x: across(mark.x) + 4, y: top + 8 }, mark.label));
    }
    if (cursor >= 0) parts.push(draw("line", { class: "cursor", x1: across(places[cursor]), x2: across(places[cursor]), y1: top, y2: height - bottom() }));
    svg.replaceChildren(...parts, ...shown.filter((one) => !hidden.has(one.name)).map(drawn));
    tip.hidden = cursor < 0;
    if (cursor < 0) return;
    const lines = shown.filter((one) => !hidden.has(one.name)).map((one) => {
      const point = one.points.find((two) => two.x === places[cursor]);
      return `${one.name}: ${withInterval(point && point.found, y.read)}`;
    });
    tip.textContent = [x.read(places[cursor]), ...lines].join("\n");
    const at = across(places[cursor]);
    tip.style.top = `${svg.offsetTop + 6}px`;
    tip.style.left = `${Math.max(0, at > width / 2 ? at - tip.offsetWidth - 12 : at + 12)}px`;
  }
  const nearest = (pixel) => places.reduce((best, place, i) => (Math.abs(across(place) - pixel) < Math.abs(across(places[best]) - pixel) ? i : best), 0);
  svg.addEventListener("pointermove", (event) => { cursor = nearest(event.clientX - svg.getBoundingClientRect().left); render(); });
  for (const gone of ["pointerleave", "blur"]) svg.addEventListener(gone, () => { cursor = -1; render(); });
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    cursor = Math.min(Math.max(cursor + step, 0), places.length - 1);
    render();
  });
  new ResizeObserver(() => { if (host.clientWidth !== width) render(); }).observe(host);
  render();
}
