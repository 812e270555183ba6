"use strict";
const $ = id => document.getElementById(id), css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const BUCKETS = 600;

// -- workers: the latest value wins --------------------------------------------------------------------------------

/** A worker that answers one question after another. */
class Flier {
  constructor(url, module, system) {
    this.worker = new Worker(url), this.waiting = new Map(), this.next = 0;
    this.ready = new Promise((yes, no) => { this.set = yes, this.fail = no; });
    this.worker.onmessage = ({ data }) => {
      if (data.ready) { this.set(); return; }
      if (data.map) { this.onmap?.(data); return; }
      const [yes, no] = this.waiting.get(data.id) ?? [];
      this.waiting.delete(data.id);
      if (data.error === undefined) yes?.(data.result);
      else no?.(Object.assign(new Error(data.error), { refused: data.refused }));
    };
    this.worker.onerror = event => this.fail(new Error(event.message));
    this.worker.postMessage({ module, system });
  }

  ask(question) {
    return new Promise((yes, no) => { this.waiting.set(++this.next, [yes, no]); this.worker.postMessage({ id: this.next, ...question }); });
  }
}

// -- values ------------------------------------------------------------------------------------------------------------

let system, flier, mappers = [], controls = new Map(), drawing, columns;
const state = {};
/** Values by path of what is drawn beside the run: the law's of a second law under the same clock, and those of a pinned run. */
const beside = { second: null, pinned: null };
/** The runs that are drawn, the present one last. */
let runs = { pinned: null, second: null, flown: null };

/** Three digits that mean something, as decimal text would have them. */
const short = value => Number(Number(value).toPrecision(3));
const withUnit = (text, unit) => unit ? `${text} ${unit.replace(/\./g, "·")}` : text;
const shown = (value, unit) => unit === "s" ? `${+(1000 * value).toPrecision(4)} ms` : withUnit(String(+Number(value).toPrecision(4)), unit);
/** The runs that can be drawn with the names of their colours, the present one last. */
const drawable = () => Object.entries(runs).filter(([, run]) => run && !run.error);

function addControls() {
  const groups = new Map();
  for (const slider of system.sliders) {
    if (!groups.has(slider.group)) {
      const set = document.createElement("fieldset");
      if (slider.group) set.append(Object.assign(document.createElement("legend"), { textContent: slider.group }));
      $("controls").append(set), groups.set(slider.group, set);
    }
    const label = document.createElement("label"), own = range(slider, value => { state[slider.path] = value; }), control = { slider, set: own.set };
    label.append(slider.words, own.output, own.input), label.title = slider.path, groups.get(slider.group).append(label);
    if (ofLaw(slider)) {
      const other = document.createElement("label"), its = range(slider, value => { if (beside.second) beside.second[slider.path] = value; }, "second.");
      its.input.className = its.output.className = "second", other.append("second law", its.output, its.input), other.hidden = true, label.after(other);
      control.setSecond = its.set, control.other = other;
    }
    controls.set(slider.path, control), control.set(slider.value);
  }
  if (system.fixed) $("controls").append(Object.assign(document.createElement("p"), { className: "hint", textContent: system.fixed }));
}

/** The slider of a value, which `put` takes over. */
function range(slider, put, prefix = "") {
  const output = document.createElement("output"), input = document.createElement("input"), steps = slider.whole ? slider.high - slider.low : 1000;
  Object.assign(input, { type: "range", min: 0, max: steps, step: 1, name: prefix + slider.path });
  const up = k => slider.log ? slider.low * (slider.high / slider.low) ** (k / steps) : slider.low + (slider.high - slider.low) * k / steps;
  const down = v => Math.round(steps * (slider.log ? Math.log(v / slider.low) / Math.log(slider.high / slider.low) : (v - slider.low) / (slider.high - slider.low)));
  const set = value => { put(value), input.value = down(value), output.textContent = input.ariaValueText = shown(value, slider.unit); };
  input.addEventListener("input", () => { set(slider.whole ? Math.round(up(+input.value)) : short(up(+input.value))); changed(prefix + slider.path); });
  return { input, output, set };
}

/** Whether a second law may have its own value: it is not of the clock, nor of the world. */
const ofLaw = ({ group, path }) => group ? group === "Law" || group === "Parameters" : /\.parameters\.|^controller\./.test(path);
const ofLaws = () => [...controls.values()].filter(({ slider }) => ofLaw(slider));

