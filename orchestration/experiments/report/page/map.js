// A study over its axes: cells of a grid, or points of a sample, each of which opens its run.

const { NOT_GOOD, SHADES: { OUTER_SHARE, OUTLIER_RATIO, MIN_RANGE, LOGARITHMIC_RATIO } } = FIGURES;
const MARKS = { good: "circle", bad: "x-thin-open", diverged: "triangle-down-open" };
const MARKS_OF_OTHER = { good: "diamond-open", bad: "cross-thin-open", diverged: "triangle-up-open" }; // of a second study or law
const MAX_SYMBOLS = 2500;
const VALUE = "value";
const FOOT = 0.1; // share of the heights that marks without a value are below

const map = { x: null, y: null, metric: null, fixed: {}, row: null, rows: [], isGrid: false, shades: null, box: null, inside: null };

function startMap() {
  byId("map").hidden = false;
  map.metric = columnsByName.get(report.metric) ?? drawable[0];
  const varied = axes.filter((axis) => axis.name !== report.repeat && valuesOf(axis).length > 1);
  map.x = varied[0] ?? axes[0];
  map.y = varied[1] ?? VALUE;
  for (const axis of axes) map.fixed[axis.name] = valuesOf(axis)[0];
  byId("map-plot").setAttribute("aria-label", "Map of the runs. Arrow keys open the neighbouring run.");
  byId("map-plot").addEventListener("keydown", stepOnMap);
  buildMapControls();
  redraws.push(drawMap);
  return drawMap();
}

/** The different values of an axis, in order. */
function valuesOf(axis) {
  if (!axis.distinct) {
    const seen = new Set(numbersOf(axis.values));
    const values = [...seen].sort((a, b) => a - b);
    axis.distinct = axis.words ? values.map((place) => axis.words[place]) : values;
  }
  return axis.distinct;
}

function buildMapControls() {
  const controls = byId("map-controls");
  controls.replaceChildren(
    choice("Metric", drawable.map((column) => [column.name, column.label]), map.metric.name, (name) => changeMap({ metric: columnsByName.get(name) })),
    choice("across", axes.map((axis) => [axis.name, axis.label]), map.x.name, (name) => changeMap({ x: columnsByName.get(name) })),
    choice("up", [...axes.map((axis) => [axis.name, axis.label]), [VALUE, "the metric"]], map.y === VALUE ? VALUE : map.y.name, (name) => changeMap({ y: name === VALUE ? VALUE : columnsByName.get(name) })),
  );
  for (const axis of fixedAxes()) {
    controls.append(choice(titled(axis.label, axis.unit), valuesOf(axis).map((value, i) => [i, shown(value)]), valuesOf(axis).indexOf(map.fixed[axis.name]), (i) => {
      map.fixed[axis.name] = valuesOf(axis)[i];
      drawMap();
    }));
  }
}

function changeMap(change) {
  Object.assign(map, change);
  if (map.x === map.y) map.y = VALUE;
  map.box = null;
  buildMapControls();
  drawMap();
}

/** The axes with one value in the slice that is shown: none of a sample. Over one axis all that repeats is shown. */
function fixedAxes() {
  const isFixed = (axis) => axis !== map.x && axis !== map.y && !(map.y === VALUE && axis.name === report.repeat);
  return report.table.is_grid ? axes.filter((axis) => isFixed(axis) && valuesOf(axis).length > 1) : [];
}

function rowsOfSlice() {
  const others = fixedAxes();
  const found = [];
  for (let row = 0; row < report.table.count; row += 1) {
    if (others.every((axis) => cellOf(axis, row) === map.fixed[axis.name])) found.push(row);
  }
  return found;
}

