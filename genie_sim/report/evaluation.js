// The page of an evaluation, from its data.

const FIGURES = new Map(DATA.figures.map((one) => [one.name, one]));
const KINDS = {
  input: "true by construction: it was put in, or what was put in leaves no other outcome", near_input: "follows closely from what was put in",
  calibrated: "one of the two numbers that two parameters were fitted to", prediction: "the simulator could have contradicted it",
  retrodicted: "the simulator could have contradicted it, but outcomes were in sight when the reading was chosen",
  invariant: "must hold in every run", table: "arithmetic on the paper's own table",
};
const READINGS = DATA.readings.map((one) => one.name);
const COLUMNS = new Map(DATA.readings.map((one) => [one.name, words(one.name) + (one.retrodicted ? ", retrodicted" : "")]));
const verdictClass = (verdict) => `verdict v${DATA.verdicts.indexOf(verdict)}`;
const foundText = (one) => (value) => (one.unit === "1" ? digits(value) : `${digits(value)} ${one.unit}`);
const scenarioText = (name) => ({ case_study: "case study", all: "all" })[name] || name.replace(/^(\d)car_/, (_, n) => `${n} car${n > 1 ? "s" : ""}, `).replace(/(hetero|homo)$/, "$1.");

function picture(name) {
  const found = FIGURES.get(name);
  return found ? make("figure", { class: "wide" }, make("div", { class: "scroll", role: "group", "aria-label": found.title }, make("img", { src: found.source, alt: found.title })), make("figcaption", {}, `${found.title}: figures/${name}.svg`)) : null;
}

function showAbout() {
  showFrame("an evaluation", { evaluation: ABOUT.quick ? "quick" : "full", seeds: ABOUT.seeds.length, readings: READINGS.map(words).join(", "), claims: DATA.claims.length },
  `traces with the digest ${ABOUT.trace.slice(0, 12)}. Versions and digests are in run.json beside this page.`);
}

function scale(claim, found) {
  if (!isNumber(found[0]) || claim.kind === "table") return null;
  const asked = claim.tolerance ? claim.expect : claim.bound[1];
  const ends = [...found, asked - claim.tolerance, asked + claim.tolerance].filter(isNumber);
  let low = Math.min(...ends), high = Math.max(...ends);
  const slack = 0.12 * (high - low || Math.abs(high) || 1);
  low -= slack;
  high += slack;
  const at = (value) => (20 + (value - low) / (high - low) * 500).toFixed(1), box = 2 * claim.tolerance > 0;
  const ticks = linearTicks(low, high, 5).map((tick) => draw("text", { x: at(tick), y: 62, "text-anchor": "middle" }, digits(tick, 4)));
  return make("div", { class: "scale" }, draw("svg", { viewBox: "0 0 540 68", role: "img", "aria-label": "What was expected and what was found, on one scale" },
    draw("line", { x1: 20, x2: 520, y1: 46, y2: 46, stroke: "var(--line)" }),
    box ? draw("rect", { x: at(asked - claim.tolerance), y: 16, width: at(asked + claim.tolerance) - at(asked - claim.tolerance), height: 30, fill: "var(--unsure)" }) : null,
    draw("line", { x1: at(asked), x2: at(asked), y1: 16, y2: 46, stroke: "var(--sure)", "stroke-dasharray": "4 3", "stroke-width": 1.5 }),
    draw("text", { x: at(asked), y: 11, "text-anchor": "middle" }, claim.tolerance ? "expected" : expected(claim)),
    isNumber(found[1]) ? draw("line", { x1: at(found[1]), x2: at(found[2]), y1: 31, y2: 31, stroke: "var(--accent)", "stroke-width": 3 }) : null,
    draw("circle", { cx: at(found[0]), cy: 31, r: 5, fill: "var(--accent)" }), ...ticks));
}

function expected(claim) {
  if (claim.kind === "table") return "as printed";
  return claim.tolerance ? `${digits(claim.expect)} \u00b1 ${digits(claim.tolerance)}` : `${claim.bound[0]} ${digits(claim.bound[1])}`;
}

