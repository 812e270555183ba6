// What the page is about, and the arrays in it, which are read when they are needed.

const report = JSON.parse(document.getElementById("data").textContent);
const NOTHING = -32768;
const arraysByPlace = new Map();

/** The numbers of a blob, by its place. */
function numbersOf(place) {
  if (!arraysByPlace.has(place)) arraysByPlace.set(place, decoded(report.blobs[place]));
  return arraysByPlace.get(place);
}

function decoded(blob) {
  const [text, offset, scale, isLogarithmic] = blob;
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i += 1) bytes[i] = letters.charCodeAt(i);
  if (offset === undefined) return new Float32Array(bytes.buffer);
  const steps = new Int16Array(bytes.buffer);
  return Float64Array.from(steps, (step) => {
    if (step === NOTHING) return isLogarithmic ? 0 : NaN;
    const value = offset + scale * step;
    return isLogarithmic ? 10 ** value : value;
  });
}

/** The signals of a run: its time and what it has by column, the angles of a vehicle with them; null without any. */
function signalsOf(run) {
  if (!run || !run.track) return null;
  if (!run.signals) {
    const layout = report.layouts[run.track.layout];
    const columns = {};
    run.track.columns.forEach((place, i) => {
      Object.defineProperty(columns, layout.columns[i], { enumerable: true, get: () => numbersOf(place) });
    });
    run.signals = { time: numbersOf(run.track.time), columns, layout, bars: barsOf(run) };
    addAngles(run.signals);
    run.signals.space = inSpace(run.signals);
  }
  return run.signals;
}

/** The timeline of its computers and networks; null for a run without any. */
function barsOf({ bars }) {
  return bars && { rows: bars.rows, row: numbersOf(bars.row), begin: numbersOf(bars.begin), end: numbersOf(bars.end) };
}

/** Roll, pitch and yaw [deg] about the body's axes, from the quaternion; also those of the desired attitude. */
function addAngles(signals) {
  const scene = signals.layout.scene;
  if (!scene) return;
  addAnglesOf(signals, scene.quaternion, "");
  if (scene.desired) addAnglesOf(signals, scene.desired, " of the reference");
}

function addAnglesOf(signals, quaternion, suffix) {
  const [x, y, z, w] = quaternion.map((name) => signals.columns[name]);
  const degrees = (make) => Float64Array.from(x, (_, i) => (180 / Math.PI) * make(x[i], y[i], z[i], w[i]));
  signals.columns[`roll${suffix}`] = degrees((a, b, c, d) => Math.atan2(2 * (d * a + b * c), 1 - 2 * (a * a + b * b)));
  signals.columns[`pitch${suffix}`] = degrees((a, b, c, d) => Math.asin(Math.max(-1, Math.min(1, 2 * (d * b - c * a)))));
  signals.columns[`yaw${suffix}`] = degrees((a, b, c, d) => Math.atan2(2 * (d * c + a * b), 1 - 2 * (b * b + c * c)));
}

/** The columns of the body in space, north-east-down: other axes are converted, as fmu_kit/frames.py does. */
function inSpace({ layout, columns }) {
  const scene = layout.scene;
  if (!scene || !scene.is_enu) return scene;
  const half = Math.SQRT1_2;
  const attitude = ([x, y, z, w]) => [half * (x + y), half * (x - y), half * (w - z), half * (w + z)];
  const turned = (names, turn) => names && names.map((name, k) => {
    const parts = names.map((one) => columns[one]);
    columns[`${name} turned`] = Float64Array.from(parts[0], (_, i) => turn(parts.map((values) => values[i]))[k]);
    return `${name} turned`;
  });
  const place = ([east, north, up]) => [north, east, -up];
  const { position, reference, quaternion, desired } = scene;
  const turns = { position: turned(position, place), reference: turned(reference, place), quaternion: turned(quaternion, attitude), desired: turned(desired, attitude) };
  return { ...scene, ...turns };
}

/** The last place whose time is not after t. */
function placeAt(time, t) {
  let low = 0;
  let high = time.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (time[middle] <= t) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** The value of a column at t, on the line between two rows. */
function valueAt(signals, name, t) {
  const time = signals.time;
  const values = signals.columns[name];
  const i = placeAt(time, t);
  if (i + 1 >= time.length) return values[time.length - 1];
  const share = Math.max(0, (t - time[i]) / (time[i + 1] - time[i]));
  return values[i] + share * (values[i + 1] - values[i]);
}

// -- the table of a study ---------------------------------------------------------------------------------

const columnsByName = new Map((report.table ? report.table.columns : []).map((column) => [column.name, column]));
const axes = [...columnsByName.values()].filter((column) => column.kind === "axis");
const drawable = [...columnsByName.values()].filter((column) => column.kind === "metric" && !column.words);

/** The value of a column in a row: a number, a word, or NaN. */
function cellOf(column, row) {
  const value = numbersOf(column.values)[row];
  return column.words ? column.words[value] : value;
}

function outcomeOf(row) {
  return cellOf(columnsByName.get("outcome"), row);
}

/** good, bad or diverged; failed runs are bad. */
function kindOf(outcome) {
  if (outcome === report.words[0]) return "good";
  return outcome === "diverged" ? "diverged" : "bad";
}

/** The run of a row of the table whose signals are in the file; undefined without one. */
function runOfRow(row) {
  const place = report.table.tracks[row];
  return place === undefined ? undefined : report.runs[place];
}
