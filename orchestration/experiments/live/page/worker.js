// What a worker does: it flies what the page asks for, and reduces rows to what is drawn.
let engine, ready, mapping = 0;

/** Of each bucket of the run its least and greatest value. */
function buckets(count, stop, rows, width, value) {
  const out = new Float32Array(2 * count).fill(NaN), n = rows.length / width;
  for (let r = 0; r < n; r++) {
    const b = 2 * Math.min(count - 1, Math.floor(rows[r * width] / stop * count)), x = value(r);
    if (!(out[b] <= x)) out[b] = x;
    if (!(out[b + 1] >= x)) out[b + 1] = x;
  }
  return out;
}

function drawn({ values, columns, drawing }) {
  const begun = performance.now(), [result] = engine.fly([values], columns), flown = performance.now();
  const rows = engine.rows(), width = columns.length + 1, count = rows.length / width, n = engine.system.seen.length;
  const seen = engine.seen(rows, width), stop = result.metrics.horizon;
  const distance = ({ columns: of, seen: to }) => r => Math.hypot(...of.map((c, i) => rows[r * width + 1 + c] - seen[r * n + to[i]]));
  const lines = drawing.lines.map(line => buckets(drawing.buckets, stop, rows, width, line.seen ? distance(line) : r => rows[r * width + 1 + line.column]));
  let path = null, wanted = null;
  if (drawing.scene) {
    const every = Math.max(1, Math.floor(count / 1500)), points = Math.ceil(count / every);
    path = new Float32Array(3 * points), wanted = new Float32Array(3 * points);
    for (let i = 0; i < points; i++) for (let k = 0; k < 3; k++) {
      path[3 * i + k] = rows[i * every * width + 1 + drawing.scene.columns[k]];
      wanted[3 * i + k] = seen[i * every * n + drawing.scene.seen[k]];
    }
  }
  const done = { ...result, lines, path, wanted, rows: count, clock: engine.clock(drawing.clock), until: drawing.clock, flight: flown - begun, all: performance.now() - begun };
  return [done, [...lines, path, wanted].filter(Boolean).map(each => each.buffer)];
}

function run({ values, columns }) {
  const [result] = engine.fly([values], columns), width = columns.length + 1, rows = engine.rows().slice();
  const sha = sha256(new Uint8Array(rows.buffer));
  return [{ ...result, columns: columns.map(([name]) => name), rows, width, sha256: sha }, [rows.buffer]];
}

/** Fly cells, as many at once as there are lanes, and hand them over now and then. */
async function map({ id, cells, measure }) {
  const begun = performance.now();
  let some = [], last = begun;
  mapping = id;
  for (let i = 0; i < cells.length; i += engine.lanes) {
    const group = cells.slice(i, i + engine.lanes), fly = part => engine.fly(part.map(cell => cell.values));
    let results;
    try { results = fly(group); } catch (error) {
      if (!(error instanceof Refused)) throw error;
      results = group.map(cell => { try { return fly([cell])[0]; } catch (refusal) { if (refusal instanceof Refused) return { refused: refusal.message }; throw refusal; } });
    }
    group.forEach((cell, k) => { const r = results[k]; some.push([cell.i, cell.j, r.refused ? "refused" : r.outcome, r.refused ? null : r.metrics[measure] ?? null, r.refused ?? r.divergence_time]); });
    const now = performance.now(), done = i + engine.lanes >= cells.length;
    if (now - last > 30 || done) {
      postMessage({ map: id, cells: some, done, spent: now - begun }), some = [], last = now;
      await new Promise(go => { const c = new MessageChannel(); c.port1.onmessage = go; c.port2.postMessage(0); });
      if (mapping !== id) return;
    }
  }
}

onmessage = async ({ data }) => {
  if (data.module) {
    ready = unpacked(data.module).then(bytes => Engine.of(bytes, data.system)).then(made => { engine = made; postMessage({ ready: true }); });
    return;
  }
  try {
    await ready;
    if (data.map) { await map(data.map); return; }
    const [result, moved] = data.run ? run(data.run) : drawn(data.fly);
    postMessage({ id: data.id, result }, moved);
  } catch (error) {
    postMessage({ id: data.id, refused: error instanceof Refused, error: error.message });
  }
};