const listed = (items) => make("ul", {}, ...items.map((item) => make("li", {}, item)));
const defined = (facts) => make("dl", {}, ...facts.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))));
const legsText = (one) => one.legs.map((leg) => `${leg.name}: ${leg.held} of ${leg.effects}`).join("; ");
const said = (one) => one.verdict + (one.same_as ? `; the number of ${one.same_as}, counted once` : "") + (one.marginal ? "; marginal: another set of seeds could say otherwise" : "");

function replicated(one) {
  if (one.n === 1) return one.found[1] === null ? "1 value" : "one seed: no interval";
  return `${one.n} seeds`;
}

function finding(claim, name) {
  const one = claim.found[name], by = one.by_run_metrics;
  const facts = [["Verdict", said(one)], ...(one.kind === claim.kind ? [] : [["Kind", `${words(one.kind)}: ${KINDS[one.kind]}`]]),
    ...(one.legs.length ? [["Its parts that hold", legsText(one)]] : []),
    ["Found", isNumber(one.found[0]) ? `${withInterval(one.found, foundText(one))}, ${replicated(one)}` : "not measured"],
    ...(one.note ? [["Note", one.note]] : []), ...(by ? [["By the metrics of a run", `${by.verdict}: ${withInterval(by.found, foundText(one))}`]] : [])];
  return [make("h4", {}, COLUMNS.get(name)), defined(facts), scale(claim, one.found)];
}

function evidence(claim) {
  const facts = [["Paper", claim.where], ...(claim.says.length ? [["Section V", listed(claim.says.map(([part, says]) => `${part}: ${says}`))]] : []),
    ["Kind", `${words(claim.kind)}: ${KINDS[claim.kind] || ""}`], ["Test", claim.test], ["The paper's value", claim.paper],
    ["Expected", expected(claim) === "> 0" ? "each effect above 1 % of the value that it changes; found: the one that decides" : expected(claim)]];
  return [defined(facts), ...READINGS.flatMap((name) => finding(claim, name)), ...claim.figures.map(picture)];
}

function verdictCell(one) {
  const cell = make("td", {}, make("span", { class: verdictClass(one.verdict) }, one.verdict), one.marginal ? make("span", { class: "marginal" }, "marginal") : null);
  if (isNumber(one.found[0])) cell.append(make("small", { class: "found" }, withInterval(one.found, foundText(one))));
  if (one.verdict === "in part") cell.append(make("small", { class: "found" }, legsText(one)));
  return cell;
}

function claimRow(claim) {
  const opener = make("button", { type: "button", class: "open", "aria-expanded": "false" }, claim.id);
  const row = make("tr", { class: "claim", id: claim.id }, make("th", { scope: "row" }, opener), make("td", {}, claim.claim), make("td", {}, words(claim.kind)),
    make("td", { class: "number" }, claim.paper), ...READINGS.map((name) => verdictCell(claim.found[name])));
  const open = () => {
    const now = opener.getAttribute("aria-expanded") !== "true";
    opener.setAttribute("aria-expanded", String(now));
    if (now) row.after(make("tr", { class: "evidence" }, make("td", { colspan: 4 + READINGS.length }, make("div", {}, ...evidence(claim).filter(Boolean)))));
    else row.nextElementSibling.remove();
  };
  row.addEventListener("click", () => { if (!String(window.getSelection())) open(); });
  return row;
}

