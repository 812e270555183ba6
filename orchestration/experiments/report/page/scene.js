// The flight in space, drawn on a canvas: path, reference, and the vehicle with its arms and the axes of its body.
// Space is north, east, down; up is up on the screen.

const VIEWS = { "3-D": [-0.9, 0.42], side: [-Math.PI / 2, 0], top: [-Math.PI / 2, Math.PI / 2 - 1e-3] };

const ROTORS = [[1, 1], [1, -1], [-1, 1], [-1, -1]];
const TRAIL = { seconds: 2, parts: 24 };

const scene = { canvas: null, tracks: [], t: 0, azimuth: VIEWS["3-D"][0], elevation: VIEWS["3-D"][1], zoom: 1, box: null };

function startScene(canvas) {
  scene.canvas = canvas;
  canvas.setAttribute("aria-label", "The flight in space. Arrow keys turn it, plus and minus zoom, 0 shows all of it.");
  canvas.addEventListener("pointerdown", startTurning);
  canvas.addEventListener("keydown", turnByKey);
  canvas.addEventListener("wheel", zoomByWheel, { passive: false });
  new ResizeObserver(drawScene).observe(canvas);
  const views = document.querySelector(".views");
  for (const name of Object.keys(VIEWS)) views.append(button(name, () => look(...VIEWS[name])));
}

function look(azimuth, elevation) {
  Object.assign(scene, { azimuth, elevation, zoom: 1 });
  drawScene();
}

function startTurning(event) {
  const { azimuth, elevation } = scene;
  const move = (now) => {
    scene.azimuth = azimuth - (now.clientX - event.clientX) * 0.008;
    scene.elevation = Math.max(-1.5, Math.min(1.57, elevation + (now.clientY - event.clientY) * 0.008));
    drawScene();
  };
  const stop = () => {
    window.removeEventListener("pointermove", move);
    window.removeEventListener("pointerup", stop);
    window.removeEventListener("pointercancel", stop);
  };
  window.addEventListener("pointermove", move);
  window.addEventListener("pointerup", stop);
  window.addEventListener("pointercancel", stop);
}

function turnByKey(event) {
  const turns = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
  if (event.key in turns) {
    scene.azimuth += turns[event.key][0];
    scene.elevation = Math.max(-1.5, Math.min(1.57, scene.elevation + turns[event.key][1]));
  } else if (event.key === "+" || event.key === "=") scene.zoom *= 1.2;
  else if (event.key === "-") scene.zoom /= 1.2;
  else if (event.key === "0") return look(...VIEWS["3-D"]);
  else return undefined;
  event.preventDefault();
  return drawScene();
}

function zoomByWheel(event) {
  if (!event.ctrlKey && document.activeElement !== scene.canvas) return; // the page scrolls until the view is chosen
  event.preventDefault();
  scene.zoom *= Math.exp(-event.deltaY * 0.001);
  drawScene();
}

/** Show these runs, the first as the one that is replayed. */
function showInScene(tracks) {
  scene.tracks = tracks.filter((signals) => signals && signals.space);
  scene.box = boxOf(scene.tracks);
  drawScene();
}

/** The box that contains the paths, limited for a run that diverges. */
function boxOf(tracks) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  const take = (values, i, most) => {
    for (const value of values) {
      if (!Number.isFinite(value) || Math.abs(value) > most) continue;
      low[i] = Math.min(low[i], value);
      high[i] = Math.max(high[i], value);
    }
  };
  for (const { space, columns } of tracks) {
    const { position, reference } = space;
    for (let i = 0; i < 3; i += 1) {
      take(columns[position[i]], i, 30);
      if (reference) take(columns[reference[i]], i, Infinity);
    }
  }
  const middle = low.map((value, i) => (value + high[i]) / 2);
  const points = tracks.flatMap((signals) => sampled(signals, low, high));
  const size = Math.max(0.5, ...low.map((value, i) => high[i] - value));
  return { low, high, middle, size, points };
}

/** Some points of a path and its reference that lie in the box. */
function sampled({ space, columns, time }, low, high) {
  const { position, reference } = space;
  const step = Math.max(1, Math.floor(time.length / 150));
  return [position, reference].filter(Boolean).flatMap((names) => {
    const found = [];
    for (let i = 0; i < time.length; i += step) found.push(names.map((name) => columns[name][i]));
    return found.filter((point) => point.every((value, i) => value >= low[i] && value <= high[i]));
  });
}

