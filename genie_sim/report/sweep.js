// The page of a sweep, from its data.

const DATA = JSON.parse(byId("data").textContent);
const ABOUT = DATA.about;
const METRICS = new Map(DATA.metrics.map((one) => [one.name, one]));
const words = (name) => name.replaceAll("_", " ");
const option = (value, text) => make("option", { value }, text);

function roleText(metric, role) {
  if (/^(image|object)_reuse|^coalesced|^confidence|^stored/.test(metric)) return { local: "on cars", remote: "on edges" }[role] || role;
  return `${metric.startsWith("improvement") ? "over " : ""}${METHODS[role] || role}`;
}
const colorOf = (metric, role) => (roleText(metric, role) === "on edges" ? "c-genie" : ROLE_COLORS[role]);   // as in the figures
const isShare = (metric) => METRICS.get(metric).unit === "1" && metric !== "confidence_boost";
const unitOf = (metric) => (METRICS.get(metric).unit === "1" ? "" : METRICS.get(metric).unit);
const readAs = (metric) => (value) => (isShare(metric) ? percent(value) : `${digits(value)} ${unitOf(metric)}`.trim());
const bare = (metric) => (value) => (isShare(metric) ? percent(value) : digits(value));
const titleOf = (metric) => (unitOf(metric) ? `${words(metric)} [${unitOf(metric)}]` : words(metric));
const levelText = (level) => (typeof level === "number" ? digits(level, 6) : level);

function showAbout() {
  byId("version").textContent = ABOUT.genie_sim;
  byId("name").textContent = ABOUT.name;
  byId("description").textContent = ABOUT.description;
  const seeds = ABOUT.seeds.length > 5 ? `${ABOUT.seeds.length}` : ABOUT.seeds.join(", ");
  const facts = { scenario: ABOUT.scenario, axes: DATA.axes.map((axis) => axis.column).join(", "), points: ABOUT.points.toLocaleString("en"),
    seeds, runs: ABOUT.runs.toLocaleString("en") };
  byId("about").replaceChildren(...Object.entries(facts).map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
  table(byId("axes"), "Axes", ["axis", "sets", "values"], DATA.curves.map((curve, i) => {
    const shown = curve.levels.slice(0, 12).map(levelText).join(", ");
    const named = DATA.axes[i].of.join(", ") || "several settings, by name";
    return [curve.column, named, curve.sampled ? `drawn, from ${levelText(curve.levels[0])} to ${levelText(curve.levels.at(-1))}`
      : `${shown}${curve.levels.length > 12 ? ", ..." : ""}`];
  }));
  const set = Object.entries(ABOUT.set);
  if (set.length) table(byId("set"), "Set at every point", ["setting", "value"], set.map(([path, value]) => [path, JSON.stringify(value)]));
  byId("notes").replaceChildren(...[...DATA.notes, `Made by genie-sim ${ABOUT.genie_sim}. Every run is in runs.parquet, every point in ` +
    "table.csv beside this page; versions are in sweep.json."].map((note) => make("li", {}, note)));
}

const intervals = ABOUT.seeds.length > 1 ? `means and 95 % intervals across ${ABOUT.seeds.length} seeds` : "one seed, so there are no intervals";

function showCurves() {
  const found = (values, metric, role, i) => (values[metric] && values[metric][role] ? values[metric][role].map((column) => column[i]) : null);
  const dashes = [null, "7 3", "2 3", "9 3 2 3"];
  const render = () => {
    const metric = byId("metric").value, split = byId("split").value;
    const roles = METRICS.get(metric).roles, kept = byId("role").value;
    byId("role").replaceChildren(...roles.map((role) => option(role, roleText(metric, role))));
    byId("role").value = roles.includes(kept) ? kept : roles.includes("genie") ? "genie" : roles[0];
    byId("role-label").hidden = !split || roles.length < 2;
    byId("curves").replaceChildren();
    for (const curve of DATA.curves) {
      const lines = curve.lines.filter((one) => (split ? one.by === split : one.by === null));
      if (!lines.length) continue;
      const points = (line, role) => curve.levels.map((level, i) => ({ x: curve.numeric ? level : i, found: found(line.values, metric, role, i) }));
      const look = (i) => ({ dash: dashes[i % 4], hollow: i % 2 === 1, line: curve.numeric && !curve.sampled });
      const series = split ? lines.map((line, i) => ({ ...look(i), name: `${split} ${levelText(line.level)}`, color: `c${i % 8}`, points: points(line, byId("role").value) }))
        : roles.map((role, i) => ({ ...look(i), name: roleText(metric, role), color: colorOf(metric, role) || `c${i % 8}`, points: points(lines[0], role) }));
      const names = curve.numeric ? null : curve.levels;
      intervalChart(byId("curves").appendChild(make("div")), { title: `${titleOf(metric)} along ${curve.column}`, series,
        x: { names, log: curve.log, label: `${curve.column}${curve.log ? ", logarithmic" : ""}`, read: (value) => `${curve.column}: ${names ? names[value] : levelText(value)}` },
        y: { label: titleOf(metric), format: bare(metric), read: readAs(metric), most: /reuse|share|recall/.test(metric) && isShare(metric) ? 1 : undefined } });
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
  byId("metric").addEventListener("change", () => { byId("role").replaceChildren(); });
  for (const id of ["metric", "split", "role"]) byId(id).addEventListener("change", render);
  render();
}

function showTable() {
  const { points, levels, values } = DATA.table, main = DATA.metrics.filter((one) => one.main).map((one) => one.name);
  const render = () => {
    const chosen = byId("columns").value ? [byId("columns").value] : main;
    const columns = chosen.flatMap((metric) => METRICS.get(metric).roles.map((role) => [metric, role]));
    const asked = byId("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const rows = points.map((number, i) => i).filter((i) => {
      const text = levels.map((column) => levelText(column[i])).join(" ").toLowerCase();
      return asked.every((word) => text.includes(word));
    });
    byId("count").textContent = `${rows.length} of ${ABOUT.points}`;
    const head = ["point", ...DATA.axes.map((axis) => axis.column), ...columns.map(([metric, role]) => `${titleOf(metric)}, ${roleText(metric, role)}`)];
    sortable(byId("table"), head, rows.map((i) => [
      { key: points[i], node: make("th", { scope: "row" }, String(points[i])) },
      ...levels.map((column) => ({ key: column[i], node: make("td", { class: "number" }, levelText(column[i])) })),
      ...columns.map(([metric, role]) => {
        const found = values[metric] && values[metric][role] ? values[metric][role].map((column) => column[i]) : null;
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

showAbout();
showCurves();
showTable();
