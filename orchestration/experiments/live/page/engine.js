// A system in WebAssembly: settings in, results and rows out. It runs in a worker, a page and node.
const TIME = 9; // digits of a nanosecond in a second

/** The digits and the exponent of the shortest decimal form of a number: value = digits · 10^exponent. */
function decimal(value) {
  const [, sign, whole, part = "", exponent = "0"] = /^(-?)(\d+)(?:\.(\d+))?(?:e([+-]\d+))?$/.exec(String(value));
  const zeros = /0*$/.exec(whole + part)[0].length, digits = (whole + part).slice(0, whole.length + part.length - zeros) || "0";
  return [BigInt(sign + digits), digits === "0" ? 0 : Number(exponent) - part.length + zeros];
}

/** SHA-256 of bytes, in hexadecimal; that of the browser is missing in pages without a server. */
function sha256(bytes) {
  const K = sha256.k ??= (() => {
    const k = [], h = [];
    for (let n = 2; k.length < 64; n++) {
      let prime = true;
      for (let d = 2; d * d <= n; d++) if (n % d === 0) prime = false;
      if (!prime) continue;
      if (h.length < 8) h.push(Math.floor((Math.sqrt(n) % 1) * 4294967296));
      k.push(Math.floor((Math.cbrt(n) % 1) * 4294967296) | 0);
    }
    sha256.h = h;
    return Int32Array.from(k);
  })();
  const H = Int32Array.from(sha256.h), w = new Int32Array(64), size = bytes.length;
  const tail = new Uint8Array(((size % 64 < 56 ? 64 : 128) - size % 64) + size % 64);
  tail.set(bytes.subarray(size - size % 64)), tail[size % 64] = 128;
  new DataView(tail.buffer).setBigUint64(tail.length - 8, BigInt(size) * 8n);
  const block = (view, at) => {
    for (let i = 0; i < 16; i++) w[i] = view.getInt32(at + 4 * i);
    for (let i = 16; i < 64; i++) {
      const a = w[i - 15], b = w[i - 2];
      w[i] = w[i - 16] + w[i - 7] + ((a >>> 7 | a << 25) ^ (a >>> 18 | a << 14) ^ a >>> 3) + ((b >>> 17 | b << 15) ^ (b >>> 19 | b << 13) ^ b >>> 10) | 0;
    }
    let [a, b, c, d, e, f, g, h] = H;
    for (let i = 0; i < 64; i++) {
      const t = h + ((e >>> 6 | e << 26) ^ (e >>> 11 | e << 21) ^ (e >>> 25 | e << 7)) + (e & f ^ ~e & g) + K[i] + w[i] | 0;
      const u = ((a >>> 2 | a << 30) ^ (a >>> 13 | a << 19) ^ (a >>> 22 | a << 10)) + (a & b ^ a & c ^ b & c) | 0;
      h = g, g = f, f = e, e = d + t | 0, d = c, c = b, b = a, a = t + u | 0;
    }
    [a, b, c, d, e, f, g, h].forEach((x, i) => { H[i] += x; });
  };
  const all = new DataView(bytes.buffer, bytes.byteOffset, size), last = new DataView(tail.buffer);
  for (let at = 0; at + 64 <= size; at += 64) block(all, at);
  for (let at = 0; at < tail.length; at += 64) block(last, at);
  return Array.from(H, x => (x >>> 0).toString(16).padStart(8, "0")).join("");
}

class Refused extends Error {}

const OUTCOMES = { running: 0, failed: 1, refused: 2, notFinite: 5, diverged: 6 };

class Engine {
  static async of(bytes, system) {
    const { instance } = await WebAssembly.instantiate(bytes, {
      wasi_snapshot_preview1: new Proxy({}, { get: (_, name) => () => { throw new Error(`the module called ${name}`); } }),
    });
    return new Engine(instance.exports, system);
  }

  constructor(exports, system) {
    this.c = exports, this.system = system, this.columns = null;
    exports._initialize?.(), exports.set_up();
    this.lanes = exports.lane_count();
    this.paths = new Map(system.settings.map(([path], i) => [path, i]));
  }

  // Views on the memory are made anew: it is another buffer after it has grown.
  numbers(at, count) { return new Float64Array(this.c.memory.buffer, at, count); }
  whole(at, lane) { return Number(new BigInt64Array(this.c.memory.buffer, at, this.lanes)[lane]); }

  places(target) {
    const place = this.paths.get(target), own = this.system.targets[target] ?? (place === undefined ? null : [place]);
    if (!own) throw new Refused(`${target}: this page has no such number; expected one of ${this.system.sliders.map(each => each.path).join(", ")}, or another number of the request`);
    return own;
  }

  /** Set a lane to the values of the request, and to these, by path. */
  set(values, lane) {
    const view = new DataView(this.c.memory.buffer, this.c.settings_of(lane));
    const put = (i, value) => {
      const [digits, exponent] = decimal(value);
      view.setFloat64(24 * i, value, true), view.setBigInt64(24 * i + 8, digits, true), view.setBigInt64(24 * i + 16, BigInt(exponent), true);
    };
    this.defaults ??= this.system.settings.map(([, value]) => value);
    if (!this.clean?.[lane]) this.defaults.forEach((value, i) => put(i, value));
    (this.clean ??= [])[lane] = true;
    for (const i of this.changed?.[lane] ?? []) put(i, this.defaults[i]);
    (this.changed ??= [])[lane] = [];
    for (const [target, value] of Object.entries(values)) {
      if (typeof value !== "number" || !Number.isFinite(value)) throw new Refused(`${target} = ${value}: expected a number`);
      if (target === "seed" && !Number.isSafeInteger(value)) throw new Refused(`seed = ${value}: expected a whole number below 2^53`);
      for (const i of this.places(target)) put(i, value), this.changed[lane].push(i);
    }
  }

