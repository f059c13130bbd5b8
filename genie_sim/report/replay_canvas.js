// Pens and marks of the replay's canvases. Outcomes differ in shape as well as in colour.
// Uses replay_elements.js, replay_model.js.

function prepareCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1,
    { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { pen, width, height };
}

const TONES = ["ink", "muted", "line", "bg", "road", "hit", "miss", "coalesced", "none", "car", "ghost"];
const looks = () => Object.fromEntries(TONES.map((name) => [name, colour(name)]));

function line(pen, from, to, tone, breadth, alpha) {
  pen.globalAlpha = alpha;
  pen.strokeStyle = tone;
  pen.lineWidth = breadth;
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.stroke();
  pen.globalAlpha = 1;
}
function label(pen, look, text, x, y, tone) {
  pen.textAlign = "center";
  pen.lineWidth = 3;
  pen.strokeStyle = look.bg;
  pen.strokeText(text, x, y);
  pen.fillStyle = tone;
  pen.fillText(text, x, y);
}
// Outcomes differ in shape too: a hit is a disc, a miss a ring, a coalesced request a square.
function mark(pen, look, outcome, x, y, size) {
  pen.fillStyle = pen.strokeStyle = look[outcome];
  pen.lineWidth = 1.1;
  pen.beginPath();
  if (outcome === "coalesced") pen.rect(x - size, y - size, 2 * size, 2 * size);
  else pen.arc(x, y, size, 0, 2 * Math.PI);
  if (outcome === "hit" || outcome === "coalesced") pen.fill();
  else pen.stroke();
}
function ring(pen, look, outcome, x, y, radius, alpha) {
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
// What is held: a filled triangle where it is there, a cross where it is not (a ghost); a hollow triangle is missed.
function heldMark(pen, look, object, x, y) {
  const shape = new Path2D(isGhost(object) ? "M-4.4 -4.4L4.4 4.4M-4.4 4.4L4.4 -4.4" : "M0 -5L5 4L-5 4Z");
  const tone = isGhost(object) ? look.ghost : look.hit;
  pen.save();
  pen.translate(x, y);
  for (const [strokeStyle, lineWidth] of [
    [look.bg, 4.6],
    [tone, 2],
  ]) {
    Object.assign(pen, { strokeStyle, lineWidth });
    pen.stroke(shape);
  }
  pen.fillStyle = object.judged === "right" ? look.hit : look.bg;
  if (!isGhost(object)) pen.fill(shape);
  pen.restore();
}
