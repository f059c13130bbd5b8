// Canvases, and the marks on them. Outcomes differ in shape as well as in colour.

import { colour } from "./replay_elements.js";
import { isFalse } from "./replay_model.js";

const TONES = ["ink", "muted", "line", "bg", "road", "hit", "miss", "coalesced", "none", "car", "false"];

// An empty canvas: its pen, its size [px], and the look, which is the page's colours by their names.
export function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1,
    { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { pen, width, height, look: Object.fromEntries(TONES.map((name) => [name, colour(name)])) };
}

export function drawLine(pen, from, to, strokeStyle, lineWidth, globalAlpha = 1) {
  Object.assign(pen, { strokeStyle, lineWidth, globalAlpha });
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.stroke();
  pen.globalAlpha = 1;
}
export function drawLabel(pen, look, text, x, y, tone) {
  Object.assign(pen, { textAlign: "center", lineWidth: 3, strokeStyle: look.bg, fillStyle: tone });
  pen.strokeText(text, x, y);
  pen.fillText(text, x, y);
}
// A hit is a disc, a miss a ring, a coalesced request a square.
export function drawOutcome(pen, look, outcome, x, y, size) {
  pen.fillStyle = pen.strokeStyle = look[outcome];
  pen.lineWidth = 1.1;
  pen.beginPath();
  if (outcome === "coalesced") pen.rect(x - size, y - size, 2 * size, 2 * size);
  else pen.arc(x, y, size, 0, 2 * Math.PI);
  if (outcome === "hit" || outcome === "coalesced") pen.fill();
  else pen.stroke();
}
export function drawRing(pen, look, outcome, x, y, radius, alpha) {
  pen.globalAlpha = alpha * (outcome === "hit" ? 0.55 : 1);
  pen.fillStyle = pen.strokeStyle = look[outcome];
  pen.lineWidth = 3;
  pen.setLineDash(outcome === "coalesced" ? [4, 6] : []);
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  if (outcome === "hit") pen.fill();
  else pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}
// What is held: a filled triangle where it is there, a cross where it is not; a hollow triangle is missed.
export function drawHeld(pen, look, object, x, y) {
  const shape = new Path2D(isFalse(object) ? "M-4.4 -4.4L4.4 4.4M-4.4 4.4L4.4 -4.4" : "M0 -5L5 4L-5 4Z");
  pen.save();
  pen.translate(x, y);
  for (const [strokeStyle, lineWidth] of [
    [look.bg, 4.6],
    [isFalse(object) ? look.false : look.hit, 2],
  ]) {
    Object.assign(pen, { strokeStyle, lineWidth });
    pen.stroke(shape);
  }
  pen.fillStyle = object.judged === "right" ? look.hit : look.bg;
  if (!isFalse(object)) pen.fill(shape);
  pen.restore();
}