function drawMap() {
  map.rows = rowsOfSlice();
  map.isGrid = report.table.is_grid && map.y !== VALUE;
  map.shades = shadesOf(map.rows.filter((row) => kindOf(outcomeOf(row)) === "good").map((row) => cellOf(map.metric, row)));
  map.inside = rowsInBox();
  measureSlider();
  const isOver = report.other && map.y === VALUE;
  const inSlice = (at) => fixedAxes().every((axis) => at(axis.name) === map.fixed[axis.name]);
  const traces = map.isGrid ? gridTraces() : isOver ? tracesOfBoth(inSlice, map.x.name !== report.repeat) : pointTraces();
  const holder = byId("map-plot");
  holder.onbox = choseBox;
  holder.onwhole = () => choseBox(null, null);
  holder.redraw = drawMap;
  holder.onpoint = ({ data }) => openRow(data);
  return drawPlot(holder, [...traces, chosenTrace()], mapLayout()).then(() => {
    map.isDrawn = true;
    byId("map-hint").replaceChildren(mapHint(), ...(map.inside ? [button("All runs", () => choseBox(null, null))] : []));
  });
}

/** Take the runs in a box that was drawn over the map; null: all again. */
function choseBox(across, up) {
  map.box = across && { across, up };
  drawMap();
  if (map.inside && !map.inside.has(map.row)) openRow(firstOf([...map.inside]));
}

function rowsInBox() {
  if (!map.box || !map.isDrawn) return null;
  const { x, y } = byId("map-plot").plot.axes;
  const isIn = (axis, [low, high], value) => onAxis(axis, value) >= low && onAxis(axis, value) <= high;
  const found = map.rows.filter((row) => {
    const [across, up] = placeOnMap(row);
    return isIn(x, map.box.across, across) && isIn(y, map.box.up, up);
  });
  return found.length ? new Set(found) : null;
}

/** Runs in the box, how many of them are good, and the median of the metric among these. */
function boxText() {
  const rows = [...map.inside];
  const good = rows.filter((row) => kindOf(outcomeOf(row)) === "good");
  const values = good.map((row) => cellOf(map.metric, row)).filter(Number.isFinite).sort((a, b) => a - b);
  const median = values.length ? (values[(values.length - 1) >> 1] + values[values.length >> 1]) / 2 : NaN;
  const middle = values.length ? `; median ${map.metric.label} of these: ${withUnit(Number(median.toPrecision(4)), map.metric.unit)}` : "";
  return `In the box: ${rows.length} of ${map.rows.length} runs, ${good.length} ${report.words[0]} (${percent(good.length / rows.length)})${middle}. The slider goes over their flights. `;
}

function mapHint() {
  if (map.inside) return boxText();
  const flights = report.runs.length ? ` ${report.runs.length} of ${report.table.count} have their signals in this file.` : "";
  const there = new Set(map.rows.map((row) => kindOf(outcomeOf(row))));
  const [good, bad] = report.words;
  const signs = map.isGrid
    ? { good: `Colour: ${good}`, bad: `light grey ✕: ${bad}`, diverged: "dark grey ▽: diverged" }
    : { good: `Discs: ${good}`, bad: `✕: ${bad}`, diverged: "▽: diverged" };
  const parts = ["good", "bad", "diverged"].filter((kind) => there.has(kind)).map((kind) => signs[kind]);
  if (map.isGrid && there.has("good") && there.size > 1) parts.push(`orange line: edge of what is ${good}`);
  if (map.isGrid && report.other) parts.push(`dashed line: that of ${report.other.name}`);
  const clipped = map.shades.isClipped ? " Some values lie beyond the colours, which are for the others." : "";
  return `${parts.join("; ")}.${clipped} Click, or move with the arrow keys, to open a run; drag a box to choose among runs.${flights}`;
}

/** The hover text of a run. */
function hoverOf(row) {
  const lines = axes.map((axis) => lineOf(axis, row));
  const index = cellOf(columnsByName.get("design_index"), row);
  lines.unshift(`<b>run ${index}: ${escaped(outcomeOf(row))}</b>`);
  lines.push(`${escaped(map.metric.label)}: ${withUnit(cellOf(map.metric, row), escaped(map.metric.unit ?? ""))}`);
  if (report.runs.length && !runOfRow(row)) lines.push("<i>metrics only</i>");
  return lines.join("<br>");
}