/** Put a second law beside the run, with these values; null: none. */
function putSecond(given) {
  beside.second = given && {};
  for (const { slider, setSecond, other } of ofLaws()) other.hidden = !given, given && setSecond(given[slider.path] ?? slider.value);
  $("second").ariaPressed = String(!!given), $("second").textContent = given ? "Remove the second law" : "A second law beside it";
}

function putPin(given) {
  beside.pinned = given, runs.pinned = null;
  $("pin").ariaPressed = String(!!given), $("pin").textContent = given ? "Remove the pin" : "Pin this run";
}

/** The values that differ from those of the request. */
const changes = of => Object.fromEntries(Object.entries(of).filter(([path, value]) => value !== controls.get(path).slider.value));
const values = () => changes(state), ofSecond = () => changes({ ...state, ...beside.second });

function readHash() {
  const given = new URLSearchParams(location.hash.slice(1));
  const read = prefix => ({ slider: { path, value } }) => {
    const text = given.get(prefix + path);
    return [path, text && Number.isFinite(Number(text)) ? Number(text) : value];
  };
  const all = [...controls.values()];
  for (const control of all) control.set(read("")(control)[1]);
  putSecond(given.has("second") ? Object.fromEntries(ofLaws().map(read("second."))) : null);
  putPin(given.has("pinned") ? Object.fromEntries(all.map(read("pinned."))) : null);
}

function writeHash() {
  const words = of => Object.entries(of).map(([path, value]) => `${path}=${value}`);
  const others = Object.entries(beside).filter(([, of]) => of).flatMap(([name, of]) => [name, ...words(changes(of)).map(word => `${name}.${word}`)]);
  const all = [...words(values()), ...others].join("&");
  try { history.replaceState(null, "", all ? `#${all}` : location.pathname + location.search); } catch { /* a page inside another has no address */ }
}

function command(given = values()) {
  const words = ["quadcosim run", ...system.name ? [system.name] : []];
  for (const [path, value] of Object.entries(given)) {
    const [table, ...rest] = path.split("."), flag = rest.join(".").replace(/_/g, "-");
    if (path === "seed" || path === "stop_time") words.push(`--${path.replace("_", "-")} ${value}`);
    else if (table === "timing") words.push(`--${flag} ${value}`);
    else words.push(`--set ${path}=${value}`);
  }
  return words.join(" ");
}

/** The commands of all that is drawn. */
const commands = () => [values(), ...beside.second ? [ofSecond()] : [], ...beside.pinned ? [changes(beside.pinned)] : []].map(command).join("\n");

// -- runs ------------------------------------------------------------------------------------------------------------------

let busy = false, wanted = false;

/** A run, or why there is none. */
async function flown(given) {
  const asked = performance.now(), { panels, ...of } = drawing;
  try {
    const result = await flier.ask({ fly: { values: given, columns, drawing: { ...of, clock: spanOfClock(given) } } });
    return { ...result, latency: performance.now() - asked };
  } catch (error) { return { error }; }
}

/** How long the line of the clock is: some samples of the slowest component. */
function spanOfClock(given) {
  const now = system.settings.map(([, value]) => value);
  for (const [path, value] of Object.entries(given)) for (const i of system.targets[path] ?? []) now[i] = value;
  const periods = now.filter((_, i) => system.settings[i][0].endsWith(".sampling.period"));
  return Math.min(now[0], periods.length ? 30 * Math.max(...periods) : system.span);
}

async function fly() {
  delete document.body.dataset.drawn;
  if (busy) { wanted = true; return; }
  busy = true, wanted = false;
  const { second, pinned } = beside;
  const found = {
    pinned: pinned && (runs.pinned ?? await flown(changes(pinned))), second: second && await flown(ofSecond()),
    flown: await flown(values()),
  };
  busy = false;
  runs = { ...found, pinned: beside.pinned && found.pinned };
  requestAnimationFrame(draw);
  if (wanted) fly();
}

function changed(path) {
  fly(), writeHash();
  if (!system.map || path.startsWith("second.")) return;
  if (system.map.includes(path)) drawMap(); else startMap();
}

