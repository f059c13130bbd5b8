// The page of an evaluation, from its data.

const verdictClass = (verdict) => `verdict v${DATA.verdicts.indexOf(verdict)}`;
const kindText = (claim) => (claim.kind.includes("input") ? ` (${claim.kind})` : "");

function showVerdicts() {
  byId("sentences").replaceChildren(...DATA.sentences.map((text) => make("p", {}, text)));
  byId("kinds").textContent = `Kinds: ${Object.entries(DATA.kinds).map(([kind, meaning]) => `${kind}, ${meaning}`).join("; ")}.`;
  byId("kind").replaceChildren(option("", "all"), ...Object.keys(DATA.kinds).map((kind) => option(kind, kind)));
  const hidden = new Set(), count = (verdict) => DATA.claims.filter((claim) => claim.verdict === verdict).length;
  const used = DATA.verdicts.filter(count);
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
  const render = () => {
    const asked = byId("search").value.toLowerCase().split(/\s+/).filter(Boolean), kind = byId("kind").value;
    const shown = DATA.claims.filter((claim) => !hidden.has(claim.verdict) && (!kind || claim.kind === kind)
      && asked.every((word) => `${claim.id} ${claim.section} ${claim.claim} ${claim.test}`.toLowerCase().includes(word)));
    table(byId("claims"), null, ["", "the paper says", "the paper", "here", "verdict", "why"], []);
    byId("claims").tBodies[0].replaceChildren(...shown.map(claimRow));
    byId("count").textContent = `${shown.length} of ${DATA.claims.length}`;
  };
  for (const id of ["kind", "search"]) byId(id).addEventListener("input", render);
  render();
}

function claimRow(claim) {
  const opener = make("button", { type: "button", class: "open", "aria-expanded": "false" }, claim.id);
  const row = make("tr", { class: "claim", id: claim.id }, make("th", { scope: "row" }, opener),
    make("td", {}, claim.claim + kindText(claim)), make("td", { class: "number" }, claim.paper),
    make("td", {}, claim.found, make("small", { class: "found" }, claim.ours)),
    make("td", {}, make("span", { class: verdictClass(claim.verdict) }, claim.said)), make("td", {}, claim.reason));
  const facts = [["Paper", claim.where], ["Section", claim.section], ["Kind", `${claim.kind}: ${DATA.kinds[claim.kind]}`], ["Test", claim.test],
    ["Shown by", make("code", {}, claim.command)], ["Minutes", String(claim.minutes)]];
  const evidence = () => make("tr", { class: "evidence" }, make("td", { colspan: 6 },
    make("dl", {}, ...facts.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value))))));
  const open = () => {
    const now = opener.getAttribute("aria-expanded") !== "true";
    opener.setAttribute("aria-expanded", String(now));
    if (now) row.after(evidence());
    else row.nextElementSibling.remove();
  };
  row.addEventListener("click", () => { if (!String(window.getSelection())) open(); });
  return row;
}

showVerdicts();
byId("figure-list").replaceChildren(...DATA.figures.map(({ name, title, source }) => make("figure", { class: "wide" },
  make("div", { class: "scroll", role: "group", "aria-label": title }, make("img", { src: source, alt: title })), make("figcaption", {}, `${title}: figures/${name}.svg`))));
table(byId("accuracy-table"), null, DATA.accuracy[0], DATA.accuracy.slice(1));
filteredTable("number", ["scenario", "number", "mean", "low", "high"],
  DATA.numbers.map((row) => row.map((cell) => (cell === null ? "" : typeof cell === "number" ? digits(cell, 4) : cell))), 2);
showFrame("an evaluation", { evaluation: ABOUT.quick ? "quick" : "full", seeds: ABOUT.seeds.length, claims: DATA.claims.length },
  "numbers.parquet. Versions and digests are in run.json beside this page.");
