// The page of a search, from its data.

const OBJECTIVES = DATA.objectives, DESIGNS = DATA.designs;
const shareOf = (objective) => infoOf(objective.metric).unit === "%";
const unitText = (objective) => (shareOf(objective) ? "" : infoOf(objective.metric).unit);
const readValue = (objective) => (value) => (shareOf(objective) ? percent(value) : `${digits(value)} ${unitText(objective)}`.trim());
const bareValue = (objective) => (value) => (shareOf(objective) ? percent(value) : digits(value));
const headOf = (objective) => `${objective.title}${unitText(objective) ? ` [${unitText(objective)}]` : ""}, ${objective.better} is better`;
const levelText = (level) => (level === null ? "" : typeof level === "number" ? digits(level, 5) : level);
const kindOf = (design) => `${methodTitle(design.method)}${design.tuned ? "" : ", as it is"}`;

function showPicks() {
  byId("picks").replaceChildren(...DATA.picks.map((pick) => {
    const { equal } = DESIGNS.find((one) => one.name === pick.design);
    return make("li", {}, pick.text, equal ? ` Not to be told apart from: ${equal}.` : null, make("br"), make("code", {}, `genie-sim run ${pick.file}`));
  }));
}

function showFront() {
  const [first, ...others] = OBJECTIVES;
  if (!others.length) { byId("front").hidden = true; return; }
  const kinds = [...new Set(DESIGNS.map(kindOf))];
  const render = () => {
    const against = others[byId("against").value];
    const series = kinds.map((kind) => {
      const members = DESIGNS.filter((design) => kindOf(design) === kind);
      return { name: kind, color: methodClass(members[0].method), marker: methodMarker(members[0].method), hollow: !members[0].tuned, line: false,
        points: members.map((design) => ({ x: design.values[against.name][0], found: design.values[first.name], design: design.name })) };
    });
    const named = (x) => DESIGNS.filter((design) => design.values[against.name][0] === x).map((design) => design.name).join(", ");
    intervalChart(byId("scatter"), { title: `${sentence(first.title)} against ${against.title}`, series, height: 320,
      x: { log: against.log, label: `${headOf(against)}${against.log ? ", logarithmic" : ""}`, read: (x) => `${named(x)}: ${readValue(against)(x)}` },
      y: { log: first.log, label: headOf(first), format: bareValue(first), read: readValue(first) } });
  };
  byId("against").replaceChildren(...others.map((one, i) => option(i, one.title)));
  byId("against").addEventListener("change", render);
  render();
}

function showDesigns() {
  const head = ["design", "method", ...OBJECTIVES.map(headOf), "group", "dominated by", ...(ABOUT.subject_to.length ? ["keeps constraints"] : []), ...DATA.parameters];
  sortable(byId("table"), head, DESIGNS.map((design) => [
    { key: design.name, node: make("th", { scope: "row" }, design.name) },
    { key: kindOf(design), node: make("td", {}, kindOf(design)) },
    ...OBJECTIVES.map((one) => ({ key: design.values[one.name][0], node: intervalCell(design.values[one.name], bareValue(one)) })),
    { key: design.group, node: make("td", {}, design.group) },
    { key: design.dominated, node: make("td", {}, design.dominated) },
    ...(ABOUT.subject_to.length ? [{ key: String(design.within), node: make("td", {}, design.within ? "yes" : "no") }] : []),
    ...design.parameters.map((level) => ({ key: level, node: make("td", { class: "number" }, levelText(level)) })),
  ]));
}

