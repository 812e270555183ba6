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

let system, flier, mappers = [], controls = new Map(), last = null, pinned = null, drawing, columns;
const state = {};

/** Three digits that mean something, as decimal text would have them. */
const short = value => Number(Number(value).toPrecision(3));
const shown = (value, unit) => unit === "s" ? `${+(1000 * value).toPrecision(4)} ms` : `${+Number(value).toPrecision(4)}${unit ? ` ${unit.replace(/\./g, "·")}` : ""}`;

function addControls() {
  const groups = new Map();
  for (const slider of system.sliders) {
    if (!groups.has(slider.group)) {
      const set = document.createElement("fieldset");
      if (slider.group) set.append(Object.assign(document.createElement("legend"), { textContent: slider.group }));
      $("controls").append(set), groups.set(slider.group, set);
    }
    const label = document.createElement("label"), output = document.createElement("output"), input = document.createElement("input");
    const steps = slider.whole ? slider.high - slider.low : 1000;
    Object.assign(input, { type: "range", min: 0, max: steps, step: 1, name: slider.path });
    const up = k => slider.log ? slider.low * (slider.high / slider.low) ** (k / steps) : slider.low + (slider.high - slider.low) * k / steps;
    const down = v => Math.round(steps * (slider.log ? Math.log(v / slider.low) / Math.log(slider.high / slider.low) : (v - slider.low) / (slider.high - slider.low)));
    const control = {
      slider, set(value) {
        state[slider.path] = value, input.value = down(value);
        output.textContent = input.ariaValueText = shown(value, slider.unit);
      },
    };
    input.addEventListener("input", () => { control.set(slider.whole ? Math.round(up(+input.value)) : short(up(+input.value))); changed(slider.path); });
    label.append(slider.words, output, input), label.title = slider.path, groups.get(slider.group).append(label);
    controls.set(slider.path, control), control.set(slider.value);
  }
}

/** The values that differ from those of the request. */
function values() {
  return Object.fromEntries([...controls.values()].filter(({ slider }) => state[slider.path] !== slider.value).map(({ slider }) => [slider.path, state[slider.path]]));
}

function readHash() {
  const given = new URLSearchParams(location.hash.slice(1));
  for (const { slider, set } of controls.values()) {
    const value = Number(given.get(slider.path));
    set(given.has(slider.path) && Number.isFinite(value) ? value : slider.value);
  }
}

function writeHash() {
  const words = Object.entries(values()).map(([path, value]) => `${path}=${value}`).join("&");
  try { history.replaceState(null, "", words ? `#${words}` : location.pathname + location.search); } catch { /* a page inside another has no address */ }
}

function command() {
  const words = ["quadcosim run", ...system.name ? [system.name] : []];
  for (const [path, value] of Object.entries(values())) {
    const [table, ...rest] = path.split("."), flag = rest.join(".").replace(/_/g, "-");
    if (path === "seed" || path === "stop_time") words.push(`--${path.replace("_", "-")} ${value}`);
    else if (table === "timing") words.push(`--${flag} ${value}`);
    else words.push(`--set ${path}=${value}`);
  }
  return words.join(" ");
}

// -- runs ------------------------------------------------------------------------------------------------------------------

let busy = false, wanted = false, asked = 0;

async function fly() {
  if (busy) { wanted = true; return; }
  busy = true, wanted = false, asked = performance.now();
  try {
    const result = await flier.ask({ fly: { values: values(), columns, drawing: drawing.asked } });
    last = { ...result, latency: performance.now() - asked };
    requestAnimationFrame(draw);
  } catch (error) {
    $("word").textContent = error.refused ? "Not possible" : "Failed", $("word").className = "refused";
    $("numbers").textContent = error.message, $("speed").textContent = "";
  }
  busy = false;
  if (wanted) fly();
}

function changed(path) {
  fly(), writeHash();
  if (!system.map) return;
  if (system.map.includes(path)) drawMap(); else startMap();
}

