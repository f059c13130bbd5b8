// The page of a sweep, from its data. A metric is `of` several things: [method, placement, component] each.

const METRICS = new Map(DATA.metrics.map((one) => [one.name, one]));

// What tells the lines of a metric apart: its methods where there are several, else where its Genies are.
function ofText(metric, i) {
  const { of } = METRICS.get(metric), [method, placement, component] = of[i], parts = [];
  const several = new Set(of.map(([name]) => name)).size > 1;
  if (several || placement === "all") parts.push(methodTitle(method));
  if (placement !== "all") parts.push(placementText(placement));
  if (component) parts.push(`${metric.startsWith("improvement") ? "over " : ""}${component === DATA.zero_delay.component ? DATA.zero_delay.title : methodTitle(component)}`);
  return parts.join(metric.startsWith("improvement") ? " " : ", ");
}
// A placement's colour is no method's; with one method an improvement has the colour of what it is over.
const colourOf = ([method, placement, component]) => (placement === "all" ? methodClass(placeOf(component) >= 0 ? component : method) : `p-${placement}`);
const markerOf = ([method, , component]) => methodMarker(placeOf(component) >= 0 ? component : method);
const unitOf = (metric) => (METRICS.get(metric).unit === "1" ? "" : METRICS.get(metric).unit);
const readAs = (metric) => (value) => (isShare(metric) ? percent(value) : `${digits(value)} ${unitOf(metric)}`.trim());
const bare = (metric) => (value) => (isShare(metric) ? percent(value) : digits(value));
const titleOf = (metric) => (unitOf(metric) ? `${infoOf(metric).title} [${unitOf(metric)}]` : infoOf(metric).title);
const levelText = (level) => (typeof level === "number" ? digits(level, 6) : level);
const foundAt = (values, metric, of, i) => values[metric]?.[of]?.map((column) => column[i]) ?? null;

function showAbout() {
  const seeds = ABOUT.seeds.length > 5 ? `${ABOUT.seeds.length}` : ABOUT.seeds.join(", ");
  table(byId("axes"), "Axes", ["axis", "sets", "values"], DATA.curves.map((curve, i) => {
    const shown = curve.levels.slice(0, 12).map(levelText).join(", ");
    const named = DATA.axes[i].of.join(", ") || "several settings, by name";
    return [curve.column, named, curve.sampled ? `drawn, from ${levelText(curve.levels[0])} to ${levelText(curve.levels.at(-1))}`
      : `${shown}${curve.levels.length > 12 ? ", ..." : ""}`];
  }));
  const set = Object.entries(ABOUT.set);
  if (set.length) table(byId("set"), "Set at every point", ["setting", "value"], set.map(([path, value]) => [path, JSON.stringify(value)]));
  showFrame("a sweep", { scenario: ABOUT.scenario, axes: DATA.axes.map((axis) => axis.column).join(", "), points: ABOUT.points.toLocaleString("en"),
    seeds, runs: ABOUT.runs.toLocaleString("en") },
  "the tables beside this page. Every run is in runs.parquet, every point in table.csv; versions are in sweep.json.");
}

const intervals = ABOUT.seeds.length > 1 ? `means and 95 % intervals across ${ABOUT.seeds.length} seeds` : "one seed, so there are no intervals";