function showParallel() {
  const tuned = [...new Set(DESIGNS.filter((design) => design.tuned).map((design) => design.method))];
  const picked = new Set(DATA.picks.map((pick) => pick.design)), svg = draw("svg", { role: "img" });
  const frame = byId("lines").parentElement; // scrolls where the lines need more width than there is
  const render = () => {
    const method = byId("of-method").value, members = DESIGNS.filter((design) => design.tuned && design.method === method);
    const columns = [...DATA.parameters.map((name, i) => ({ name, of: (design) => design.parameters[i] })),
      ...OBJECTIVES.map((one) => ({ name: one.title, of: (design) => design.values[one.name][0], text: bareValue(one) }))]
      .filter((column) => new Set(members.map(column.of).filter((level) => level !== null)).size > 1);
    svg.style.display = members.length > 1 ? "" : "none";
    byId("alone").textContent = members.length > 1 ? "" : `Only one design of ${methodTitle(method)} is left: the table has its parameters.`;
    if (members.length < 2) return;
    const width = Math.max(frame.clientWidth || 700, 60 + columns.length * 64), height = 340, top = 34, foot = height - 116;
    for (const column of columns) {
      const levels = [...new Set(members.map(column.of).filter((level) => level !== null))];
      const numeric = levels.every((level) => typeof level === "number");
      levels.sort((a, b) => (numeric ? a - b : String(a).localeCompare(String(b), "en")));
      const [low, high] = [levels[0], levels.at(-1)], show = column.text ?? levelText;
      column.at = (level) => foot - (numeric ? (level - low) / (high - low) : levels.indexOf(level) / (levels.length - 1)) * (foot - top);
      column.ends = [show(low), show(high)];
    }
    const across = (i) => 90 + i * (width - 140) / Math.max(columns.length - 1, 1);
    const line = (design) => {
      let text = "", open = false;
      columns.forEach((column, i) => {
        const level = column.of(design);
        if (level === null) { open = false; return; }
        text += `${open ? "L" : "M"}${across(i).toFixed(1)} ${column.at(level).toFixed(1)}`;
        open = true;
      });
      return draw("path", { class: `${methodClass(method)}${picked.has(design.name) ? " thick" : ""}`, d: text, opacity: picked.has(design.name) ? 1 : 0.5 }, draw("title", {}, design.name));
    };
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("height", height);
    svg.style.width = `${width}px`;
    svg.setAttribute("aria-label", `Parallel coordinates of ${members.length} designs of ${methodTitle(method)}`);
    svg.replaceChildren(...columns.flatMap((column, i) => [draw("line", { class: "grid", x1: across(i), x2: across(i), y1: top, y2: foot }),
      draw("text", { x: across(i), y: top - 8, "text-anchor": "middle" }, column.ends[1]), draw("text", { x: across(i), y: foot + 16, "text-anchor": "middle" }, column.ends[0]),
      draw("text", { transform: `translate(${across(i) + 4} ${foot + 30}) rotate(-30)`, "text-anchor": "end" }, column.name)]), ...members.map(line));
  };
  byId("lines").replaceChildren(svg);
  byId("of-method").replaceChildren(...tuned.map((name) => option(name, methodTitle(name))));
  const designsOf = (name) => DESIGNS.filter((design) => design.tuned && design.method === name).length;
  byId("of-method").value = [...tuned].sort((a, b) => designsOf(b) - designsOf(a))[0];
  byId("of-method").addEventListener("change", render);
  new ResizeObserver(render).observe(frame);
  render();
}

function showImportance() {
  if (!DATA.importance.length) { byId("importance").hidden = true; return; }
  const keys = [...new Set(DATA.importance.map((row) => `${row.method}\n${row.parameter}`))];
  sortable(byId("explained"), ["method", "parameter", ...OBJECTIVES.map((one) => one.title), "points"], keys.map((key) => {
    const [method, parameter] = key.split("\n"), rows = DATA.importance.filter((row) => row.method === method && row.parameter === parameter);
    return [{ key: method, node: make("td", {}, methodTitle(method)) }, { key: parameter, node: make("th", { scope: "row" }, parameter) },
      ...OBJECTIVES.map((one) => {
        const row = rows.find((two) => two.metric === one.name);
        return { key: row ? row.value : null, node: intervalCell(row && [row.value, row.low, row.high], percent) };
      }), { key: rows[0].points, node: make("td", { class: "number" }, String(rows[0].points)) }];
  }));
}

function showDifferences() {
  if (!DATA.differences.length) { byId("differences").hidden = true; return; }
  const render = () => {
    const one = byId("one").value, other = byId("other").value;
    table(byId("paired"), `${one} minus ${other}, paired`, ["objective", "difference"], OBJECTIVES.map((objective) => {
      const row = DATA.differences.find((two) => two.metric === objective.name && [two.design, two.from].includes(one) && [two.design, two.from].includes(other) && one !== other);
      const found = row && (row.design === one ? [row.value, row.low, row.high] : [-row.value, -row.high, -row.low]);
      return [objective.title, intervalCell(found, bareValue(objective))];
    }));
  };
  for (const [id, place] of [["one", DESIGNS.findIndex((design) => design.name === DATA.picks[0].design)], ["other", 0]]) {
    byId(id).replaceChildren(...DESIGNS.map((design) => option(design.name, design.name)));
    byId(id).value = DESIGNS[place].name;
    byId(id).addEventListener("change", render);
  }
  render();
}

showPicks();
showFront();
showDesigns();
showParallel();
showImportance();
showDifferences();
showFrame("a search", { scenario: ABOUT.scenario, "points of each method": ABOUT.points.toLocaleString("en"), "tuning seeds": ABOUT.seeds.tuning.join(", "),
  "held-out seeds": ABOUT.seeds.held_out.join(", "), "tuning drives": ABOUT.drives.tuning.join(", "), "held-out drives": ABOUT.drives.held_out.join(", "),
  ...(ABOUT.subject_to.length ? { "subject to": ABOUT.subject_to.join(", ") } : {}) }, "the tables beside this page. Every point tried is in points.csv; versions are in search.json.");