/** The projection of a point (north, east, down) to the screen, with its depth, scaled to fill the picture. */
function camera(width, height) {
  const raw = projection(width, height, { scale: 1, right: 0, top: 0 });
  const floor = floorOf(scene.box);
  const { corner, top } = uprightOf(raw, floor);
  const { from, to, down } = floor;
  const ground = [from[0], to[0]].flatMap((n) => [from[1], to[1]].map((e) => [n, e, down]));
  const places = [...ground, [...corner, top], ...scene.box.points].map(raw);
  const ends = (i) => places.reduce(([a, b], place) => [Math.min(a, place[i]), Math.max(b, place[i])], [Infinity, -Infinity]);
  const [[left, right], [high, low]] = [ends(0), ends(1)];
  const scale = scene.zoom * Math.min((width - 100) / (right - left || 1), (height - 80) / (low - high || 1));
  return projection(width, height, { scale, right: (left + right) / 2 - width / 2, top: (high + low) / 2 - height / 2 });
}

/** The floor: a grid of round numbers below everything visible. */
function floorOf({ low, high, size }) {
  const step = niceStep(size);
  const from = [0, 1].map((i) => Math.floor(low[i] / step) * step);
  const to = [0, 1].map((i) => Math.ceil(high[i] / step) * step);
  return { step, from, to, down: Math.ceil(high[2] / step) * step };
}

/** The edges of the floor that are nearer, and the corner with the upright axis, which ends at `top`. */
function uprightOf(project, { step, from, to, down }) {
  const east = project([0, from[1], down])[2] < project([0, to[1], down])[2] ? from[1] : to[1];
  const north = project([from[0], 0, down])[2] < project([to[0], 0, down])[2] ? from[0] : to[0];
  const corner = [north, east === from[1] ? to[1] : from[1]];
  return { north, east, corner, top: Math.floor(scene.box.low[2] / step) * step };
}

/** As `camera`, at a scale and moved by some pixels of the picture at scale 1. */
function projection(width, height, fit) {
  const { middle, size, low, high } = scene.box;
  const extent = Math.hypot(...low.map((value, i) => high[i] - value));
  const [ca, sa, ce, se] = [Math.cos(scene.azimuth), Math.sin(scene.azimuth), Math.cos(scene.elevation), Math.sin(scene.elevation)];
  const far = 3.2 * Math.max(extent, size);
  return (point) => {
    const [n, e, up] = [point[0] - middle[0], point[1] - middle[1], middle[2] - point[2]];
    const right = -sa * n + ca * e;
    const away = ca * n + sa * e;
    const depth = ce * away - se * up;
    const perspective = far / (far + depth);
    const [x, y] = [perspective * right - fit.right, -perspective * (se * away + ce * up) - fit.top];
    return [width / 2 + fit.scale * x, height / 2 + fit.scale * y, depth];
  };
}

function drawScene() {
  const canvas = scene.canvas;
  if (!canvas || !scene.tracks.length || !canvas.clientWidth) return;
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const project = camera(width, height);
  drawFloor(context, project);
  scene.tracks.slice().reverse().forEach((signals, k, all) => drawFlight(context, project, signals, k < all.length - 1));
}

/** A step of 1, 2 or 5 times a power of ten that cuts a length in about five. */
function niceStep(length) {
  const power = 10 ** Math.floor(Math.log10(length / 5));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= length / 5);
}

function drawFloor(context, project) {
  const floor = floorOf(scene.box);
  const { step, from, to, down } = floor;
  context.lineWidth = 1;
  context.strokeStyle = paint("grid");
  for (let n = from[0]; n <= to[0] + step / 2; n += step) stroke(context, project, [[n, from[1], down], [n, to[1], down]]);
  for (let e = from[1]; e <= to[1] + step / 2; e += step) stroke(context, project, [[from[0], e, down], [to[0], e, down]]);
  drawTicks(context, project, floor);
}

