// Elements, numbers as text, and the data in the page. Text always goes in as text, never as HTML.

const SVG = "http://www.w3.org/2000/svg";

function filled(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}
export const make = (tag, attributes, ...children) => filled(document.createElement(tag), attributes, children);
export const makeSvg = (tag, attributes, ...children) =>
  filled(document.createElementNS(SVG, tag), attributes, children);
export const byId = (id) => document.getElementById(id);
export const option = (value, text) => make("option", { value }, text);
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

export const msText = (us) => `${us < 0 ? "\u2212" : ""}${(Math.abs(us) / 1000).toFixed(1)} ms`;
export const countText = (objects) => `${objects} object${objects === 1 ? "" : "s"}`;
export function bytesText(bytes) {
  const [unit, name] = bytes >= 1e9 ? [1e9, "GB"] : bytes >= 1e6 ? [1e6, "MB"] : bytes >= 1e3 ? [1e3, "kB"] : [1, "B"];
  return `${Number((bytes / unit).toPrecision(3))} ${name}`;
}

// The data in the page: JSON, compressed.
export async function unpacked(text) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
}