function verdict({ error, outcome, divergence_time: time, metrics }) {
  if (error) return [error.refused ? "Not possible" : "Failed", error.message];
  if (outcome === "diverged") return ["diverges", `at ${time.toFixed(2)} s`];
  const settling = metrics.settling_time, measure = system.measure && metrics[system.measure];
  const more = measure === null || measure === undefined ? "" : `${system.measure.replace(/_/g, " ")} ${withUnit(measure.toPrecision(4), system.units[system.measure])}`;
  if (outcome === null) return ["runs to its end", more];
  if (metrics.good && settling !== undefined && settling !== null) return [`settles in ${settling.toFixed(2)} s`, more];
  return [{ settled: "settles", bounded: "survives, does not settle", good: "good", bad: "not good" }[outcome] ?? outcome, more];
}

// -- drawing -----------------------------------------------------------------------------------------------------------------

function context(canvas) {
  const ratio = devicePixelRatio || 1, w = canvas.clientWidth, h = +canvas.dataset.height;
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) canvas.width = Math.round(w * ratio), canvas.height = Math.round(h * ratio), canvas.style.height = `${h}px`;
  const c = canvas.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0), c.clearRect(0, 0, w, h), c.font = "11px system-ui, sans-serif", c.lineWidth = 1;
  return [c, w, h];
}

/** Values of an axis at which it has a line. */
function ticks(low, high, most) {
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find(k => k * power >= raw) * power;
  return Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 }, (_, i) => +((Math.ceil(low / step) + i) * step).toPrecision(12));
}

/** As ticks, of a logarithmic axis. */
function decades(low, high) {
  const all = Array.from({ length: 40 }, (_, i) => 10 ** (Math.floor(i / 2) - 10) * (i % 2 ? 3 : 1)).map(short).filter(v => v >= low && v <= high);
  return all.length > 2 ? all : [low, high];
}

function plot(canvas, panel) {
  const [c, w, h] = context(canvas), left = 52, bottom = 18, some = drawable(), stop = some[some.length - 1][1].metrics.horizon, log = panel.log, f = log ? Math.log10 : x => x;
  const bounded = some.filter(([, run]) => run.outcome !== "diverged"), all = (bounded.length ? bounded : some).flatMap(([, run]) => panel.lines.map(i => run.lines[i]));
  let low = Infinity, high = -Infinity;
  for (const line of all) for (const x of line) if (Number.isFinite(x) && Math.abs(x) < 1e6) low = Math.min(low, x), high = Math.max(high, x);
  if (!(low <= high)) low = 0, high = 1;
  if (log) low = Math.max(low, 1e-5), high = Math.max(high, 10 * low), low = 10 ** Math.floor(Math.log10(low)), high = 10 ** Math.ceil(Math.log10(high));
  else if (high - low < 1e-9 * Math.max(1, Math.abs(high))) low -= .5, high += .5;
  const X = t => left + (w - left - 6) * t / stop, Y = v => Math.max(3, Math.min(h - bottom, h - bottom - (f(Math.max(v, log ? low : v)) - f(low)) / (f(high) - f(low)) * (h - bottom - 6)));
  c.fillStyle = css("--soft"), c.strokeStyle = css("--line"), c.lineWidth = 1, c.beginPath();
  const marks = log ? Array.from({ length: Math.round(Math.log10(high / low)) + 1 }, (_, i) => low * 10 ** i) : ticks(low, high, 4);
  for (const v of marks) c.moveTo(left, Y(v)), c.lineTo(w - 6, Y(v)), c.fillText(log && v < .001 ? v.toExponential(0) : String(+v.toPrecision(3)), 4, Y(v) + 4);
  for (const t of ticks(0, stop, 8)) c.moveTo(X(t), 3), c.lineTo(X(t), h - bottom), c.fillText(String(t), Math.min(X(t) - 4, w - c.measureText(String(t)).width), h - 4);
  c.stroke();
  for (const [name, run] of some) panel.lines.forEach((i, k) => {
    const line = run.lines[i], n = line.length / 2;
    c.strokeStyle = css(`--${name}`), c.lineWidth = 1.4, c.globalAlpha = 1 - .25 * (k % 3), c.setLineDash([[], [6, 3], [2, 2]][k % 3]), c.beginPath();
    for (let b = 0, on = false; b < n; b++) {
      if (Number.isNaN(line[2 * b])) continue;
      const x = X(run.metrics.horizon * (b + .5) / n);
      if (on) c.lineTo(x, Y(line[2 * b + 1])); else c.moveTo(x, Y(line[2 * b + 1]));
      c.lineTo(x, Y(line[2 * b])), on = true;
    }
    c.stroke(), c.setLineDash([]), c.globalAlpha = 1;
  });
}