/** An axis in a hover text; ten thousand cells have few values of it. */
function lineOf(axis, row) {
  const value = numbersOf(axis.values)[row];
  if (!axis.lines) axis.lines = new Map();
  if (!axis.lines.has(value)) axis.lines.set(value, `${escaped(axis.label)}: ${escaped(withUnit(cellOf(axis, row), axis.unit))}`);
  return axis.lines.get(value);
}

/** Whether values are of different orders of magnitude. */
function isWide(values) {
  const known = values.filter(Number.isFinite);
  const [low, high] = known.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
  return low > 0 && high > LOGARITHMIC_RATIO * low;
}

/** The values of the first and the last colour, as logarithms if the range is wide. */
function shadesOf(values) {
  const known = values.filter(Number.isFinite).sort((a, b) => a - b);
  if (!known.length) return { low: 0, high: 1, isLogarithmic: false, isClipped: false };
  const isLogarithmic = isWide(known);
  const scaled = isLogarithmic ? known.map(Math.log10) : known;
  const at = (share) => scaled[Math.round(share * (scaled.length - 1))];
  const within = at(1 - OUTER_SHARE) - at(OUTER_SHARE);
  const hasOutliers = scaled.length >= 20 && within > 0 && scaled.at(-1) - scaled[0] > OUTLIER_RATIO * within;
  const ends = hasOutliers ? [at(OUTER_SHARE), at(1 - OUTER_SHARE)] : [scaled[0], scaled.at(-1)];
  const middle = (ends[0] + ends[1]) / 2;
  const half = (MIN_RANGE / 2) * (isLogarithmic ? Math.LOG10E : Math.max(Math.abs(known[0]), Math.abs(known.at(-1))));
  const [low, high] = [Math.min(ends[0], middle - half), Math.max(ends[1], middle + half)];
  return { low, high, isLogarithmic, isClipped: scaled[0] < low || scaled.at(-1) > high };
}

function colorOf(value) {
  return map.shades.isLogarithmic ? Math.log10(value) : value;
}

/** Whether the colour bar has to lie below the map. */
function isNarrowMap() {
  return byId("map-plot").clientWidth < NARROW;
}

/** The colour bar, its ticks in the metric's own numbers. */
function colorBar() {
  const { low, high, isLogarithmic } = map.shades;
  const title = { text: escaped(titled(map.metric.label, map.metric.unit)) };
  const lies = isNarrowMap() ? { orientation: "h" } : {};
  const bar = { title, ...lies };
  if (!isLogarithmic) return bar;
  const ticks = [];
  for (let power = Math.floor(low); power <= high; power += 1) {
    for (const factor of high - low > 2.5 ? [1] : [1, 2, 5]) {
      const tick = power + Math.log10(factor);
      if (tick >= low && tick <= high) ticks.push(tick);
    }
  }
  return { ...bar, tickvals: ticks, ticktext: ticks.map((tick) => String(Number((10 ** tick).toPrecision(1)))) };
}

// -- a grid -----------------------------------------------------------------------------------------------

function gridTraces() {
  const [across, up] = [valuesOf(map.x), valuesOf(map.y)];
  const place = (axis) => new Map(valuesOf(axis).map((value, i) => [value, i]));
  const [columns, lines] = [place(map.x), place(map.y)];
  const empty = () => up.map(() => new Array(across.length).fill(null));
  const [colors, codes, rows, kinds, faded] = [empty(), empty(), empty(), empty(), empty()];
  for (const row of map.rows) {
    const [i, j] = [lines.get(cellOf(map.y, row)), columns.get(cellOf(map.x, row))];
    const kind = kindOf(outcomeOf(row));
    kinds[i][j] = kind;
    rows[i][j] = row;
    faded[i][j] = isOutside(row);
    codes[i][j] = { good: 0, bad: 1, diverged: 2 }[kind];
    if (kind === "good") colors[i][j] = colorOf(cellOf(map.metric, row));
  }
  const gaps = { faded, ...(across.length * up.length <= 900 ? { xgap: 1 } : {}) };
  const values = colors.flat();
  return [
    { type: "heatmap", x: across, y: up, z: colors, zmin: map.shades.low, zmax: map.shades.high, colorscale: "Viridis", colorbar: colorBar(), showscale: values.some(Number.isFinite), ...gaps },
    { type: "heatmap", x: across, y: up, z: codes, colors: [null, NOT_GOOD.bad, NOT_GOOD.diverged], customdata: rows, said: (i, j) => hoverOf(rows[i][j]), ...gaps },
    ...symbolTraces(kinds, across, up),
    edgeTrace(kinds, across, up),
    ...edgeOfOther(across, up),
  ];
}

