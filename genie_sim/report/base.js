// What every page shares: its data, elements, numbers as text, tables, header and navigation.
// Text always goes in as text, never as HTML.

const SVG = "http://www.w3.org/2000/svg";

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}
const make = (tag, attributes, ...children) => fill(document.createElement(tag), attributes, children);
const draw = (tag, attributes, ...children) => fill(document.createElementNS(SVG, tag), attributes, children);
const byId = (id) => document.getElementById(id);
const option = (value, text) => make("option", { value }, text);
const strong = (text) => make("b", {}, text);
const words = (name) => name.replaceAll("_", " ");
const sentence = (text) => text[0].toUpperCase() + text.slice(1);
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

const DATA = JSON.parse(byId("data").textContent);
const ABOUT = DATA.about;

// Methods are in the order in which they were given; each has the number of its colour, line and marker, as in figures.
const METHODS = DATA.methods;
const placeOf = (method) => METHODS.findIndex((one) => one.name === method);
const methodTitle = (method) => METHODS[placeOf(method)]?.title ?? method;
const lookOf = (method) => METHODS[placeOf(method)]?.look ?? 0;
const methodClass = (method) => `m${lookOf(method) % DATA.lines}`;
const methodKey = (method) => make("span", { class: "key" }, draw("svg", { width: 22, height: 8, class: methodClass(method), "aria-hidden": "true" },
  draw("path", { d: "M0 4H22" })), methodTitle(method));
const placementText = (placement) => ({ car: "on cars", edge: "on edges" })[placement] || placement;

// What is said of a metric, the same on every page; of one that is not registered, its name.
const infoOf = (metric) => DATA.metric_info?.[metric] ?? { title: words(metric), unit: "", better: "", meaning: "" };
const metricTitle = (metric) => sentence(infoOf(metric).title);
const isShare = (metric) => infoOf(metric).unit === "%";

function digits(value, count = 3) {
  if (value === 0) return "0";
  const places = Math.max(0, count - 1 - Math.floor(Math.log10(Math.abs(value))));
  return value.toLocaleString("en", { maximumFractionDigits: Math.min(places, 8) });
}
function asText(value, unit) {
  if (value === null) return "none";
  if (unit === "1") return percent(value);
  if (unit === "B") return bytes(value);
  if (unit === "ms" && Math.abs(value) >= 10000) return `${digits(value / 1000)} s`;
  return unit ? `${digits(value)} ${value === 1 ? unit.replace(/^([a-z]{4,})s$/, "$1") : unit}` : digits(value);
}
const percent = (share) => `${digits(100 * share)} %`;
function bytes(value) {
  const step = value >= 1e9 ? [1e9, "GB"] : value >= 1e6 ? [1e6, "MB"] : value >= 1e3 ? [1e3, "kB"] : [1, "B"];
  return `${digits(value / step[0])} ${step[1]}`;
}

// The index of the last value that is not above `x`, or -1.
function lastUpTo(values, x) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= x) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

function table(node, caption, head, rows) {
  node.replaceChildren(
    ...(caption ? [make("caption", {}, caption)] : []),
    make("thead", {}, make("tr", {}, ...head.map((text) => (text === "" ? make("td") : make("th", { scope: "col" }, text))))),
    make("tbody", {}, ...rows.map(([first, ...cells]) => make("tr", {}, make("th", { scope: "row" }, first),
      ...cells.map((cell) => cell instanceof Node ? cell : make("td", {}, cell))))));
}

// A table with a search field: a row stays if it holds every word. `columns` count from the left.
function filteredTable(name, head, rows, columns) {
  const render = () => {
    const asked = byId(`${name}-filter`).value.toLowerCase().split(/\s+/).filter(Boolean);
    const kept = rows.filter((row) => { const text = row.slice(0, columns).map((cell) => cell.textContent ?? cell).join(" ").toLowerCase(); return asked.every((word) => text.includes(word)); });
    byId(`${name}-count`).textContent = `${kept.length} of ${rows.length}`;
    table(byId(`${name}-table`), null, head, kept);
  };
  byId(`${name}-filter`).addEventListener("input", render);
  render();
}

// The head and the foot of the page, links to every section that is not hidden; makes scrollable boxes focusable. Call it last.
function showFrame(what, facts, origin) {
  byId("kicker").textContent = `genie-sim ${ABOUT.genie_sim}, ${what}`;
  byId("name").textContent = ABOUT.name;
  byId("description").textContent = ABOUT.description;
  byId("warning").textContent = ABOUT.warning ?? "";
  byId("warning").hidden = !ABOUT.warning;
  byId("about").replaceChildren(...Object.entries(facts).map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, String(value)))));
  byId("notes").replaceChildren(...[...DATA.notes, `Made by genie-sim ${ABOUT.genie_sim} from ${origin}`].map((note) => make("li", {}, note)));
  const shown = [...document.querySelectorAll("main section")].filter((section) => !section.hidden);
  byId("sections").replaceChildren(...shown.map((section) => make("a", { href: `#${section.id}` }, section.dataset.nav)));
  for (const box of document.querySelectorAll(".scroll:not([tabindex])")) {
    new ResizeObserver(() => { box.tabIndex = box.scrollWidth > box.clientWidth ? 0 : -1; }).observe(box);
  }
}