const view = { turn: -.9, tilt: .42 };

function drawScene() {
  if (!drawing.scene) return;
  $("scene").dataset.height = innerWidth > 700 ? 340 : 200;
  const [c, w, h] = context($("scene")), some = drawable(), points = some[some.length - 1][1].wanted;
  let low = [Infinity, Infinity, Infinity], high = low.map(x => -x);
  for (let i = 0; i < points.length; i++) low[i % 3] = Math.min(low[i % 3], points[i]), high[i % 3] = Math.max(high[i % 3], points[i]);
  const middle = low.map((x, k) => (x + high[k]) / 2), size = Math.max(4, ...high.map((x, k) => x - low[k])), s = Math.min(w, h) / (1.5 * size);
  const [ct, st, cl, sl] = [Math.cos(view.turn), Math.sin(view.turn), Math.cos(view.tilt), Math.sin(view.tilt)];
  const to = (x, y, z) => { const n = x - middle[0], e = y - middle[1], u = middle[2] - z, a = n * ct - e * st, b = n * st + e * ct; return [w / 2 + a * s, h / 2 - (u * cl - b * sl) * s]; };
  const floor = middle[2] + size / 2, r = size * .7;
  c.strokeStyle = css("--line"), c.beginPath();
  for (let i = -4; i <= 4; i++) {
    c.moveTo(...to(middle[0] + i * r / 4, middle[1] - r, floor)), c.lineTo(...to(middle[0] + i * r / 4, middle[1] + r, floor));
    c.moveTo(...to(middle[0] - r, middle[1] + i * r / 4, floor)), c.lineTo(...to(middle[0] + r, middle[1] + i * r / 4, floor));
  }
  c.stroke();
  const line = (p, colour, width, dash = []) => {
    c.strokeStyle = colour, c.lineWidth = width, c.setLineDash(dash), c.beginPath();
    for (let i = 0; i < p.length; i += 3) {
      if (!(Math.abs(p[i]) + Math.abs(p[i + 1]) + Math.abs(p[i + 2]) < 40 * size)) break;
      c.lineTo(...to(p[i], p[i + 1], p[i + 2]));
    }
    c.stroke(), c.setLineDash([]);
  };
  line(points, css("--wanted"), 1.5, [5, 4]);
  for (const [name, run] of some) line(run.path, css(`--${name}`), name === "flown" ? 2 : 1.5), c.fillStyle = css(`--${name}`), c.beginPath(), c.arc(...to(...run.path.slice(0, 3)), 4, 0, 7), c.fill();
  const words = { flown: "this run", second: "second law", pinned: "pinned" };
  [...some.map(([name]) => [words[name], `--${name}`]).reverse(), ["reference", "--wanted"]].forEach(([words, colour], i) => {
    c.fillStyle = css(colour), c.fillRect(8, 13 + 16 * i, 14, 2), c.fillStyle = css("--soft"), c.fillText(words, 28, 18 + 16 * i);
  });
}

function drawClock() {
  const { samples, messages } = runs.flown.clock, sampled = system.sampled, shown = sampled.length ? sampled : [""], canvas = $("clock");
  canvas.dataset.height = 34 + 40 * Math.max(1, shown.length);
  const [c, w, h] = context(canvas), left = 90, until = runs.flown.until, X = t => left + (w - left - 8) * t / until, Y = name => 20 + 40 * Math.max(0, shown.indexOf(name));
  c.fillStyle = css("--soft"), c.strokeStyle = css("--line"), c.beginPath();
  for (const t of ticks(0, until, Math.min(6, (w - left) / 60))) c.moveTo(X(t), 6), c.lineTo(X(t), h - 18), c.fillText(`${+(1000 * t).toPrecision(4)} ms`, X(t) - 12, h - 4);
  for (const name of shown) c.moveTo(left, Y(name)), c.lineTo(w - 8, Y(name)), c.fillText(name.slice(0, 14), 4, Y(name) + 4);
  c.stroke(), c.strokeStyle = css("--flown"), c.lineWidth = 1.3, c.beginPath();
  for (const [t, component] of samples) { const y = Y(system.components[component]); c.moveTo(X(t), y - 9), c.lineTo(X(t), y + 3); }
  c.stroke(), c.strokeStyle = css("--pinned"), c.beginPath();
  for (const [connection, sent, arrival] of messages) {
    const [, sender, receiver] = system.connections[connection], out = sampled.includes(sender), y = Y(out ? sender : receiver), x = X(sent);
    if (arrival < 0) { const z = out ? y + 12 : y - 12; c.moveTo(x - 3, z - 3), c.lineTo(x + 3, z + 3), c.moveTo(x + 3, z - 3), c.lineTo(x - 3, z + 3); }
    else if (out && arrival > sent) c.moveTo(x, y + 3), c.lineTo(X(arrival), y + 20);
  }
  c.stroke();
}