function showCurves() {
  const render = () => {
    const metric = byId("metric").value, split = byId("split").value;
    const { of } = METRICS.get(metric), kept = byId("series").value;
    byId("series").replaceChildren(...of.map((_, i) => option(i, ofText(metric, i))));
    byId("series").value = kept !== "" && kept < of.length ? kept : of.length - 1;
    byId("series-label").hidden = !split || of.length < 2;
    byId("curves").replaceChildren();
    for (const curve of DATA.curves) {
      const lines = curve.lines.filter((one) => (split ? one.by === split : one.by === null));
      if (!lines.length) continue;
      const points = (line, i) => curve.levels.map((level, place) => ({ x: curve.numeric ? level : place, found: foundAt(line.values, metric, i, place) }));
      const line = curve.numeric && !curve.sampled;
      const series = split ? lines.map((one, i) => ({ line, marker: i, name: `${split} ${levelText(one.level)}`, color: `h${i % DATA.hosts}`, points: points(one, byId("series").value) }))
        : of.map((one, i) => ({ line, marker: markerOf(one), dash: one[1] === "edge" ? "7 3" : null, name: ofText(metric, i), color: colourOf(one), points: points(lines[0], i) }));
      const names = curve.numeric ? null : curve.levels;
      intervalChart(byId("curves").appendChild(make("div")), { title: `${titleOf(metric)} along ${curve.column}`, series,
        x: { names, log: curve.log, label: `${curve.column}${curve.log ? ", logarithmic" : ""}`, read: (value) => `${curve.column}: ${names ? names[value] : levelText(value)}` },
        y: { log: METRICS.get(metric).log, label: titleOf(metric), format: bare(metric), read: readAs(metric), most: /reuse|share|recall/.test(metric) && isShare(metric) ? 1 : undefined } });
    }
    const others = DATA.axes.length > 1 ? ` Over axes that are not shown it is averaged, seed by seed.` : "";
    byId("along-about").textContent = `Here: ${intervals}.${others}${DATA.axes.some((axis) => axis.sampled) ? " Drawn values are points without a line: the other drawn axes differ from one to the next." : ""}`;
  };
  const splits = new Set(DATA.curves.flatMap((curve) => curve.lines.map((line) => line.by)).filter((by) => by !== null));
  byId("split").replaceChildren(option("", "averaged over the other axes"), ...[...splits].map((by) => option(by, `one for each ${by}`)));
  byId("split").parentElement.hidden = !splits.size;
  byId("metric").replaceChildren(...DATA.metrics.map((one) => option(one.name, titleOf(one.name))));
  if (!DATA.metrics.length) { byId("along").hidden = true; return; }
  byId("metric").value = (DATA.metrics.find((one) => one.name === "object_reuse") || DATA.metrics[0]).name;
  byId("metric").addEventListener("change", () => { byId("series").replaceChildren(); });
  for (const id of ["metric", "split", "series"]) byId(id).addEventListener("change", render);
  render();
}

function showTable() {
  const { points, levels, values } = DATA.table, main = DATA.metrics.filter((one) => one.main).map((one) => one.name);
  const render = () => {
    const chosen = byId("columns").value ? [byId("columns").value] : main;
    const columns = chosen.flatMap((metric) => METRICS.get(metric).of.map((_, i) => [metric, i]));
    const asked = byId("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const rows = points.map((number, i) => i).filter((i) => {
      const text = levels.map((column) => levelText(column[i])).join(" ").toLowerCase();
      return asked.every((word) => text.includes(word));
    });
    byId("count").textContent = `${rows.length} of ${ABOUT.points}`;
    const head = ["point", ...DATA.axes.map((axis) => axis.column), ...columns.map(([metric, i]) => `${titleOf(metric)}, ${ofText(metric, i)}`)];
    sortable(byId("table"), head, rows.map((i) => [
      { key: points[i], node: make("th", { scope: "row" }, String(points[i])) },
      ...levels.map((column) => ({ key: column[i], node: make("td", { class: "number" }, levelText(column[i])) })),
      ...columns.map(([metric, of]) => {
        const found = foundAt(values, metric, of, i);
        return { key: found ? found[0] : null, node: intervalCell(found, bare(metric)) };
      }),
    ]));
  };
  byId("columns").replaceChildren(option("", "the main metrics"), ...DATA.metrics.map((one) => option(one.name, titleOf(one.name))));
  byId("columns").addEventListener("change", render);
  byId("filter").addEventListener("input", render);
  byId("points-about").textContent = `A click on a column's head sorts by it. In small print: the 95 % interval across seeds${ABOUT.seeds.length > 1 ? "" : ", which takes more than one seed"}.`;
  render();
}

showCurves();
showTable();
showAbout();