/** Numbers along the two edges of the floor that are nearer, and up a corner. */
function drawTicks(context, project, floor) {
  const { step, from, to, down } = floor;
  const { north, east, corner, top } = uprightOf(project, floor);
  context.fillStyle = paint("soft");
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  const outward = (a, b) => (a === b ? -1 : 1);
  const shift = 0.32 * step;
  const text = (what, point) => context.fillText(what, ...project(point).slice(0, 2));
  for (let n = from[0]; n <= to[0] + step / 2; n += step) text(shown(n), [n, east + shift * outward(east, from[1]), down]);
  for (let e = from[1]; e <= to[1] + step / 2; e += step) text(shown(e), [north + shift * outward(north, from[0]), e, down]);
  text("north [m]", [(from[0] + to[0]) / 2, east + 2.4 * shift * outward(east, from[1]), down]);
  text("east [m]", [north + 2.4 * shift * outward(north, from[0]), (from[1] + to[1]) / 2, down]);
  if (Math.cos(scene.elevation) < 0.3) return;
  context.strokeStyle = paint("edge");
  stroke(context, project, [[...corner, down], [...corner, top]]);
  for (let z = top; z <= down + step / 2; z += step) text(`${shown(z)} `, [corner[0], corner[1] + shift * outward(corner[1], from[1]), z]);
  text("down [m]", [corner[0], corner[1], top - 0.35 * step]);
}

function stroke(context, project, points) {
  context.beginPath();
  for (const [i, point] of points.entries()) {
    const [x, y] = project(point);
    if (i) context.lineTo(x, y);
    else context.moveTo(x, y);
  }
  context.stroke();
}

function drawFlight(context, project, signals, isBeside) {
  const { position, reference, quaternion, desired, thrust } = signals.space;
  const t = Math.min(scene.t, signals.time[signals.time.length - 1]);
  const until = placeAt(signals.time, t);
  const color = paint(isBeside ? "beside" : "flown");
  const at = (names) => names.map((name) => valueAt(signals, name, t));
  const here = at(position);
  context.lineJoin = "round";
  if (reference && !isBeside) {
    context.setLineDash([6, 4]);
    drawPath(context, project, signals, reference, 0, signals.time.length - 1, paint("wanted"), 1.4);
    context.setLineDash([]);
  }
  drawPath(context, project, signals, position, until, signals.time.length - 1, color, 1, 0.3);
  drawPath(context, project, signals, position, 0, until, color, 1.6, 0.6, here);
  drawTrail(context, project, signals, t, color);
  if (reference && !isBeside) {
    if (desired) drawGhost(context, project, at(reference), attitudeAt(signals, desired, t));
    else drawDiamond(context, project(at(reference)));
  }
  const force = thrust ? valueAt(signals, thrust, t) / mostOf(signals, thrust) : 0;
  drawVehicle(context, project, here, attitudeAt(signals, quaternion, t), color, force);
}

/** The largest value of a column. */
function mostOf(signals, name) {
  signals.most = signals.most ?? {};
  if (!(name in signals.most)) signals.most[name] = signals.columns[name].reduce((most, value) => Math.max(most, value), 1e-9);
  return signals.most[name];
}

/** Where it was in the last seconds: thicker towards now. */
function drawTrail(context, project, signals, t, color) {
  const { position } = signals.space;
  const places = [];
  for (let k = 0; k <= TRAIL.parts; k += 1) {
    const then = t - TRAIL.seconds * (1 - k / TRAIL.parts);
    if (then >= signals.time[0]) places.push([k / TRAIL.parts, position.map((name) => valueAt(signals, name, then))]);
  }
  context.strokeStyle = color;
  context.lineCap = "round";
  for (let k = 1; k < places.length; k += 1) {
    const [[share, point], [, before]] = [places[k], places[k - 1]];
    if (![...point, ...before].every((value) => Math.abs(value) < 1e4)) continue;
    context.globalAlpha = 0.15 + 0.75 * share;
    context.lineWidth = 1 + 5 * share;
    stroke(context, project, [before, point]);
  }
  context.globalAlpha = 1;
  context.lineCap = "butt";
}

function drawPath(context, project, signals, names, first, last, color, width, alpha = 1, end = null) {
  const [x, y, z] = names.map((name) => signals.columns[name]);
  const step = Math.max(1, Math.floor((last - first) / 1500));
  context.globalAlpha = alpha;
  context.strokeStyle = color;
  context.lineWidth = width;
  context.beginPath();
  let isOpen = false;
  const add = (point) => {
    if (!point.every((value) => Math.abs(value) < 1e4)) return;
    const [right, top] = project(point);
    if (isOpen) context.lineTo(right, top);
    else context.moveTo(right, top);
    isOpen = true;
  };
  for (let i = first; i <= last; i += step) add([x[i], y[i], z[i]]);
  if (end) add(end);
  context.stroke();
  context.globalAlpha = 1;
}

