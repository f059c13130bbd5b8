// Where two methods differ: how many of the objects that cars hold or should hold are wrong or missed under each, over
// time, and the moments at which these numbers lie farthest apart. Where the truth is not known, the age of the cars' newest answers.

const SAMPLES = 600;
const MOST_MOMENTS = 8;
const DASHES = [5, 3]; // of the right method's line
const APART = 1 / 20; // of the time that is shown, between two moments

const sampleAt = (run, i) => run.begin_us + i / SAMPLES * Math.max(run.compared_until_us - run.begin_us, 1);

function samplesOf(run, method) {
  const at = Array.from({ length: SAMPLES + 1 }, (_, i) => sampleAt(run, i));
  return run.judges ? at.map(wrongCounter(run, method)) : at.map((t) => meanAge(run, method, t));
}

// A function of ascending instants: how many objects are held but not there, or missed, at each.
function wrongCounter(run, { beliefs }) {
  const changes = [];
  beliefs.begin.forEach((begin, row) => {
    if (run.judged[beliefs.judged[row]] === "right") return;
    changes.push([begin, 1]);
    if (beliefs.took_us[row] >= 0) changes.push([begin + beliefs.took_us[row], -1]);
  });
  changes.sort((a, b) => a[0] - b[0]);
  let next = 0, count = 0;
  return (t) => {
    for (; next < changes.length && changes[next][0] <= t; next += 1) count += changes[next][1];
    return count;
  };
}

// Seconds, over the cars; a car that holds nothing has waited since the replay began.
function meanAge(run, method, t) {
  const ages = run.cars.map((_, place) => holding(run, method, place, t)?.age ?? t - run.begin_us);
  return ages.reduce((sum, age) => sum + age, 0) / Math.max(ages.length, 1) / 1e6;
}

// The samples at which two methods differ most, the greatest difference first.
function momentsOf(run, [left, right]) {
  const differences = left.samples.map((value, i) => Math.abs(value - right.samples[i])), moments = [];
  const order = differences.map((_, i) => i).sort((a, b) => differences[b] - differences[a] || a - b);
  for (const i of order) {
    if (moments.length === MOST_MOMENTS || differences[i] === 0) break;
    if (moments.every((other) => Math.abs(other - i) >= APART * SAMPLES)) moments.push(i);
  }
  return moments.map((i) => ({ t: sampleAt(run, i), values: [left.samples[i], right.samples[i]] }));
}

const wrongText = (run, value) => (run.judges ? `${value} wrong or missed` : `${value.toFixed(2)} s old`);
const momentText = (run, moment, methods) => `${(moment.t / 1e6).toFixed(2)} s: ${methods.map((method, i) => `${method.title} ${wrongText(run, moment.values[i])}`).join(", ")}`;

function differenceView(run, canvas, options) {
  const margin = 6, foot = 50;
  const across = (t, width) => margin + (t - run.begin_us) / Math.max(run.end_us - run.begin_us, 1) * (width - 2 * margin);

  function paint(t) {
    const { pen, width } = prepareCanvas(canvas), look = looks(), methods = options.pair();
    const most = Math.max(...methods.flatMap(({ samples }) => samples), 1e-9), up = (value) => foot - value / most * (foot - 10);
    pen.font = "11.5px system-ui, sans-serif";
    line(pen, [margin, foot], [width - margin, foot], look.line, 1, 1);
    methods.forEach(({ name, samples }, side) => {
      pen.setLineDash(side ? DASHES : []);
      pen.strokeStyle = colour(`method-${lookOf(name) % DATA.palette}`);
      pen.lineWidth = 1.6;
      pen.beginPath();
      samples.forEach((value, i) => pen.lineTo(across(sampleAt(run, i), width), up(value)));
      pen.stroke();
    });
    pen.setLineDash([]);
    pen.fillStyle = look.ink;
    for (const moment of options.moments()) {
      const x = across(moment.t, width);
      pen.beginPath(); pen.moveTo(x, foot + 2); pen.lineTo(x - 4, foot + 9); pen.lineTo(x + 4, foot + 9); pen.fill();
    }
    line(pen, [across(t, width), 0], [across(t, width), foot], look.ink, 1.2, 1);
    pen.textAlign = "left";
    pen.lineWidth = 3;
    pen.strokeStyle = look.bg;
    const top = run.judges ? `${Math.round(most)}` : `${most.toFixed(1)} s`;
    pen.strokeText(top, margin, 11);
    pen.fillStyle = look.muted;
    pen.fillText(top, margin, 11);
  }
  canvas.addEventListener("click", (event) => {
    const x = event.clientX - canvas.getBoundingClientRect().left;
    options.moveTo(run.begin_us + (x - margin) / (canvas.clientWidth - 2 * margin) * (run.end_us - run.begin_us));
  });
  return paint;
}