function draw() {
  if (!runs.flown) return;
  const [word, more] = verdict(runs.flown), ok = !runs.flown.error;
  $("word").textContent = word, $("word").className = ok ? runs.flown.outcome ?? "" : "refused", $("numbers").textContent = more;
  $("speed").textContent = ok ? `${runs.flown.rows.toLocaleString("en")} rows in ${runs.flown.flight.toFixed(1)} ms` : "";
  for (const [name, words] of [["second", "second law"], ["pinned", "pinned"]]) {
    $(`${name}verdict`).hidden = !runs[name];
    if (runs[name]) $(`${name}verdict`).textContent = `${words}: ${verdict(runs[name]).join(", ")}`;
  }
  if (drawable().length) drawing.panels.forEach(panel => plot(panel.canvas, panel)), drawScene();
  if (ok) drawClock();
  drawMap();
  if (!busy) document.body.dataset.drawn = "";
}

/** What is drawn: distances from references, then columns by their unit. */
function plan() {
  columns = system.columns;
  const index = new Map(columns.map(([name], i) => [name, i])), seen = new Map(system.seen.map((name, i) => [name, i]));
  drawing = { buckets: BUCKETS, lines: [], panels: [], scene: null };
  const axes = name => ["x", "y", "z"].map(axis => `${name}.${axis}`);
  const source = [...seen.keys()].find(name => name.endsWith(".position.x"))?.replace(/\.x$/, "");
  const owner = system.components.find(name => axes(`${name}.position`).every(each => index.has(each)));
  const add = (title, lines, log = false) => { drawing.panels.push({ title, log, lines: lines.map(line => drawing.lines.push(line) - 1) }); };
  const used = new Set();
  if (source && owner) {
    const of = axes(`${owner}.position`).map(each => index.get(each)), to = axes(source).map(each => seen.get(each));
    drawing.scene = { columns: of, seen: to }, add("Position error [m], logarithmic", [{ columns: of, seen: to }], true);
    system.columns.forEach(([name], i) => { if (!/^plant\.(thrust|torque)/.test(name)) used.add(i); });
  }
  const units = new Map();
  columns.forEach(([name, , , unit], i) => { if (!used.has(i)) { if (!units.has(unit)) units.set(unit, []); units.get(unit).push([name, i]); } });
  const marks = ["━", "╍", "┅", "━"], name = some => some.slice(0, 4).map(([name], k) => system.names[name] + (some.length > 1 ? ` ${marks[k]}` : "")).join(", ");
  for (const [unit, some] of [...units].slice(0, 6)) add(`${name(some)}${some.length > 4 ? " …" : ""}${unit ? ` [${unit.replace(/\./g, "·")}]` : ""}`, some.slice(0, 4).map(([, i]) => ({ column: i })));
  drawing.panels.forEach((panel, i) => {
    const section = document.createElement("section"), canvas = document.createElement("canvas");
    section.append(Object.assign(document.createElement("h2"), { textContent: panel.title }), canvas);
    canvas.dataset.height = 130, canvas.setAttribute("role", "img"), canvas.setAttribute("aria-label", panel.title);
    panel.canvas = canvas, $(drawing.scene || i ? "plots" : "top").append(section);
  });
  $("stage").hidden = !drawing.scene, $("strip").hidden = !system.sampled.length, $("second").hidden = !ofLaws().length;
}

// -- the map ---------------------------------------------------------------------------------------------------------------------

const N = 24;
let cells = new Map(), mapId = 0, mapTimer, axes, spent = 0, spread = [1, 1]; // the least and the greatest value of good cells