/** The edge of what is good in a second study, over the same values. */
function edgeOfOther(across, up) {
  if (!report.other) return [];
  const own = new Map(report.other.table.columns.map((column) => [column.name, column]));
  const others = fixedAxes();
  const kinds = up.map(() => new Array(across.length).fill(null));
  for (let row = 0; row < report.other.table.count; row += 1) {
    if (!others.every((axis) => cellOf(own.get(axis.name), row) === map.fixed[axis.name])) continue;
    const [i, j] = [up.indexOf(cellOf(own.get(map.y.name), row)), across.indexOf(cellOf(own.get(map.x.name), row))];
    if (i >= 0 && j >= 0) kinds[i][j] = kindOf(cellOf(own.get("outcome"), row));
  }
  const edge = edgeTrace(kinds, across, up);
  return [{ ...edge, line: { color: paint("other-edge"), width: 2.5, dash: "dash" } }];
}

/** Signs on what is not good, where there is room for them. */
function symbolTraces(kinds, across, up) {
  if (across.length * up.length > MAX_SYMBOLS) return [];
  return ["bad", "diverged"].map((kind) => {
    const found = { x: [], y: [] };
    kinds.forEach((line, i) => line.forEach((each, j) => {
      if (each !== kind) return;
      found.x.push(across[j]);
      found.y.push(up[i]);
    }));
    return {
      type: "scatter", mode: "markers", ...found, showlegend: false,
      marker: { symbol: MARKS[kind], size: 5, color: kind === "bad" ? "#3b4249" : "#fff", line: { width: 1, color: kind === "bad" ? "#3b4249" : "#fff" } },
    };
  });
}

/** The edges of the cells around increasing values. */
function edgesOf(values) {
  if (typeof values[0] === "string") return [...values.keys(), values.length].map((i) => i - 0.5);
  if (values.length === 1) return [values[0] - 0.5, values[0] + 0.5];
  const inner = values.slice(1).map((value, i) => (value + values[i]) / 2);
  return [2 * values[0] - inner[0], ...inner, 2 * values.at(-1) - inner.at(-1)];
}

/** The line between what is good and what is not. */
function edgeTrace(kinds, across, up) {
  const [xs, ys] = [edgesOf(across), edgesOf(up)];
  const [x, y] = [[], []];
  const isGood = (i, j) => kinds[i]?.[j] === "good";
  const isThere = (i, j) => Boolean(kinds[i]?.[j]);
  for (let i = 0; i < up.length; i += 1) {
    for (let j = 0; j < across.length; j += 1) {
      if (isThere(i, j + 1) && isThere(i, j) && isGood(i, j) !== isGood(i, j + 1)) { x.push(xs[j + 1], xs[j + 1], null); y.push(ys[i], ys[i + 1], null); }
      if (isThere(i + 1, j) && isThere(i, j) && isGood(i, j) !== isGood(i + 1, j)) { x.push(xs[j], xs[j + 1], null); y.push(ys[i + 1], ys[i + 1], null); }
    }
  }
  return { type: "scatter", mode: "lines", x, y, line: { color: paint("edge-of-good"), width: 2.5 }, showlegend: false };
}

// -- points of a sample -----------------------------------------------------------------------------------

/** The metric of the runs that are shown, as far as they have one. */
function heights() {
  return map.rows.map((row) => cellOf(map.metric, row)).filter(Number.isFinite);
}

/** The height of marks without a value: below all values. */
function footOf(values) {
  if (!values.length) return 0;
  const [low, high] = values.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
  return isWide(heights()) ? low * (low / high) ** FOOT : low - FOOT * (high - low || Math.abs(low) || 1);
}

