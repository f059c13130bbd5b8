// The map of a fleet over time: streets, cells with load or reuse as a heat map, cars; and distributions over its cars.

const FLEET_STEP_MS = 250; // of the wall clock, between two instants while it plays
const MARGIN_PX = 14;

function showFleet() {
  const fleet = DATA.fleet;
  if (!fleet) { byId("town").remove(); return; }
  byId("town").hidden = false;
  const slider = byId("fleet-time"), size = [fleet.blocks[0] * fleet.block_m, fleet.blocks[1] * fleet.block_m];
  const columns = 1 + Math.max(0, ...fleet.cells.map(([column]) => column)), rows = 1 + Math.max(0, ...fleet.cells.map(([, row]) => row));
  const methods = METHODS.filter((one) => fleet.load.some((cell) => cell.method === one.name));
  let now = Math.floor(fleet.instants_s.length * 0.4), timer = null;
  slider.max = fleet.instants_s.length - 1;
  byId("fleet-method").replaceChildren(...methods.map((one) => option(one.name, one.title)));
  if (methods.length) byId("fleet-method").value = (methods.findLast((one) => !one.baseline) ?? methods.at(-1)).name;

  const shown = () => fleet[byId("fleet-shows").value].filter((cell) => cell.method === byId("fleet-method").value);
  const scaleOf = (width, height) => Math.min((width - 2 * MARGIN_PX) / size[0], (height - 2 * MARGIN_PX) / size[1]);
  // Metres to pixels, north upwards.
  const placed = (width, height) => {
    const scale = scaleOf(width, height), left = (width - scale * size[0]) / 2, foot = (height + scale * size[1]) / 2;
    return (east, north) => [left + scale * east, foot - scale * north];
  };

  function render() {
    const { pen, width, height } = prepareCanvas(byId("fleet-map")), look = looks(), at = placed(width, height);
    pen.clearRect(0, 0, width, height);
    for (const { cell: [column, row], values } of shown()) {
      if (values[now] === null) continue;
      const [x, y] = at(column * size[0] / columns, (row + 1) * size[1] / rows), [right, foot] = at((column + 1) * size[0] / columns, row * size[1] / rows);
      pen.globalAlpha = 0.08 + 0.72 * Math.min(values[now], 1);
      pen.fillStyle = look.miss;
      pen.fillRect(x, y, right - x, foot - y);
      pen.globalAlpha = 1;
    }
    streets(pen, look, at);
    for (let column = 0; column <= columns; column += 1) line(pen, at(column * size[0] / columns, 0), at(column * size[0] / columns, size[1]), look.muted, 1, 0.8);
    for (let row = 0; row <= rows; row += 1) line(pen, at(0, row * size[1] / rows), at(size[0], row * size[1] / rows), look.muted, 1, 0.8);
    for (const { cell: [column, row], values } of shown()) {
      const [x, y] = at((column + 0.5) * size[0] / columns, (row + 0.5) * size[1] / rows);
      pen.font = "12px system-ui, sans-serif";
      pen.fillStyle = look.ink;
      pen.fillRect(x - 3, y - 3, 6, 6);
      if (values[now] !== null && scaleOf(width, height) * size[0] / columns > 40) label(pen, look, `${Math.round(100 * values[now])} %`, x, y - 8, look.ink);
    }
    for (const car of fleet.cars) {
      const [x, y] = at(car.east[now], car.north[now]);
      pen.fillStyle = look.car;
      pen.beginPath();
      pen.arc(x, y, fleet.cars.length > 100 ? 2.2 : 3.4, 0, 2 * Math.PI);
      pen.fill();
    }
    tell();
  }

  function streets(pen, look, at) {
    for (const axis of [0, 1]) {
      for (let street = 0; street <= fleet.blocks[axis]; street += 1) {
        const place = street * fleet.block_m, main = street % fleet.main_every === 0;
        const ends = axis === 0 ? [at(place, 0), at(place, size[1])] : [at(0, place), at(size[0], place)];
        line(pen, ...ends, look.road, main ? 5 : 2.5, 0.9);
      }
    }
  }

  function tell() {
    const values = shown().map((cell) => cell.values[now]).filter((value) => value !== null), what = byId("fleet-shows").selectedOptions[0]?.textContent ?? "";
    const mean = values.length ? values.reduce((sum, value) => sum + value, 0) / values.length : null;
    const changed = fleet.hand_overs.find((one) => one.method === byId("fleet-method").value)?.until[now];
    slider.value = now;
    byId("fleet-clock").textContent = `${fleet.instants_s[now].toFixed(1)} s`;
    byId("fleet-now").textContent = `At ${fleet.instants_s[now].toFixed(1)} s: ${what}, ${mean === null ? "not recorded" :
      `mean ${percent(mean)}, highest ${percent(Math.max(...values))} over ${values.length} cells`}` +
      `${changed === undefined ? "" : `; ${changed} hand-overs until now`}. Left and right arrow move the time, space plays.`;
  }

  function hover(event) {
    const box = byId("fleet-map").getBoundingClientRect(), at = placed(box.width, box.height);
    const [x, y] = [event.clientX - box.left, event.clientY - box.top], [left, top] = at(0, size[1]), [right, foot] = at(size[0], 0);
    const column = Math.floor((x - left) / (right - left) * columns), row = Math.floor((foot - y) / (foot - top) * rows), tip = byId("fleet-tip");
    const read = (name, title) => {
      const found = fleet[name].find((one) => one.method === byId("fleet-method").value && one.cell[0] === column && one.cell[1] === row)?.values[now];
      return found === undefined || found === null ? [] : [`${title}: ${percent(found)}`];
    };
    tip.hidden = column < 0 || row < 0 || column >= columns || row >= rows;
    tip.textContent = [`Cell ${column}, ${row}`, ...read("load", "load"), ...read("reuse", "image reuse so far")].join("\n");
    tip.style.left = `${Math.min(x + 12, box.width - 150)}px`;
    tip.style.top = `${y + 12}px`;
  }

  const moveTo = (instant) => { now = Math.min(Math.max(instant, 0), fleet.instants_s.length - 1); render(); };
  function play(on) {
    clearInterval(timer);
    timer = on ? setInterval(() => (now + 1 < fleet.instants_s.length ? moveTo(now + 1) : play(false)), FLEET_STEP_MS) : null;
    byId("fleet-play").textContent = on ? "Pause" : "Play";
  }
  byId("fleet-play").addEventListener("click", () => play(timer === null));
  slider.addEventListener("input", () => { play(false); moveTo(Number(slider.value)); });
  for (const id of ["fleet-method", "fleet-shows"]) byId(id).addEventListener("change", render);
  byId("fleet-map").addEventListener("pointermove", hover);
  byId("fleet-map").addEventListener("pointerleave", () => { byId("fleet-tip").hidden = true; });
  byId("fleet-map").addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) moveTo(now + step);
    else if (event.key === " ") play(timer === null);
    else return;
    event.preventDefault();
  });
  new ResizeObserver(render).observe(byId("fleet-map"));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
  showFleetLegend(fleet);
  showOverCars(fleet);
  render();
}

