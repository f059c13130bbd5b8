// The page of a comparison, or of runs with several seeds, from its data: what differs, in which metric by how much.

const list = (node, items) => node.replaceChildren(...items.map((item) => make("li", {}, item)));

byId("verdict").hidden = !DATA.verdicts.length;
list(byId("verdict-list"), DATA.verdicts);
byId("means").hidden = !DATA.means;
if (DATA.means) {
  byId("means-about").textContent = DATA.means.note;
  table(byId("means-table"), null, DATA.means.headings, DATA.means.rows);
}
byId("figure-list").replaceChildren(...DATA.figures.map((one) => make("figure", { class: one.wide ? "wide" : null },
  make("div", { class: "scroll", role: "group", "aria-label": one.title }, make("img", { src: one.source, alt: one.title })), make("figcaption", {}, one.title))));
byId("numbers").hidden = !DATA.rows.length;
byId("numbers-about").textContent = DATA.about_rows;
filteredTable("row", DATA.headings, DATA.rows, DATA.headings.length);
if (DATA.settings.length) table(byId("differ"), null, ["setting", ...ABOUT.names], DATA.settings);
else byId("same").textContent = "None: the methods of one setting are compared.";
byId("settings").hidden = Boolean(DATA.means);
byId("runs").hidden = !DATA.runs.length;
list(byId("run-list"), DATA.runs.map(([name, id, page]) => make("a", { href: page }, `${name}, run ${id}`)));
showFrame(DATA.means ? "a run with several seeds" : "a comparison", { arms: ABOUT.arms.join(", "), ...(ABOUT.seeds ? { seeds: ABOUT.seeds.replace(/^seeds? /, "") } : {}) }, DATA.origin);