function nameOfMarks(kind, values) {
  const word = { good: report.words[0], bad: report.words[1], diverged: "diverged" }[kind];
  return escaped(`${word} (${values.length}${values.some(Number.isNaN) ? "; without a value at the foot" : ""})`);
}

function pointTraces(foot = footOf(heights()), all = map.rows, of = "", [marks, color] = [MARKS, null]) {
  return ["good", "bad", "diverged"].flatMap((kind) => {
    const rows = all.filter((row) => kindOf(outcomeOf(row)) === kind);
    if (!rows.length) return [];
    const height = (row) => {
      if (map.y !== VALUE) return cellOf(map.y, row);
      const value = cellOf(map.metric, row);
      return Number.isNaN(value) ? foot : value;
    };
    const colored = kind === "good" && map.y !== VALUE;
    const plain = color ?? { good: COLORS[0], bad: paint("bad"), diverged: COLORS[1] }[kind];
    return {
      type: "scatter", mode: "markers", name: escaped(of) + nameOfMarks(kind, rows.map((row) => (map.y === VALUE ? cellOf(map.metric, row) : 0))),
      x: rows.map((row) => cellOf(map.x, row)), y: rows.map(height), customdata: rows, said: (i) => hoverOf(rows[i]), faded: rows.map(isOutside),
      marker: {
        symbol: marks[kind], size: kind === "good" ? 7 : 8, line: { width: kind === "good" && marks === MARKS ? 0 : 1.5, color: plain },
        color: colored ? rows.map((row) => colorOf(cellOf(map.metric, row))) : plain,
        ...(colored ? { colorscale: "Viridis", colorbar: colorBar(), cmin: map.shades.low, cmax: map.shades.high } : {}),
      },
    };
  });
}

/** The runs that are shown, and those wanted of a second study with marks of their own; each with its mean if asked. */
function tracesOfBoth(isWanted, hasMeans) {
  const columns = new Map(report.other.table.columns.map((column) => [column.name, column]));
  const at = (name, row) => (columns.has(name) ? cellOf(columns.get(name), row) : NaN);
  const valueOf = (row) => at(map.metric.name, row);
  const rows = [...Array(report.other.table.count).keys()].filter((row) => isWanted((name) => at(name, row)));
  const foot = footOf([...heights(), ...rows.map(valueOf).filter(Number.isFinite)]);
  const own = pointTraces(foot, map.rows, `${report.title}: `);
  const beside = Object.entries(MARKS_OF_OTHER).flatMap(([kind, symbol]) => {
    const those = rows.filter((row) => kindOf(at("outcome", row)) === kind);
    if (!those.length) return [];
    const values = those.map(valueOf);
    return {
      type: "scatter", mode: "markers", name: `${escaped(report.other.name)}: ${nameOfMarks(kind, values)}`,
      x: those.map((row) => at(map.x.name, row)), y: values.map((value) => (Number.isNaN(value) ? foot : value)),
      said: (i) => `<b>${escaped(report.other.name)}, run ${at("design_index", those[i])}: ${escaped(at("outcome", those[i]))}</b><br>${escaped(map.metric.label)}: ${withUnit(values[i], escaped(map.metric.unit ?? ""))}`,
      marker: { symbol, size: 9, color: COLORS[2], line: { width: 1.5, color: COLORS[2] } },
    };
  });
  const means = hasMeans && report.table.is_grid && !map.x.words ? [
    meanTrace(report.title, map.rows.map((row) => placeOnMap(row)), 0), meanTrace(report.other.name, rows.map((row) => [at(map.x.name, row), valueOf(row)]), 2),
  ] : [];
  return [...own, ...beside, ...means];
}

/** The mean of the values that there are at each place across. */
function meanTrace(of, points, color) {
  const known = points.filter(([, value]) => Number.isFinite(value));
  const across = [...new Set(known.map(([x]) => x))].sort((a, b) => a - b);
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const y = across.map((x) => mean(known.filter((point) => point[0] === x).map((point) => point[1])));
  return { type: "scatter", mode: "lines", name: `${escaped(of)}: mean`, x: across, y, line: { color: COLORS[color], width: 1.5, dash: color ? "dash" : undefined } };
}