// How many claims hold under each reading, kind by kind: never a sum over kinds. One number is counted once.
function showCounts() {
  const of = (name) => DATA.claims.map((claim) => claim.found[name]).filter((one) => !one.same_as), reproduced = (one) => one.verdict === DATA.verdicts[0];
  const cell = (ones, holds) => make("td", { class: "number" }, ones.length ? `${ones.filter(holds).length} of ${ones.length}` : "");
  const free = (one) => one.kind === "retrodicted" || one.kind === "prediction";
  const kinds = [...new Set(READINGS.flatMap((name) => of(name).map((one) => one.kind)))].sort((a, b) => free({ kind: b }) - free({ kind: a }));
  const row = (name, chosen, holds) => [name, ...READINGS.map((reading) => cell(of(reading).filter(chosen), holds))];
  const fitted = (one) => reproduced(one) || one.verdict === "calibrated";
  table(byId("counts"), "Claims that hold, by kind", ["", ...COLUMNS.values()], [
    ...kinds.map((kind) => row(words(kind), (one) => one.kind === kind, fitted)),
    ...(READINGS.some((name) => of(name)[0].by_run_metrics) ? [row("retrodicted or prediction, by the metrics of a run", free, (one) => reproduced(one.by_run_metrics || one))] : [])]);
  byId("headline").replaceChildren("Of the claims that the simulator could have contradicted there hold ", ...READINGS.flatMap((name, i) => [i ? "; " : "",
    strong(`${of(name).filter(free).filter(reproduced).length} of ${of(name).filter(free).length}`), ` under ${COLUMNS.get(name)}`]), ". All other kinds are counted apart.");
}

function showVerdicts() {
  const hidden = new Set(), kinds = [...new Set(DATA.claims.map((claim) => claim.kind))];
  byId("reading").replaceChildren(...READINGS.map((name) => option(name, COLUMNS.get(name))));
  byId("kind").replaceChildren(option("", "all"), ...kinds.map((kind) => option(kind, words(kind))));
  byId("kinds").textContent = `Kinds: ${kinds.map((kind) => `${words(kind)}, ${KINDS[kind] || ""}`).join("; ")}.`;
  const under = (claim) => claim.found[byId("reading").value];
  const render = () => {
    const asked = byId("search").value.toLowerCase().split(/\s+/).filter(Boolean), kind = byId("kind").value;
    const shown = DATA.claims.filter((claim) => !hidden.has(under(claim).verdict) && (!kind || claim.kind === kind) && (!byId("marginal").checked || under(claim).marginal)
      && asked.every((word) => `${claim.id} ${claim.claim} ${claim.where} ${claim.test}`.toLowerCase().includes(word)));
    table(byId("claims"), null, ["", "the paper says", "kind", "the paper's value", ...COLUMNS.values()], []);
    byId("claims").tBodies[0].replaceChildren(...shown.map(claimRow));
    byId("count").textContent = `${shown.length} of ${DATA.claims.length}`;
  };
  const choose = () => {
    hidden.clear();
    const count = (verdict) => DATA.claims.filter((claim) => under(claim).verdict === verdict).length, used = DATA.verdicts.filter(count);
    byId("bar").replaceChildren(...used.map((verdict) => {
      const part = make("span", { class: `v${DATA.verdicts.indexOf(verdict)}` });
      part.style.flexGrow = count(verdict);
      return part;
    }));
    byId("verdict-filter").replaceChildren(...used.map((verdict) => make("button", { type: "button", class: verdictClass(verdict), "aria-pressed": "true", onclick: (event) => {
      if (!hidden.delete(verdict)) hidden.add(verdict);
      event.currentTarget.setAttribute("aria-pressed", String(!hidden.has(verdict)));
      render();
    } }, `${verdict} ${count(verdict)}`)));
    render();
  };
  for (const id of ["kind", "marginal", "search"]) byId(id).addEventListener("input", render);
  byId("reading").addEventListener("input", choose);
  choose();
}

function showReadings() {
  byId("reading-list").replaceChildren(...DATA.readings.flatMap((one) => [make("h3", {}, `${words(one.name)}: ${one.title}`), make("p", {}, one.why),
    make("p", { class: "small" }, make("strong", {}, "Known when it was written: "), one.known),
    ...(one.choices.length ? [listed(one.choices.map((choice) => [make("code", {}, choice.set.join(", ")), `: \u201c${choice.quote}\u201d. ${choice.why}`]).map((parts) => make("span", {}, ...parts)))] : []),
    make("p", { class: "small" }, "Settings: ", make("code", {}, one.settings.join(", ") || "none"))]));
  table(byId("meanings"), null, ["", ...READINGS.map(words)], Object.keys(DATA.readings[0].metrics).map((metric) => [words(metric),
    ...DATA.readings.map((one) => make("td", {}, one.metrics[metric].says, make("small", { class: "found" }, one.metrics[metric].why)))]));
}