  record(columns) {
    if (this.columns === columns) return;
    this.c.record_columns(columns.length);
    columns.forEach(([, component, place], i) => this.c.record_at(i, component, place));
    this.columns = columns;
  }

  /** Fly runs, each with its values by path; with columns their rows are recorded. */
  fly(runs, columns) {
    runs.forEach((values, lane) => this.set(values, lane));
    if (columns) this.record(columns);
    if (!this.c.fly(runs.length, columns ? 1 : 0)) throw new Refused(this.refusal(runs));
    return runs.map((_, lane) => this.result(lane));
  }

  refusal(runs) {
    const reason = this.c.refused_reason(), i = this.c.refused_setting();
    if (i < 0) return "expected more memory than this page has";
    const [path, , low, high] = this.system.settings[i];
    const target = Object.entries(this.system.targets).find(([, places]) => places.length === 1 && places[0] === i)?.[0] ?? path;
    const value = Object.values(runs[0]).length ? runs.map(each => each[target] ?? each[path]).find(each => each !== undefined) ?? this.defaults[i] : this.defaults[i];
    const fixed = low === high;
    const expected = [
      "", fixed ? `${low}, to which it is fixed in this page: set it in the file` : low > -1e300 ? `a number ${this.system.settings[i][4] ? "above" : "of at least"} ${low}` : "a larger number",
      fixed ? `${low}, to which it is fixed in this page: set it in the file` : `at most ${high}`, "a whole number", "a number", "less than the period", "fewer losses for bursts of this length",
      "at least a nanosecond", "a simpler fraction of a second", "fewer instants: this page has room for a million",
    ][reason];
    return `${target} = ${value}: expected ${expected}`;
  }

  result(lane) {
    const c = this.c, outcome = this.whole(c.outcomes(), lane), time = this.whole(c.outcome_times(), lane) / 1e9;
    if (outcome === OUTCOMES.failed || outcome === OUTCOMES.refused) {
      const name = this.system.components[this.whole(c.outcome_components(), lane)];
      throw new Refused(outcome === OUTCOMES.failed ? `${name} fails at ${time} s with these values` : "the components do not start with these values");
    }
    if (outcome === OUTCOMES.notFinite) throw new Refused(`a value is no longer a number at ${time} s`);
    const diverged = outcome === OUTCOMES.diverged;
    if (!diverged && c.doubtful_lanes() >> lane & 1) throw new Refused("an objective has a value that is no number, or one of a component between its points: run computes it");
    const values = this.numbers(c.values_of_objectives(), this.lanes * this.system.objectives.length);
    const at = i => { const x = values[i * this.lanes + lane]; return Number.isFinite(x) && !diverged ? x : null; };
    const good = this.system.good < 0 ? null : !diverged && Boolean(at(this.system.good));
    const word = diverged ? "diverged" : good === null ? null : this.system.outcomes[good ? 0 : 1];
    const end = this.numbers(c.settings_of(lane), 1)[0], metrics = { outcome: word, good, horizon: end };
    this.system.optional.forEach(name => { metrics[name] = null; });
    this.system.objectives.forEach((name, i) => { if (i !== this.system.good) metrics[name] = at(i); });
    Object.assign(metrics, { diverged, divergence_time: diverged ? time : null, steps: this.whole(c.step_counts(), lane) });
    return { outcome: word, divergence_time: metrics.divergence_time, metrics };
  }

  rows(lane = 0) { return this.numbers(this.c.rows_of(lane), this.whole(this.c.row_counts(), lane) * (this.columns.length + 1)); }

  /** The values of sources that objectives read, at each row of a lane. */
  seen(rows, width, lane = 0) {
    const n = this.system.seen.length, count = rows.length / width, out = new Float64Array(n * count);
    if (!n) return out;
    const tables = [0, 1].map(own => {
      const length = this.c.time_count(lane, own), at = this.c.times_of(lane, own);
      return { length, times: new Uint32Array(this.c.memory.buffer, at, 2 * length), values: this.numbers(this.c.values_of_sources(lane, own), n * length), i: 0 };
    });
    for (let r = 0; r < count; r++) {
      const t = rows[r * width];
      for (const table of tables) {
        const time = () => (table.times[2 * table.i + 1] * 4294967296 + table.times[2 * table.i]) / 1e9;
        while (table.i < table.length && time() < t) table.i++;
        if (table.i === table.length || time() !== t) continue;
        for (let k = 0; k < n; k++) out[r * n + k] = table.values[table.i * n + k];
        break;
      }
    }
    return out;
  }

  /** Samples [s, component] and messages [connection, sent, arrival or -1] of a lane up to a time [s]. */
  clock(until, lane = 0) {
    const int = (at, count) => { const x = new Uint32Array(this.c.memory.buffer, at, 2 * count); return i => (x[2 * i + 1] | 0) * 4294967296 + x[2 * i]; };
    const count = this.c.sample_count(lane), samples = [], messages = [];
    const times = int(this.c.sample_times(lane), count), of = int(this.c.samples_of(lane), 5 * count);
    for (let i = 0; i < count && times(i) <= until * 1e9; i++) samples.push([times(i) / 1e9, of(5 * i)]);
    for (let table = 0; table < 3; table++) {
      const n = this.c.message_count(lane, table), x = int(this.c.messages_of(lane, table), 4 * n);
      for (let i = 0; i < n && x(4 * i + 2) <= until * 1e9; i++) messages.push([x(4 * i), x(4 * i + 2) / 1e9, x(4 * i + 3) < 0 ? -1 : x(4 * i + 3) / 1e9]);
    }
    return { samples, messages };
  }
}
if (typeof module !== "undefined") module.exports = { Engine, Refused, decimal, sha256 };
