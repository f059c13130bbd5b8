// The replay in words and in tables: what each car holds, the ghosts, and what the marks mean.

const TABLE_CARS = 12, TABLE_GHOSTS = 20;

// What each car holds at this instant under each method: also the canvases' text alternative.
function showNow(run, t) {
  const cars = run.cars.slice(0, TABLE_CARS);
  table(byId("now"), null, ["", ...run.methods.map((one) => methodKey(one.name))], cars.map((car, place) => [car.name, ...run.methods.map((method) => {
    const held = holding(run, method, place, t);
    if (held === null) return make("td", {}, "nothing yet");
    return make("td", {}, countOf(held.objects), ghosts(method.judged[place], t), make("small", {}, `answer ${held.age < 1e6 ? `${Math.round(held.age / 1000)} ms` : `${(held.age / 1e6).toFixed(1)} s`} old`),
      make("small", {}, `${held.source === "map" ? "object map" : words(held.source)}${held.fresh ? ", fresh" : ""}`));
  })]));
  const truth = run.methods.some((one) => one.judged.some(Boolean)) ? " False objects: held in its field of view at its last frame, but not there." : "";
  byId("now-about").textContent = `The newest answer: its objects, its age since the picture, its source.${truth}` +
    (cars.length < run.cars.length ? ` The first ${cars.length} of ${run.cars.length} cars.` : "");
}

// Where the truth is known: how many of the objects that a consumer holds in its field of view are not there.
function ghosts(judged, t) {
  const i = judged ? lastUpTo(judged.t, t) : -1;
  return i < 0 ? null : make("small", { class: judged.held[i] > judged.right[i] ? "o-ghost" : "o-hit" }, `${judged.held[i] - judged.right[i]} of ${judged.held[i]} in view are false`);
}

// The ghosts on the street, in words.
function showGhosts(run, method, t) {
  const ghosts = believed(run, method, t).filter(isGhost), shown = ghosts.slice(0, TABLE_GHOSTS);
  byId("ghosts").hidden = byId("believed").parentElement.hidden = !method.beliefs.begin.length;
  byId("ghosts-now").textContent = `False objects under ${method.title} now: ${ghosts.length}`;
  table(byId("ghost-table"), null, ["held by", "what", "where [m]", "why it is one", "since"], shown.map((one) => [one.car, one.label,
    `${one.east.toFixed(1)} east, ${one.north.toFixed(1)} north`, GHOSTS[one.judged], `${(one.since / 1e6).toFixed(2)} s`]));
  byId("ghosts-more").textContent = ghosts.length > shown.length ? `and ${ghosts.length - shown.length} more` : "";
}

function showLegend(run, method, mapped) {
  const sign = (text, ...shapes) => make("span", {}, draw("svg", { width: 16, height: 14, "aria-hidden": "true" }, ...shapes), text);
  const disc = (look) => draw("circle", { cx: 8, cy: 7, r: 4.5, ...look }), box = (look) => draw("rect", { x: 3.5, y: 2.5, width: 9, height: 9, ...look });
  const stroke = (tone, broad = 2) => ({ fill: "none", stroke: `var(--${tone})`, "stroke-width": broad }), solid = (tone) => ({ fill: `var(--${tone})` });
  const across = (look) => draw("path", { d: "M0 7H16", ...look });
  byId("legend").replaceChildren(
    sign(method.caches ? "frame on the road: hit" : "frame on the road: answered", disc(solid("hit"))),
    ...(method.caches ? [sign("miss", disc(stroke("miss"))), sign("coalesced: waits for an equal frame", box(solid("coalesced")))] : []),
    sign("no answer", disc(stroke("none"))),
    ...(method.images.length ? [sign("look-up in a car, in the colour of its outcome", disc(stroke("miss", 3))),
      sign("look-up at an edge", across(stroke("hit", 3)), box(solid("hit")))] : []),
    sign("car", draw("rect", { x: 1, y: 4, width: 14, height: 6, rx: 2, ...solid("car") })), sign("its field of view", draw("path", { d: "M1 7L15 1V13Z", opacity: 0.3, ...solid("car") })),
    ...(run.about.edges.length ? [sign("edge: has no place on the street, stands above it", draw("rect", { x: 1, y: 3, width: 14, height: 8, rx: 2, ...stroke("muted", 1.2) })),
      sign("link of a car to its edge", across(stroke("line", 1.5)))] : []),
    sign("message to an edge; small: to a car", draw("circle", { cx: 5, cy: 7, r: 4.5, ...solid("ink") }), draw("circle", { cx: 13, cy: 7, r: 2.5, ...solid("ink") })),
    sign("the chosen frame", draw("circle", { cx: 8, cy: 7, r: 6, ...stroke("ink", 1.5) })),
    ...(method.beliefs.begin.length ? [sign("held and there", draw("path", { d: "M8 2L13 11H3Z", ...solid("hit") })), sign("false: held, but not there", draw("path", { d: "M4 3L12 11M4 11L12 3", ...stroke("ghost") })),
      sign("missed: visible, but not held (dashed in the camera's view)", draw("path", { d: "M8 2L13 11H3Z", ...stroke("hit", 1.5) }))] : []),
    ...(mapped ? [sign("object of high confidence; square: vehicle", box(solid("sure"))), sign("of low confidence; disc: person or cycle", disc(solid("unsure"))),
      sign("below C_T, not shared; diamond: other", draw("path", { d: "M8 2L13 7L8 12L3 7Z", ...stroke("unsure") }))] : []));
  byId("hosts-about").textContent = run.methods.some((entry) => entry.hosts.size) ? "Below each street: the hosts. Bar: share of the last 0.1 s in which the accelerator " +
    "worked; squares: messages that wait in its queues and for its links; lost: messages pushed out or lost so far." : "";
  byId("lanes-about").textContent = "A lane for each method, a row for each car. Height: age of the newest answer since its picture, " +
    `logarithmic, ${AGES_US[0] / 1000} ms or less to ${AGES_US[1] / 1e6} s or more; empty: no answer yet. Vertical line: now. Click to go there.` +
    (run.cars.length > MOST_CARS ? ` The first ${MOST_CARS} of ${run.cars.length} cars.` : "");
  byId("strip-about").textContent = `${method.title}: a cell for each frame, in the colour of its outcome; filled where a fresh result came, ` +
    "framed: the chosen one. Click one, or use the arrow keys.";
}