function showAnswers() {
  const [first, result] = DATA.improvement, titles = (methods) => methods.map((one) => one.title).join(" and ");
  byId("answers-lead").replaceChildren(...(first && result ? [`Mean improvement of ${titles(METHODS.filter((one) => !one.baseline))} over ` +
    `${titles(METHODS.filter((one) => one.baseline))}, six scenarios: `, strong(withInterval(first, percent)),
  " by the first answer, ", strong(withInterval(result, percent)), " by the result."] : []));
  byId("measure").replaceChildren(...DATA.answers.map((one, i) => option(i, one.title)));
  const render = () => {
    const { title, unit, scenarios, methods, ...found } = DATA.answers[Number(byId("measure").value)], text = (value) => asText(value, unit);
    const over = title.startsWith("Improvement") ? "over " : "", names = scenarios.map(scenarioText), format = unit === "1" ? percent : (value) => digits(value);
    const answers = ["first", "result"], named = { first: "first answer", result: "result" };
    byId("answer-charts").replaceChildren();
    const all = answers.flatMap((answer) => methods.flatMap((method) => found[answer][method])).filter((one) => one && isNumber(one[0]));
    const most = Math.max(...all.map((one) => one[2] ?? one[0]), 0) * 1.02;
    for (const answer of answers) {
      const series = methods.map((method) => ({ name: over + methodTitle(method), color: methodClass(method), marker: methodMarker(method), line: false,
        points: found[answer][method].map((one, place) => ({ x: place, found: one })) }));
      intervalChart(byId("answer-charts").appendChild(make("div")), { title: `${title}: ${named[answer]}`, series,
        x: { names, label: "scenario", read: (place) => names[place] }, y: { label: title, log: unit === "ms", format, read: text, most: unit === "1" ? 1 : most } });
    }
    const columns = answers.flatMap((answer) => methods.map((method) => [answer, method]));
    table(byId("answer-table"), `${title}${unit === "ms" ? " [ms]" : ""}`, ["", ...columns.map(([answer, method]) => `${answer}, ${over}${methodTitle(method)}`)],
      scenarios.map((_, i) => [names[i], ...columns.map(([answer, method]) => intervalCell(found[answer][method][i], format))]));
  };
  byId("measure").addEventListener("change", render);
  render();
}

function showWorth() {
  const methods = [...new Set(DATA.worth.map((one) => one.method))], names = [...new Set(DATA.worth.map((one) => one.name))];
  table(byId("worth-table"), null, ["", ...methods.map((method) => (method === DATA.zero_delay.component ? DATA.zero_delay.title : methodTitle(method)))], names.map((name) => {
    const { unit } = DATA.worth.find((row) => row.name === name), text = (value) => asText(value, unit);
    return [metricTitle(name), ...methods.map((method) => {
      const one = DATA.worth.find((row) => row.method === method && row.name === name);
      return intervalCell(one && [one.value, one.low, one.high], text);
    })];
  }));
  const shown = picture("worth");
  if (shown) byId("worth").append(shown);
}

function showFigures() {
  byId("figure-list").replaceChildren(...DATA.figures.filter((one) => one.name !== "worth").flatMap((one) => [make("h3", {}, one.title), picture(one.name)]));
}

function showMetrics() {
  const text = (value) => (value === null ? "" : digits(value, 4));
  filteredTable("metric", ["reading", "scenario", "number", "mean", "low", "high", "seeds"],
    DATA.metrics.map(([reading, scenario, name, value, low, high, n]) => [words(reading), scenario, name, text(value), text(low), text(high), String(n)]), 3);
}

showCounts();
showVerdicts();
showReadings();
showAnswers();
showWorth();
showFigures();
showMetrics();
showAbout();
