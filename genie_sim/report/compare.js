// The page of a comparison, from its data: what differs, in which metric by how much.

byId("numbers-about").textContent = DATA.about_rows;
filteredTable("row", DATA.headings, DATA.rows.map(([metric, ...cells]) => [words(metric), ...cells]), DATA.headings.length);
byId("figure-list").replaceChildren(...DATA.figures.map((one) => make("figure", {},
  make("img", { src: one.source, alt: one.title }), make("figcaption", {}, `${one.title}: figures/${one.name}.svg`))));
if (DATA.settings.length) table(byId("differ"), null, ["setting", ...ABOUT.names], DATA.settings);
else byId("same").textContent = "None: the methods of one setting are compared.";
showFrame("a comparison", { arms: ABOUT.arms.join(", ") }, "the result folders that were given. All numbers are in table.csv beside this page.");