function showFleetLegend(fleet) {
  const sign = (text, ...shapes) => make("span", {}, draw("svg", { width: 26, height: 14, "aria-hidden": "true" }, ...shapes), text);
  const swatch = (share, x) => draw("rect", { x, y: 2, width: 8, height: 10, fill: "var(--miss)", opacity: 0.08 + 0.72 * share });
  byId("fleet-legend").replaceChildren(
    sign("a cell's value, 0, 50 and 100 %", swatch(0, 0), swatch(0.5, 9), swatch(1, 18)),
    sign("border of a cell", draw("path", { d: "M0 7H26", stroke: "var(--muted)" })),
    sign("edge server", draw("rect", { x: 10, y: 4, width: 6, height: 6, fill: "var(--ink)" })),
    sign("street; broad: main street", draw("path", { d: "M0 7H26", stroke: "var(--road)", "stroke-width": 5 })),
    ...(fleet.cars.length ? [sign("car", draw("circle", { cx: 13, cy: 7, r: 3.4, fill: "var(--car)" }))] : []));
}

function showOverCars(fleet) {
  const charts = [["first_p95", "First answer, 95th percentile [ms]", "ms"], ["fresh_p95", "Fresh answer, 95th percentile [ms]", "ms"], ["image_reuse", "Image reuse", "1"]];
  for (const [of, title, unit] of charts) {
    const series = fleet.over_cars.filter((one) => one.of === of).map((one) => ({ ...one, name: methodTitle(one.method), color: methodClass(one.method), steps: true }));
    if (!series.length) continue;
    const all = series.flatMap((one) => one.x), log = unit === "ms", read = (value) => `up to ${asText(value, unit)}`;
    lineChart(byId("over-cars").appendChild(make("div")), { title, series, height: 220,
      x: { log, min: log ? Math.max(0.8 * Math.min(...all), 0.1) : 0, max: log ? 1.25 * Math.max(...all) : Math.max(...all, 0.05), label: title, read },
      y: { min: 0, max: 1, label: "share of cars", format: percent, read: percent } });
  }
  const rows = [...new Set(fleet.ghosts_by_age.flatMap((one) => one.rows.map(([low]) => low)))].sort((a, b) => a - b);
  byId("by-age").hidden = !rows.length;
  if (!rows.length) return;
  const until = new Map(fleet.ghosts_by_age.flatMap((one) => one.rows.map(([low, high]) => [low, high])));
  table(byId("ghosts-by-age"), null, ["age", ...fleet.ghosts_by_age.map((one) => methodKey(one.method))], rows.map((low) => [
    until.get(low) === null ? `${low} s and more` : `${low} to ${until.get(low)} s`,
    ...fleet.ghosts_by_age.map((one) => {
      const found = one.rows.find((row) => row[0] === low);
      return found ? make("td", { class: "number" }, percent(found[3]), make("small", {}, `of ${found[2].toLocaleString("en")} objects`)) : "none";
    })]));
}