function verdict({ outcome, divergence_time: time, metrics }) {
  if (outcome === "diverged") return ["diverges", `at ${time.toFixed(2)} s`];
  const settling = metrics.settling_time, measure = system.measure && metrics[system.measure];
  const more = measure === null || measure === undefined ? "" : `${system.measure.replace(/_/g, " ")} ${measure.toPrecision(4)}`;
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

function plot(canvas, panel) {
  const [c, w, h] = context(canvas), left = 52, bottom = 18, stop = last.metrics.horizon, log = panel.log, f = log ? Math.log10 : x => x;
  const runs = [pinned, last].filter(Boolean), all = runs.flatMap(run => panel.lines.map(i => run.lines[i]));
  let low = Infinity, high = -Infinity;
  for (const line of all) for (const x of line) if (Number.isFinite(x) && Math.abs(x) < 1e6) low = Math.min(low, x), high = Math.max(high, x);
  if (!(low <= high)) low = 0, high = 1;
  if (log) low = Math.max(low, 1e-5), high = Math.max(high, 10 * low), low = 10 ** Math.floor(Math.log10(low)), high = 10 ** Math.ceil(Math.log10(high));
  else if (high - low < 1e-9 * Math.max(1, Math.abs(high))) low -= .5, high += .5;
  const X = t => left + (w - left - 6) * t / stop, Y = v => Math.max(3, Math.min(h - bottom, h - bottom - (f(Math.max(v, log ? low : v)) - f(low)) / (f(high) - f(low)) * (h - bottom - 6)));
  c.fillStyle = css("--soft"), c.strokeStyle = css("--line"), c.lineWidth = 1, c.beginPath();
  const marks = log ? Array.from({ length: Math.round(Math.log10(high / low)) + 1 }, (_, i) => low * 10 ** i) : ticks(low, high, 4);
  for (const v of marks) c.moveTo(left, Y(v)), c.lineTo(w - 6, Y(v)), c.fillText(String(+v.toPrecision(3)), 4, Y(v) + 4);
  for (const t of ticks(0, stop, 8)) c.moveTo(X(t), 3), c.lineTo(X(t), h - bottom), c.fillText(String(t), Math.min(X(t) - 4, w - c.measureText(String(t)).width), h - 4);
  c.stroke();
  for (const run of runs) panel.lines.forEach((i, k) => {
    const line = run.lines[i], n = line.length / 2;
    c.strokeStyle = css(run === last ? "--flown" : "--pinned"), c.lineWidth = 1.4, c.globalAlpha = 1 - .25 * (k % 3), c.setLineDash([[], [6, 3], [2, 2]][k % 3]), c.beginPath();
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
  const [c, w, h] = context($("scene")), points = last.wanted;
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
  if (pinned) line(pinned.path, css("--pinned"), 1.5);
  line(last.path, css("--flown"), 2);
  c.fillStyle = css("--flown"), c.beginPath(), c.arc(...to(...last.path.slice(0, 3)), 4, 0, 7), c.fill();
  [["this run", "--flown"], ["reference", "--wanted"], ...pinned ? [["pinned", "--pinned"]] : []].forEach(([words, colour], i) => {
    c.fillStyle = css(colour), c.fillRect(8, 13 + 16 * i, 14, 2), c.fillStyle = css("--soft"), c.fillText(words, 28, 18 + 16 * i);
  });
}

function drawClock() {
  const { samples, messages } = last.clock, sampled = system.sampled, shown = sampled.length ? sampled : [""], canvas = $("clock");
  canvas.dataset.height = 34 + 40 * Math.max(1, shown.length);
  const [c, w, h] = context(canvas), left = 90, until = drawing.clock, X = t => left + (w - left - 8) * t / until, Y = name => 20 + 40 * Math.max(0, shown.indexOf(name));
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
  if (!last) return;
  const [word, more] = verdict(last);
  $("word").textContent = word, $("word").className = last.outcome ?? "", $("numbers").textContent = more;
  $("speed").textContent = `${last.rows.toLocaleString("en")} rows in ${last.flight.toFixed(1)} ms`;
  drawing.panels.forEach(panel => plot(panel.canvas, panel));
  drawScene(), drawClock(), drawMap();
  document.body.dataset.drawn = "";
}

/** What is drawn: distances from references, then columns by their unit. */
function plan() {
  columns = system.columns;
  const index = new Map(columns.map(([name], i) => [name, i])), seen = new Map(system.seen.map((name, i) => [name, i]));
  drawing = { buckets: BUCKETS, lines: [], panels: [], scene: null, clock: 0 };
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
  for (const [unit, some] of [...units].slice(0, 6)) add(`${some.slice(0, 4).map(([name]) => name).join(", ")}${some.length > 4 ? " …" : ""}${unit ? ` [${unit.replace(/\./g, "·")}]` : ""}`, some.slice(0, 4).map(([, i]) => ({ column: i })));
  const periods = system.settings.filter(([path]) => path.endsWith(".sampling.period")).map(([, value]) => value);
  drawing.clock = periods.length ? 30 * Math.max(...periods) : 1;
  for (const panel of drawing.panels) {
    const section = document.createElement("section"), canvas = document.createElement("canvas");
    section.append(Object.assign(document.createElement("h2"), { textContent: panel.title }), canvas);
    canvas.dataset.height = 130, canvas.setAttribute("role", "img"), canvas.setAttribute("aria-label", panel.title);
    panel.canvas = canvas, $("plots").append(section);
  }
  $("stage").hidden = !drawing.scene, $("strip").hidden = !system.sampled.length;
  const { panels, ...asked } = drawing;
  asked.lines = drawing.lines, drawing.asked = asked;
}

// -- the map ---------------------------------------------------------------------------------------------------------------------

const N = 24;
let cells = new Map(), mapId = 0, mapTimer, axes, spent = 0;

function planMap() {
  axes = system.map.map(path => controls.get(path).slider).map(slider => ({
    ...slider, at: i => short(slider.log ? slider.low * (slider.high / slider.low) ** (i / (N - 1)) : slider.low + (slider.high - slider.low) * i / (N - 1)),
    of: v => (slider.log ? Math.log(v / slider.low) / Math.log(slider.high / slider.low) : (v - slider.low) / (slider.high - slider.low)) * (N - 1),
  }));
  $("maps").hidden = false;
  $("maptitle").textContent = `${axes[0].words} and ${axes[1].words.toLowerCase()}: ${system.measure ? system.measure.replace(/_/g, " ") : "the outcome"}`;
  $("mapkey").textContent = "Blue: good, the darker the smaller. Yellow: not good. Brown: diverges. Grey: not possible. Click to go there.";
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
  const survive = [...cells.values()].filter(([outcome]) => outcome !== "diverged" && outcome !== "refused").length;
  $("maptext").textContent = `${cells.size} of ${N * N} runs in ${(spent / 1000).toFixed(1)} s; ${survive} survive`;
  requestAnimationFrame(drawMap);
}

const place = canvas => { const w = canvas.clientWidth, h = +canvas.dataset.height; return { left: 46, bottom: 30, W: (w - 52) / N, H: (h - 48) / N, w, h }; };

function shade([outcome, value]) {
  if (outcome === "refused") return css("--refused");
  if (outcome === "diverged") return css("--diverged");
  if (outcome === system.outcomes[1]) return css("--bounded");
  const share = value === null || value === undefined ? 0 : Math.max(0, Math.min(1, (Math.log10(Math.max(value, 1e-4)) + 3.2) / 2));
  return `color-mix(in oklab, ${css("--settled-high")} ${100 * share}%, ${css("--settled-low")})`;
}

function drawMap() {
  if (!system.map) return;
  const canvas = $("map"), [c] = context(canvas), { left, bottom, W, H, w, h } = place(canvas);
  for (const s of [8, 4, 2, 1]) for (let i = 0; i < N; i += s) for (let j = 0; j < N; j += s) {
    const cell = cells.get(i * N + j);
    if (cell) c.fillStyle = shade(cell), c.fillRect(left + i * W, h - bottom - Math.min(N, j + s) * H, Math.ceil(W * Math.min(s, N - i)), Math.ceil(H * Math.min(s, N - j)));
  }
  c.fillStyle = css("--soft");
  for (const i of [0, 6, 12, 18, 23]) c.fillText(shown(axes[0].at(i), axes[0].unit), left + i * W - 6, h - 14), c.fillText(shown(axes[1].at(i), axes[1].unit), 2, h - bottom - (i + .5) * H + 4);
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
  $("pin").onclick = () => { pinned = last, $("unpin").hidden = false, draw(); };
  $("unpin").onclick = () => { pinned = null, $("unpin").hidden = true, draw(); };
  $("reset").onclick = () => { for (const { slider, set } of controls.values()) set(slider.value); fly(), writeHash(), system.map && startMap(); };
  $("copy").onclick = async () => {
    const words = command();
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
  get last() { return last; },
  get map() { return { cells, spent, axes }; },
  get command() { return command(); },
}));
