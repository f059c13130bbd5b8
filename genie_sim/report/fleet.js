// The map of a fleet over time: streets, cells as a heat map of what is asked for, cars with what became of their frames.

const FLEET_STEP_MS = 250; // of the wall clock, between two instants while it plays
const MARGIN_PX = 14;
const LAYER_TONES = { load: "miss", air: "miss", reuse: "hit" };
const FRAME_OUTCOMES = { h: "hit", m: "miss", c: "coalesced", a: "hit", n: "none" }; // as fleet_map.py writes them

function showFleet() {
  const fleet = DATA.fleet;
  if (!fleet) { byId("fleet").remove(); return; }
  byId("fleet").hidden = false;
  const slider = byId("fleet-time"), [west, south, eastEnd, northEnd] = fleet.extent_m, size = [eastEnd - west, northEnd - south];
  const { columns, rows } = fleet;
  const layers = fleet.layers.filter(({ name }) => fleet[name].length);
  const methods = METHODS.filter((method) => layers.some(({ name }) => fleet[name].some((cell) => cell.method === method.name)));
  let now = Math.floor(fleet.instants_s.length * 0.4), timer = null;
  slider.max = fleet.instants_s.length - 1;
  byId("fleet-method").replaceChildren(...methods.map((one) => option(one.name, one.title)));
  if (methods.length) byId("fleet-method").value = (methods.findLast((one) => !one.baseline) ?? methods.at(-1)).name;

  byId("fleet-shows").replaceChildren(...layers.map(({ name, title }) => option(name, title)));
  const layer = () => layers.find(({ name }) => name === byId("fleet-shows").value);
  const shown = () => (layer() ? fleet[layer().name].filter((cell) => cell.method === byId("fleet-method").value) : []);
  const scaleOf = (width, height) => Math.min((width - 2 * MARGIN_PX) / size[0], (height - 2 * MARGIN_PX) / size[1]);
  // Metres from the south-western corner to pixels, north upwards.
  const placed = (width, height) => {
    const scale = scaleOf(width, height), left = (width - scale * size[0]) / 2, foot = (height + scale * size[1]) / 2;
    return (east, north) => [left + scale * east, foot - scale * north];
  };

  function render() {
    const { pen, width, height } = prepareCanvas(byId("fleet-map")), look = looks(), at = placed(width, height), most = highestOf(fleet, layer());
    pen.clearRect(0, 0, width, height);
    for (const { cell: [column, row], values } of shown()) {
      if (values[now] === null) continue;
      const [x, y] = at(column * size[0] / columns, (row + 1) * size[1] / rows), [right, foot] = at((column + 1) * size[0] / columns, row * size[1] / rows);
      pen.globalAlpha = shade(values[now] / most);
      pen.fillStyle = look[LAYER_TONES[layer().name]];
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
      if (values[now] !== null && scaleOf(width, height) * size[0] / columns > 40) label(pen, look, cellText(layer(), values[now]), x, y - 8, look.ink);
    }
    for (const car of fleet.cars) {
      const [x, y] = at(car.east[now] - west, car.north[now] - south);
      const outcome = FRAME_OUTCOMES[car.outcomes[byId("fleet-method").value]?.[now]], size = fleet.cars.length > 100 ? 2.2 : 3.4;
      pen.fillStyle = look.bg;
      pen.beginPath();
      pen.arc(x, y, size + 1.5, 0, 2 * Math.PI);
      pen.fill();
      if (outcome) mark(pen, look, outcome, x, y, size);
      else mark(pen, { ...look, none: look.muted }, "none", x, y, 1);
    }
    tell();
  }

  function streets(pen, look, at) {
    for (const [ways, breadth] of [[fleet.streets, 2.5], [fleet.main_streets, 5]]) {
      for (const way of ways) {
        pen.beginPath();
        for (let place = 0; place < way.length; place += 2) pen.lineTo(...at(way[place] - west, way[place + 1] - south));
        Object.assign(pen, { globalAlpha: 0.9, strokeStyle: look.road, lineWidth: breadth });
        pen.stroke();
      }
    }
    pen.globalAlpha = 1;
  }

  function tell() {
    const values = shown().map((cell) => cell.values[now]).filter((value) => value !== null), what = layer()?.title ?? "";
    const mean = values.length ? values.reduce((sum, value) => sum + value, 0) / values.length : null;
    slider.value = now;
    byId("fleet-clock").textContent = `${fleet.instants_s[now].toFixed(1)} s`;
    byId("fleet-now").textContent = `At ${fleet.instants_s[now].toFixed(1)} s: ${what}, ${mean === null ? "not recorded" :
      `mean ${cellText(layer(), mean)}, highest ${cellText(layer(), Math.max(...values))} over ${values.length} cell${values.length === 1 ? "" : "s"}`}. Left and right arrow move the time, space plays.`;
  }

  function hover(event) {
    const box = byId("fleet-map").getBoundingClientRect(), at = placed(box.width, box.height);
    const [x, y] = [event.clientX - box.left, event.clientY - box.top], [left, top] = at(0, size[1]), [right, foot] = at(size[0], 0);
    const column = Math.floor((x - left) / (right - left) * columns), row = Math.floor((foot - y) / (foot - top) * rows), tip = byId("fleet-tip");
    const read = (entry) => {
      const value = fleet[entry.name].find((cell) => cell.method === byId("fleet-method").value && cell.cell[0] === column && cell.cell[1] === row)?.values[now];
      return value === undefined || value === null ? [] : [`${entry.title}: ${cellText(entry, value)}`];
    };
    tip.hidden = column < 0 || row < 0 || column >= columns || row >= rows;
    tip.textContent = [`Cell ${column}, ${row}`, ...layers.flatMap(read)].join("\n");
    tip.style.left = `${Math.max(0, Math.min(x + 12, box.width - tip.offsetWidth))}px`;
    tip.style.top = `${y + 12}px`;
  }

  const address = () => writeFleetAddress(fleet.instants_s[now], byId("fleet-method").value, byId("fleet-shows").value);
  const moveTo = (instant) => { now = Math.min(Math.max(instant, 0), fleet.instants_s.length - 1); render(); };
  function play(on) {
    clearInterval(timer);
    timer = on ? setInterval(() => (now + 1 < fleet.instants_s.length ? moveTo(now + 1) : play(false)), FLEET_STEP_MS) : null;
    byId("fleet-play").textContent = on ? "Pause" : "Play";
    if (!on) address(); // not while it plays: browsers bound how often an address may change
  }
  byId("fleet-play").addEventListener("click", () => play(timer === null));
  slider.addEventListener("input", () => { moveTo(Number(slider.value)); play(false); });
  for (const id of ["fleet-method", "fleet-shows"]) byId(id).addEventListener("change", () => { showFleetLegend(fleet, layer()); render(); address(); });
  byId("fleet-map").addEventListener("pointermove", hover);
  byId("fleet-map").addEventListener("pointerleave", () => { byId("fleet-tip").hidden = true; });
  byId("fleet-map").addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) { moveTo(now + step); address(); } else if (event.key === " ") play(timer === null);
    else return;
    event.preventDefault();
  });
  function follow() {
    const asked = readFleetAddress();
    if (!asked) return;
    if (methods.some(({ name }) => name === asked.method)) byId("fleet-method").value = asked.method;
    if (layers.some(({ name }) => name === asked.layer)) byId("fleet-shows").value = asked.layer;
    const after = fleet.instants_s.findIndex((instant) => instant >= asked.seconds - 0.05);
    now = after < 0 ? fleet.instants_s.length - 1 : after;
    byId("fleet").scrollIntoView();
  }
  follow();
  window.addEventListener("hashchange", () => { follow(); showFleetLegend(fleet, layer()); render(); });
  new ResizeObserver(render).observe(byId("fleet-map"));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
  showFleetLegend(fleet, layer());
  render();
}