function planMap() {
  axes = system.map.map(path => controls.get(path).slider).map(slider => ({
    ...slider, at: i => short(slider.log ? slider.low * (slider.high / slider.low) ** (i / (N - 1)) : slider.low + (slider.high - slider.low) * i / (N - 1)),
    marks: slider.log ? decades(slider.low, slider.high) : ticks(slider.low, slider.high, 5),
    of: v => (slider.log ? Math.log(v / slider.low) / Math.log(slider.high / slider.low) : (v - slider.low) / (slider.high - slider.low)) * (N - 1),
  }));
  $("maps").hidden = false;
  $("maptitle").textContent = `${axes[0].words} and ${axes[1].words.toLowerCase()}: ${system.measure ? system.measure.replace(/_/g, " ") : "the outcome"}`;
}

const order = (() => { const all = [], done = new Set(); for (const s of [8, 4, 2, 1]) for (let i = 0; i < N; i += s) for (let j = 0; j < N; j += s) if (!done.has(i * N + j)) done.add(i * N + j), all.push([i, j]); return all; })();

function startMap() {
  clearTimeout(mapTimer);
  mapTimer = setTimeout(() => {
    const id = ++mapId, fixed = values(), [x, y] = system.map;
    cells = new Map(), spent = 0;
    mappers.forEach((mapper, k) => mapper.worker.postMessage({ map: { id, measure: system.measure, cells: order.filter((_, n) => n % mappers.length === k).map(([i, j]) => ({ i, j, values: { ...fixed, [x]: axes[0].at(i), [y]: axes[1].at(j) } })) } }));
  }, 120);
}

function onmap({ map, cells: some, spent: time }) {
  if (map !== mapId) return;
  for (const [i, j, ...cell] of some) cells.set(i * N + j, cell);
  spent = Math.max(spent, time);
  const good = [...cells.values()].filter(([outcome, value]) => outcome === system.outcomes[0] && value > 0).map(([, value]) => value);
  spread = [Math.min(...good), Math.max(...good)];
  const survive = [...cells.values()].filter(([outcome]) => outcome !== "diverged" && outcome !== "refused").length;
  $("maptext").textContent = `${cells.size} of ${N * N} runs in ${(spent / 1000).toFixed(1)} s; ${survive} survive`;
  const unit = system.units[system.measure], ends = good.length ? `: ${spread.map(x => withUnit(String(+x.toPrecision(3)), unit)).join(" to ")}, from dark to light` : "";
  $("mapkey").textContent = `Blue: good${ends}. Yellow: not good. Brown: diverges. Grey: not possible. Click to go there.`;
  requestAnimationFrame(drawMap);
}

const place = canvas => { const w = canvas.clientWidth, h = +canvas.dataset.height; return { left: 46, bottom: 30, W: (w - 52) / N, H: (h - 48) / N, w, h }; };

function shade([outcome, value]) {
  if (outcome === "refused") return css("--refused");
  if (outcome === "diverged") return css("--diverged");
  if (outcome === system.outcomes[1]) return css("--bounded");
  const [low, high] = spread, share = value > 0 && low < high ? Math.log(value / low) / Math.log(high / low) : 0;
  return `color-mix(in oklab, ${css("--settled-high")} ${100 * share}%, ${css("--settled-low")})`;
}

function drawMap() {
  if (!system.map) return;
  const canvas = $("map"), [c] = context(canvas), { left, bottom, W, H, w, h } = place(canvas);
  for (const s of [8, 4, 2, 1]) for (let i = 0; i < N; i += s) for (let j = 0; j < N; j += s) {
    const cell = cells.get(i * N + j);
    if (!cell) continue;
    const [x, right] = [i, Math.min(N, i + s)].map(k => Math.round(left + k * W)), [top, y] = [Math.min(N, j + s), j].map(k => Math.round(h - bottom - k * H));
    c.fillStyle = shade(cell), c.fillRect(x, top, right - x, y - top);
  }
  c.fillStyle = css("--soft");
  for (const v of axes[0].marks) c.fillText(shown(v, axes[0].unit), Math.min(left + (axes[0].of(v) + .5) * W - 8, w - c.measureText(shown(v, axes[0].unit)).width), h - 14);
  for (const v of axes[1].marks) c.fillText(shown(v, axes[1].unit), 2, h - bottom - (axes[1].of(v) + .5) * H + 4);
  c.fillText(axes[0].words, w - c.measureText(axes[0].words).width - 4, h - 2), c.fillText(axes[1].words, 2, 9);
  const x = left + (axes[0].of(state[axes[0].path]) + .5) * W, y = h - bottom - (axes[1].of(state[axes[1].path]) + .5) * H;
  for (const [colour, width] of [["#fff", 4], ["#000", 1.6]]) c.strokeStyle = colour, c.lineWidth = width, c.beginPath(), c.arc(x, y, 6, 0, 7), c.stroke();
}

