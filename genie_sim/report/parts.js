// What response times go into: means by method as stacked bars, and the steps of one frame.

const partClass = (part) => `part-${DATA.parts.findIndex((one) => one.name === part)}`;
const partTitle = (part) => DATA.parts.find((one) => one.name === part).title;
const partKeys = (found) => make("div", { class: "legend" }, ...DATA.parts.filter((one) => found.has(one.name)).map((one) => make("span", {},
  draw("svg", { width: 14, height: 12, "aria-hidden": "true" }, draw("rect", { class: partClass(one.name), x: 1, y: 1, width: 12, height: 10 })), one.title)));

// A row for each method's mean first answer, and for its mean fresh one where that differs.
function partRows() {
  const parts = (name, answer) => DATA.metrics.filter(([metric, method]) => metric === `${answer}_answer_part` && method === name)
    .map(([, , , part, value]) => ({ part, value }));
  return METHODS.flatMap(({ name, title }) => {
    const [first, fresh] = [parts(name, "first"), parts(name, "fresh")];
    const both = JSON.stringify(first) === JSON.stringify(fresh) ? [["", first]] : [[", first", first], [", fresh", fresh]];
    return both.filter(([, found]) => found.length).map(([suffix, found]) => ({ name, title: `${title}${suffix}`, found, whole: found.reduce((sum, one) => sum + one.value, 0) }));
  });
}

function showParts() {
  const rows = partRows(), most = Math.max(...rows.map((one) => one.whole)), known = new Set(rows.flatMap(({ found }) => found.map((one) => one.part)));
  byId("parts").hidden = !rows.length;
  if (!rows.length) return;
  const shown = DATA.parts.filter((one) => known.has(one.name));
  const bar = ({ found, title, whole }) => {
    let x = 0;
    return draw("svg", { class: "parts", viewBox: "0 0 100 6", preserveAspectRatio: "none", role: "img", "aria-label": `${title}: ${asText(whole, "ms")}` },
      ...shown.map(({ name }) => {
        const width = 100 * (found.find((one) => one.part === name)?.value ?? 0) / most, from = x;
        x += width;
        return draw("rect", { class: partClass(name), x: from, y: 0, width, height: 6 }, draw("title", {}, partTitle(name)));
      }));
  };
  byId("part-bars").replaceChildren(...rows.map((row) => make("div", { class: "part-row" }, make("span", {}, row.title), bar(row))), partKeys(known));
  table(byId("part-table"), null, ["", ...shown.map((one) => one.title), "all"], rows.map(({ title, found, whole }) => [title,
    ...shown.map(({ name }) => { const value = found.find((one) => one.part === name)?.value; return make("td", { class: "number" }, value ? asText(value, "ms") : ""); }),
    make("td", { class: "number" }, asText(whole, "ms"))]));
}

// The steps of a frame to its fresh result, or to the first answer if no fresh one came.
function stepsTo(run, { steps }, id) {
  const rows = steps?.of_frame.get(id) ?? [], kind = (row) => run.whichs[steps.which[row]];
  const fresh = rows.filter((row) => ["fresh", "both"].includes(kind(row)));
  const which = fresh.length ? fresh : rows.filter((row) => kind(row) === "first");
  let t = 0;
  return which.map((row) => {
    const took = steps.took_ns[row], from = t;
    t += took;
    return { part: DATA.parts[steps.part[row]].name, place: run.names[steps.place[row]], from, took, which: kind(row) };
  });
}
function partsOfFrame(run, method, id) {
  const steps = stepsTo(run, method, id), number = (ns) => make("td", { class: "number" }, `${(ns / 1e6).toFixed(6)} ms`);
  if (!steps.length) return [];
  const whole = steps.reduce((sum, one) => sum + one.took, 0), node = make("table");
  table(node, `Where its time went, to the ${steps[0].which === "first" ? "first answer" : "fresh result"}`, ["step", "at", "from", "took"],
    [...steps.map((one) => [make("span", { class: "key" }, draw("svg", { width: 12, height: 12, "aria-hidden": "true" },
      draw("rect", { class: partClass(one.part), x: 1, y: 1, width: 10, height: 10 })), partTitle(one.part)), one.place, number(one.from), number(one.took)]),
    ["all", "", "", number(whole)]]);
  return [make("div", { class: "scroll" }, node)];
}