const shade = (share) => 0.08 + 0.72 * Math.min(share, 1);
const cellText = (layer, value) => (layer.unit === "%" ? `${Math.round(100 * value)} %` : `${digits(value, 2)} ${layer.unit}`);
// What the darkest cell stands for, under every method and at every time.
function highestOf(fleet, layer) {
  if (!layer || layer.unit === "%") return 1;
  return Math.max(...fleet[layer.name].flatMap(({ values }) => values.map((value) => value ?? 0)), 1e-3);
}

function showFleetLegend(fleet, layer) {
  const sign = (text, ...shapes) => make("span", {}, draw("svg", { width: 26, height: 14, "aria-hidden": "true" }, ...shapes), text);
  const swatch = (share, x) => draw("rect", { x, y: 2, width: 8, height: 10, fill: `var(--${LAYER_TONES[layer.name]})`, opacity: shade(share) });
  const outcomes = new Set(fleet.cars.flatMap((car) => [...(car.outcomes[byId("fleet-method").value] ?? "")])), most = highestOf(fleet, layer);
  const frame = (letter, text, look) => (outcomes.has(letter) ? [sign(text, draw("circle", { cx: 13, cy: 7, r: 4, ...look }))] : []);
  byId("fleet-legend").replaceChildren(
    ...(layer ? [sign(`a cell's value: 0, ${cellText(layer, most / 2)}, ${cellText(layer, most)}`, swatch(0, 0), swatch(0.5, 9), swatch(1, 18))] : []),
    sign("border of a cell", draw("path", { d: "M0 7H26", stroke: "var(--muted)" })),
    sign("edge server", draw("rect", { x: 10, y: 4, width: 6, height: 6, fill: "var(--ink)" })),
    sign(fleet.main_streets.length ? "street; broad: main street" : "where a car has driven", draw("path", { d: "M0 7H26", stroke: "var(--road)", "stroke-width": 5 })),
    ...frame("h", "car, its last frame: hit", { fill: "var(--hit)" }), ...frame("a", "car, its last frame: answered", { fill: "var(--hit)" }),
    ...frame("m", "miss", { fill: "none", stroke: "var(--miss)", "stroke-width": 1.5 }),
    ...(outcomes.has("c") ? [sign("coalesced", draw("rect", { x: 9, y: 3, width: 8, height: 8, fill: "var(--coalesced)" }))] : []),
    ...frame("n", "no answer", { fill: "none", stroke: "var(--none)", "stroke-width": 1.5 }),
    ...(outcomes.has("-") ? [sign("no frame in this step", draw("circle", { cx: 13, cy: 7, r: 1.5, fill: "none", stroke: "var(--muted)" }))] : []));
  const [begin, next] = fleet.instants_s;
  byId("fleet-about").textContent = `${fleet.cars.length < fleet.all_cars ? `${fleet.cars.length} of ${fleet.all_cars.toLocaleString("en")} cars are drawn, evenly chosen; the cells count all` : "All cars are drawn"}. ` +
    `One step: ${digits(next - begin)} s. A cell counts the cars in it; their frames go to its edge or, near its border, to that of a neighbouring cell.`;
}