function drawDiamond(context, [x, y]) {
  context.strokeStyle = paint("wanted");
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x, y - 6);
  for (const [dx, dy] of [[6, 0], [0, 6], [-6, 0]]) context.lineTo(x + dx, y + dy);
  context.closePath();
  context.stroke();
}

function attitudeAt(signals, names, t) {
  const q = names.map((name) => valueAt(signals, name, t));
  const length = Math.hypot(...q) || 1;
  return q.map((part) => part / length);
}

/** A vector of the body in space, by the unit quaternion (x, y, z, w). */
function rotated([x, y, z, w], [a, b, c]) {
  const [u, v, s] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * u + y * s - z * v, b + w * v + z * u - x * s, c + w * s + x * v - y * u];
}

/** Half the length of an arm: much larger than it is. */
function sizeOfVehicle() {
  return (0.085 * scene.box.size) / scene.zoom ** 0.5;
}

/** Arms in a cross, rotors as discs (those in front filled), the axes of the body, thrust, and a plumb line to the floor. */
function drawVehicle(context, project, here, q, color, force) {
  if (!here.every((value) => Math.abs(value) < 1e4)) return;
  const size = sizeOfVehicle();
  const at = (point) => rotated(q, point).map((value, i) => here[i] + value);
  const { down } = floorOf(scene.box);
  context.strokeStyle = paint("edge");
  context.lineWidth = 1;
  context.setLineDash([2, 3]);
  stroke(context, project, [here, [here[0], here[1], down]]);
  context.setLineDash([]);
  context.strokeStyle = paint("ink");
  context.lineWidth = 4;
  for (const side of [1, -1]) stroke(context, project, [at([size, side * size, 0]), at([-size, -side * size, 0])]);
  for (const [fore, side] of ROTORS) {
    drawRotor(context, project, at, size, fore, side);
    context.fillStyle = fore > 0 ? color : paint("stage");
    context.globalAlpha = 0.8;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = color;
    context.lineWidth = 2;
    context.stroke();
  }
  drawAxis(context, project, at, [1.9 * size, 0, 0], "x");
  drawAxis(context, project, at, [0, 1.9 * size, 0], "y");
  drawAxis(context, project, at, [0, 0, 1.9 * size], "z");
  if (force > 0) drawArrow(context, project(at([0, 0, 0])), project(at([0, 0, -3 * size * force])), paint("thrust"));
}

/** The desired attitude at the desired position. */
function drawGhost(context, project, here, q) {
  const size = sizeOfVehicle();
  const at = (point) => rotated(q, point).map((value, i) => here[i] + value);
  context.strokeStyle = paint("wanted");
  context.lineWidth = 1.4;
  for (const side of [1, -1]) stroke(context, project, [at([size, side * size, 0]), at([-size, -side * size, 0])]);
  for (const [fore, side] of ROTORS) {
    drawRotor(context, project, at, size, fore, side);
    context.stroke();
  }
}

/** The outline of a rotor, to be filled or stroked. */
function drawRotor(context, project, at, size, fore, side) {
  context.beginPath();
  for (let k = 0; k <= 16; k += 1) {
    const angle = (k * Math.PI) / 8;
    const [x, y] = project(at([fore * size + 0.55 * size * Math.cos(angle), side * size + 0.55 * size * Math.sin(angle), 0]));
    if (k) context.lineTo(x, y);
    else context.moveTo(x, y);
  }
}

function drawArrow(context, [x, y], [toX, toY], color) {
  const angle = Math.atan2(toY - y, toX - x);
  const length = Math.hypot(toX - x, toY - y);
  if (length < 3) return;
  context.strokeStyle = color;
  context.lineWidth = 3;
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(toX, toY);
  for (const turn of [2.6, -2.6]) {
    context.moveTo(toX, toY);
    context.lineTo(toX + Math.min(9, length) * Math.cos(angle + turn), toY + Math.min(9, length) * Math.sin(angle + turn));
  }
  context.stroke();
}

function drawAxis(context, project, at, tip, name) {
  context.strokeStyle = paint("soft");
  context.lineWidth = 1.2;
  stroke(context, project, [at([0, 0, 0]), at(tip)]);
  context.fillStyle = paint("ink");
  context.font = "italic 11px system-ui, sans-serif";
  context.textAlign = "center";
  context.fillText(name, ...project(at(tip.map((value) => 1.15 * value))).slice(0, 2));
}
