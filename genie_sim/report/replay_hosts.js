// What cars and edges have to do under one method: a bar for the accelerator, a block for each message that waits.

const BLOCK_PX = 8;   // a waiting message
const LOST_PX = 70;   // a column that has room for the word

function hostsView(run, canvas, options) {
  const names = [...run.cars, ...run.about.edges].map((host) => host.name)
    .filter((name) => run.methods.some((method) => method.hosts.has(name)));
  canvas.parentElement.hidden = !names.length;

  function paint(t) {
    const { pen, width } = prepareCanvas(canvas), look = looks(), column = width / Math.max(names.length, 1);
    pen.font = "11.5px system-ui, sans-serif";
    pen.textAlign = "left";
    const texts = names.map((name, place) => {
      const host = options.method().hosts.get(name), sample = host ? lastUpTo(host.t, t) : -1;
      drawHost(pen, look, { name, left: place * column + 4, column, busy: 0, waiting: 0, lost: 0,
        ...(sample < 0 ? {} : { busy: host.busy[sample] / 1000, waiting: host.waiting[sample], lost: host.lost[sample] }) });
      return sample < 0 ? "" : `${name} busy ${percent(host.busy[sample] / 1000)}, ${host.waiting[sample]} waiting, ${host.lost[sample]} lost`;
    });
    canvas.setAttribute("aria-label", `Under ${options.method().title}: ${texts.filter(Boolean).join("; ")}`);
  }

  function drawHost(pen, look, { name, left, column, busy, waiting, lost }) {
    const breadth = column - 12;
    pen.fillStyle = look.ink;
    pen.fillText(name, left, 12, breadth);
    pen.fillStyle = look.line;
    pen.fillRect(left, 17, breadth, 7);
    pen.fillStyle = look.car;
    pen.fillRect(left, 17, breadth * Math.min(busy, 1), 7);
    const room = Math.max(Math.floor(breadth / (BLOCK_PX + 2)), 1);
    pen.fillStyle = look.miss;
    for (let block = 0; block < Math.min(waiting, room); block += 1) pen.fillRect(left + block * (BLOCK_PX + 2), 29, BLOCK_PX, BLOCK_PX);
    pen.strokeStyle = look.line;
    pen.lineWidth = 1;
    if (!waiting) pen.strokeRect(left + 0.5, 29.5, BLOCK_PX - 1, BLOCK_PX - 1);
    pen.fillStyle = lost ? look.ghost : look.muted;
    pen.fillText(column < LOST_PX ? `${lost}` : `lost ${lost}`, left, 51, breadth);
  }
  return paint;
}