// -- what is chosen ---------------------------------------------------------------------------------------

function placeOnMap(row) {
  const value = map.y === VALUE ? cellOf(map.metric, row) : cellOf(map.y, row);
  return [cellOf(map.x, row), Number.isNaN(value) ? null : value];
}

function chosenTrace() {
  const isShown = map.row !== null && map.rows.includes(map.row);
  const [x, y] = isShown ? placeOnMap(map.row) : [null, null];
  return {
    type: "scatter", mode: "markers", x: [x, x], y: [y, y], showlegend: false, name: "open",
    marker: { symbol: "square-open", size: [15, 19], color: ["#000", "#fff"], line: { width: [2.5, 2] } },
  };
}

function markOnMap(row) {
  map.row = row;
  if (!map.isDrawn) return undefined;
  const { data, layout } = byId("map-plot");
  return drawTraces(byId("map-plot"), [...data.slice(0, -1), chosenTrace()], layout);
}

/** The neighbour of the open run in the direction of an arrow key. */
function stepOnMap(event) {
  const [dx, dy] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [0, 0];
  if (!dx && !dy) return;
  event.preventDefault();
  if (map.row === null || !map.rows.includes(map.row)) openRow(map.rows[0]);
  else openRow(neighbour(map.row, dx, dy));
}

function neighbour(row, dx, dy) {
  const [across, up] = placeOnMap(row);
  const place = (axis, value) => (axis === VALUE || axis.words === null ? value : axis.words.indexOf(value));
  const [cx, cy] = [place(map.x, across), place(map.y, up)];
  const spanX = spreadOf(map.x);
  const spanY = map.y === VALUE ? 0 : spreadOf(map.y);
  let [best, least] = [row, Infinity];
  for (const other of map.rows) {
    const [ox, oy] = placeOnMap(other);
    const right = ((place(map.x, ox) - cx) / spanX) * (dx || 1);
    const top = spanY ? ((place(map.y, oy) - cy) / spanY) * (dy || 1) : 0;
    const [along, aside] = dx ? [right, top] : [top, right];
    const distance = along + 6 * Math.abs(aside);
    if (along > 1e-9 && distance < least) [best, least] = [other, distance];
  }
  return best;
}

function spreadOf(axis) {
  if (axis.words) return axis.words.length;
  const values = valuesOf(axis);
  return values.at(-1) - values[0] || 1;
}

/** Whether a run is not among those of the box. */
function isOutside(row) {
  return Boolean(map.inside && !map.inside.has(row));
}

function mapLayout() {
  const y = map.y === VALUE ? { title: { text: escaped(titled(map.metric.label, map.metric.unit)) }, type: isWide(heights()) ? "log" : "linear" } : axisLayout(map.y);
  return {
    height: isNarrowMap() ? 520 : 470, margin: { l: 66, r: 10, t: 26, b: isNarrowMap() ? 120 : 50 }, xaxis: axisLayout(map.x),
    yaxis: y, showlegend: !map.isGrid,
    legend: { x: 0, y: 1, isAbove: true },
  };
}

function axisLayout(axis) {
  const type = axis.words ? "category" : axis.logarithmic ? "log" : "linear";
  return { title: { text: escaped(titled(axis.label, axis.unit)) }, type, words: axis.words, zeroline: false, ...ticksAtValues(axis) };
}

/** Ticks at the values of an axis that has a few, apart from one another: beyond them nothing was run. */
function ticksAtValues(axis) {
  const values = valuesOf(axis);
  const apart = (values.at(-1) - values[0]) / 12;
  if (axis.words || axis.logarithmic || values.length > 8 || values.some((value, i) => i > 0 && value - values[i - 1] < apart)) return {};
  return { tickvals: values, ticktext: values.map((value) => String(Number(value.toPrecision(6)))) };
}