function go(i, j) {
  const at = [i, j].map(k => Math.max(0, Math.min(N - 1, k)));
  axes.forEach((axis, k) => controls.get(axis.path).set(axis.at(at[k])));
  changed(axes[0].path);
}

function listen() {
  const drag = (canvas, begin) => canvas.addEventListener("pointerdown", event => {
    const move = begin(event), end = () => removeEventListener("pointermove", move);
    addEventListener("pointermove", move), addEventListener("pointerup", end, { once: true }), addEventListener("pointercancel", end, { once: true });
  });
  drag($("scene"), ({ clientX, clientY }) => {
    const { turn, tilt } = view;
    return event => { view.turn = turn - (event.clientX - clientX) * .008, view.tilt = Math.max(-1.5, Math.min(1.5, tilt + (event.clientY - clientY) * .008)), drawScene(); };
  });
  $("scene").addEventListener("keydown", event => {
    const [turn, tilt] = { ArrowLeft: [.1, 0], ArrowRight: [-.1, 0], ArrowUp: [0, .1], ArrowDown: [0, -.1] }[event.key] ?? [0, 0];
    if (turn || tilt) event.preventDefault(), view.turn += turn, view.tilt = Math.max(-1.5, Math.min(1.5, view.tilt + tilt)), drawScene();
  });
  drag($("map"), event => {
    const pick = e => { const r = $("map").getBoundingClientRect(), { left, bottom, W, H, h } = place($("map")); go(Math.floor((e.clientX - r.left - left) / W), Math.floor((h - bottom - (e.clientY - r.top)) / H)); };
    pick(event);
    return pick;
  });
  $("map").addEventListener("keydown", event => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (step) event.preventDefault(), go(...axes.map((axis, k) => Math.round(axis.of(state[axis.path])) + step[k]));
  });
  $("pin").onclick = () => { putPin(beside.pinned ? null : { ...state }), fly(), writeHash(); };
  $("second").onclick = () => { putSecond(beside.second ? null : state), fly(), writeHash(); };
  $("reset").onclick = () => { for (const { slider, set } of controls.values()) set(slider.value); fly(), writeHash(), system.map && startMap(); };
  $("copy").onclick = async () => {
    const words = commands();
    try { await navigator.clipboard.writeText(words), $("copied").textContent = "copied"; } catch { $("copied").textContent = words; }
  };
  addEventListener("hashchange", () => { readHash(), fly(), system.map && startMap(); });
  addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

// -- begin ---------------------------------------------------------------------------------------------------------------------------

async function begin() {
  const begun = performance.now();
  system = JSON.parse(await unpackedText("system"));
  const url = URL.createObjectURL(new Blob([unpacked.toString(), "\n", await unpackedText("engine")], { type: "text/javascript" }));
  flier = new Flier(url, packed("single"), system);
  document.title = $("title").textContent = system.title;
  addControls(), readHash(), plan(), listen();
  if (system.map) {
    planMap();
    const most = Math.max(1, Math.min(4, (navigator.hardwareConcurrency || 2) - 1));
    mappers = Array.from({ length: most }, () => Object.assign(new Flier(url, packed("pair"), system), { onmap }));
  }
  await flier.ready;
  quadcosim.stats = { ready: performance.now() - begun };
  fly();
  if (system.map) Promise.all(mappers.map(each => each.ready)).then(startMap);
}

Object.defineProperties(window.quadcosim, Object.getOwnPropertyDescriptors({
  /** Runs with other values by path, and returns everything about it; a refusal rejects. */
  async run(given = {}) {
    await quadcosim.ready;
    const { width, rows, ...result } = await flier.ask({ run: { values: { ...given }, columns: system.columns } });
    return { ...result, rows: Array.from({ length: rows.length / width }, (_, i) => rows.subarray(i * width, (i + 1) * width)) };
  },
  get last() { return runs.flown; },
  get map() { return { cells, spent, axes }; },
  get command() { return commands(); },
}));
