// Pens and marks of the replay's canvases. Outcomes differ in shape as well as in colour.

function prepareCanvas(canvas) {
  const ratio = window.devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { pen, width, height };
}

const looks = () => Object.fromEntries(["ink", "muted", "line", "bg", "soft", "road", "hit", "miss", "coalesced", "none", "car", "ghost"]
  .map((name) => [name, colour(name)]));

function line(pen, from, to, tone, breadth, alpha) {
  pen.globalAlpha = alpha;
  pen.strokeStyle = tone;
  pen.lineWidth = breadth;
  pen.beginPath();
  pen.moveTo(...from); pen.lineTo(...to);
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
  if (outcome === "hit" || outcome === "coalesced") pen.fill(); else pen.stroke();
}
function ring(pen, look, outcome, x, y, radius, alpha) {
  pen.globalAlpha = alpha * (outcome === "hit" ? 0.55 : 1);
  pen.fillStyle = pen.strokeStyle = look[outcome];
  pen.lineWidth = 3;
  pen.setLineDash(outcome === "coalesced" ? [4, 6] : []);
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  if (outcome === "hit") pen.fill(); else pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}
// What is held: a filled triangle where it is there, a cross where it is not (a ghost); a hollow triangle is missed.
function beliefMark(pen, look, one, x, y) {
  const strokes = [[look.bg, 4.6], [isGhost(one) ? look.ghost : look.hit, 2]], size = isGhost(one) ? 4.4 : 5;
  pen.beginPath();
  if (isGhost(one)) { pen.moveTo(x - size, y - size); pen.lineTo(x + size, y + size); pen.moveTo(x - size, y + size); pen.lineTo(x + size, y - size); }
  else { pen.moveTo(x, y - size); pen.lineTo(x + size, y + 0.8 * size); pen.lineTo(x - size, y + 0.8 * size); pen.closePath(); }
  for (const [tone, breadth] of strokes) { pen.strokeStyle = tone; pen.lineWidth = breadth; pen.stroke(); }
  if (isGhost(one)) return;
  pen.fillStyle = one.judged === "right" ? look.hit : look.bg;
  pen.fill();
}
