// What the pages about many runs share: charts of means with their intervals.

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

// series: {name, color, marker or hollow, dash, line, points: [{x, found: [value, low, high]}]}. x is a number, or an index into
// x.names; y.levels are lines with a label. With `log` an axis is logarithmic, if its values allow that.
function intervalChart(host, { title, note, series, x, y, height = 260 }) {
  const left = 56, right = 14, top = title === y.label ? 12 : 24;
  const shown = series.filter((one) => one.points.some((point) => point.found && isNumber(point.found[0])));
  const places = [...new Set(shown.flatMap((one) => one.points.map((point) => point.x)))].sort((a, b) => a - b);
  if (!places.length) { host.replaceChildren(make("h3", {}, title), make("p", { class: "small" }, "Not defined at any of these points.")); return; }
  const ends = shown.flatMap((one) => one.points.flatMap((point) => point.found || [])).filter(isNumber);
  const levels = y.levels || [];
  let low = Math.min(0, ...ends), high = Math.max(...ends, ...levels.map((one) => one.y)), width = 0;
  if (y.most !== undefined && high <= y.most * 1.3) { high = Math.max(y.most, high); } else high += 0.06 * (high - low || 1);
  if (low < 0) low -= 0.06 * (high - low);
  if (high === low) high = low + 1;
  const least = Math.min(...shown.flatMap((one) => one.points.map((point) => point.found?.[0])).filter(isNumber)), tall = y.log && least > 0;
  if (tall) { low = least / 1.4; high = Math.max(...ends) * 1.2; }
  const log = x.log && places[0] > 0, scaled = (value) => (log ? Math.log(value) : value);
  const all = places.map(scaled);
  let from = Math.min(...all), to = Math.max(...all);
  const slack = x.names ? 0.5 : from === to ? 1 : 0.04 * (to - from);
  from -= slack;
  to += slack;
  const across = (value) => left + (scaled(value) - from) / (to - from) * (width - left - right);
  const tilted = () => x.names && x.names.some((name) => name.length * 6.6 > (width - left - right) / x.names.length);
  const foot = () => height - (tilted() ? 84 : 40);
  const risen = (value) => (tall ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low));
  const up = (value) => foot() - risen(value) * (foot() - top);
  const aside = (one) => (x.names ? (shown.indexOf(one) - (shown.length - 1) / 2) * Math.min(9, 0.7 * (width - left - right) / places.length / shown.length) : 0);

  function drawn(one) {
    const known = one.points.filter((point) => point.found && isNumber(point.found[0])), parts = [], dx = aside(one);
    const at = (point) => (across(point.x) + dx).toFixed(1);
    if (one.line && known.length > 1) {
      parts.push(draw("path", { d: known.map((point, i) => `${i ? "L" : "M"}${at(point)} ${up(point.found[0]).toFixed(1)}`).join(""), "stroke-dasharray": one.dash }));
    }
    for (const point of known) {
      const [value, from_, to_] = point.found;
      if (isNumber(from_)) parts.push(draw("path", { class: "ends", d: `M${at(point)} ${up(from_).toFixed(1)}V${up(to_).toFixed(1)}m-3 0h6M${at(point)} ${up(from_).toFixed(1)}m-3 0h6` }));
      parts.push(one.marker === undefined ? draw("circle", { cx: at(point), cy: up(value).toFixed(1), r: known.length > 60 ? 2 : 3.2, class: one.hollow ? "hollow" : null })
        : markerAt(one, at(point), up(value).toFixed(1)));
    }
    return draw("g", { class: one.color }, ...parts);
  }
  function xTexts() {
    const base = foot();
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
  const nearest = (pixel) => places.reduce((best, place) => (Math.abs(across(place) - pixel) < Math.abs(across(best) - pixel) ? place : best), places[0]);
  const named = tall ? `${title}, logarithmic` : title;
  chart(host, { title: named, note, label: `${named || y.label} over ${x.label}`, height, series: shown }, {
    sample: (one) => [...(one.line ? [draw("path", { d: "M0 5H22", "stroke-dasharray": one.dash })] : []),
      one.marker === undefined ? draw("circle", { cx: 11, cy: 5, r: 3.2, class: one.hollow ? "hollow" : null }) : markerAt(one, 11, 5)],
    parts: (now, visible) => {
      width = now;
      return [...(title === y.label ? [] : [draw("text", { x: 0, y: 10 }, y.label)]), ...axes({ low, high, up, format: y.format, log: tall }, left, width - right, x.label, height - 4), ...xTexts().filter(Boolean),
        ...levels.flatMap((level) => [draw("line", { class: "level", x1: left, x2: width - right, y1: up(level.y), y2: up(level.y) }),
          draw("text", { x: width - right, y: up(level.y) - 4, "text-anchor": "end" }, level.label)]),
        ...visible.map(drawn)];
    },
    moved: (pixel, step) => (pixel === null ? places[0] : places[Math.min(Math.max(places.indexOf(nearest(pixel)) + step, 0), places.length - 1)]),
    told: (place, visible) => [across(place), foot(), [x.read(place), ...visible.map((one) => {
      const point = one.points.find((two) => two.x === place);
      return `${one.name}: ${withInterval(point && point.found, y.read)}`;
    })]],
  });
}
