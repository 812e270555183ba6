// A study over its axes: cells of a grid, or points of a sample, each of which opens its run.

const { NOT_GOOD, SHADES: { OUTER_SHARE, OUTLIER_RATIO, MIN_RANGE, LOGARITHMIC_RATIO } } = FIGURES;
const MARKS = { good: "circle", bad: "x-thin-open", diverged: "triangle-down-open" };
const MAX_SYMBOLS = 2500;
const VALUE = "value";

const map = { x: null, y: null, metric: null, fixed: {}, row: null, rows: [], isGrid: false, shades: null };

function startMap() {
  byId("map").hidden = false;
  map.metric = columnsByName.get(report.metric) ?? drawable[0];
  const varied = axes.filter((axis) => valuesOf(axis).length > 1);
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
  if (report.table.is_grid) {
    for (const axis of axes) {
      if (axis === map.x || axis === map.y || valuesOf(axis).length < 2) continue;
      controls.append(choice(titled(axis.label, axis.unit), valuesOf(axis).map((value, i) => [i, shown(value)]), valuesOf(axis).indexOf(map.fixed[axis.name]), (i) => {
        map.fixed[axis.name] = valuesOf(axis)[i];
        drawMap();
      }));
    }
  }
}

function changeMap(change) {
  Object.assign(map, change);
  if (map.x === map.y) map.y = VALUE;
  buildMapControls();
  drawMap();
}

/** Rows of the slice that is shown: all of a sample. */
function rowsOfSlice() {
  const others = report.table.is_grid ? axes.filter((axis) => axis !== map.x && axis !== map.y && valuesOf(axis).length > 1) : [];
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
  const traces = map.isGrid ? gridTraces() : pointTraces();
  const holder = byId("map-plot");
  return drawPlot(holder, [...traces, chosenTrace()], mapLayout()).then(() => {
    if (!map.isDrawn) holder.on("plotly_click", (event) => openRow(rowOfPoint(event.points[0])));
    map.isDrawn = true;
    byId("map-hint").textContent = mapHint();
  });
}

function mapHint() {
  const flights = report.runs.length ? ` ${report.runs.length} of ${report.table.count} have their signals in this file.` : "";
  const there = new Set(map.rows.map((row) => kindOf(outcomeOf(row))));
  const [good, bad] = report.words;
  const signs = map.isGrid
    ? { good: `Colour: ${good}`, bad: `light grey ✕: ${bad}`, diverged: "dark grey ▽: diverged" }
    : { good: `Discs: ${good}`, bad: `✕: ${bad}`, diverged: "▽: diverged" };
  const parts = ["good", "bad", "diverged"].filter((kind) => there.has(kind)).map((kind) => signs[kind]);
  if (map.isGrid && there.has("good") && there.size > 1) parts.push(`orange line: edge of what is ${good}`);
  const clipped = map.shades.isClipped ? " Some values lie beyond the colours, which are for the others." : "";
  return `${parts.join("; ")}.${clipped} Click, or move with the arrow keys, to open a run.${flights}`;
}

function rowOfPoint(point) {
  if (point.customdata === undefined || point.customdata === null) return map.row;
  return Array.isArray(point.customdata) ? point.customdata[0] : point.customdata;
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
  const title = { text: escaped(titled(map.metric.label, map.metric.unit)), side: isNarrowMap() ? "top" : "right" };
  const lies = isNarrowMap() ? { orientation: "h", x: 0.5, y: -0.18, yanchor: "top", nticks: 5 } : {};
  const bar = { title, thickness: 14, outlinewidth: 0, len: 1, ...lies };
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
  const [colors, codes, texts, rows, kinds] = [empty(), empty(), empty(), empty(), empty()];
  for (const row of map.rows) {
    const [i, j] = [lines.get(cellOf(map.y, row)), columns.get(cellOf(map.x, row))];
    const kind = kindOf(outcomeOf(row));
    kinds[i][j] = kind;
    rows[i][j] = row;
    texts[i][j] = hoverOf(row);
    codes[i][j] = { good: 0, bad: 1, diverged: 2 }[kind];
    if (kind === "good") colors[i][j] = colorOf(cellOf(map.metric, row));
  }
  const gaps = across.length * up.length <= 900 ? { xgap: 1, ygap: 1 } : {};
  const scale = [[0, "rgba(0,0,0,0)"], [1 / 3, "rgba(0,0,0,0)"], [1 / 3, NOT_GOOD.bad], [2 / 3, NOT_GOOD.bad], [2 / 3, NOT_GOOD.diverged], [1, NOT_GOOD.diverged]];
  const values = colors.flat();
  return [
    { type: "heatmap", x: across, y: up, z: colors, zmin: map.shades.low, zmax: map.shades.high, colorscale: "Viridis", colorbar: colorBar(), hoverinfo: "skip", showscale: values.some(Number.isFinite), ...gaps },
    { type: "heatmap", x: across, y: up, z: codes, zmin: -0.5, zmax: 2.5, colorscale: scale, showscale: false, customdata: rows, text: texts, hovertemplate: "%{text}<extra></extra>", ...gaps },
    ...symbolTraces(kinds, across, up),
    edgeTrace(kinds, across, up),
  ];
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
      type: "scatter", mode: "markers", ...found, hoverinfo: "skip", showlegend: false,
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
  return { type: "scatter", mode: "lines", x, y, line: { color: paint("edge-of-good"), width: 2.5 }, hoverinfo: "skip", showlegend: false };
}

// -- points of a sample -----------------------------------------------------------------------------------

/** The metric of the runs that are shown, as far as they have one. */
function heights() {
  return map.rows.map((row) => cellOf(map.metric, row)).filter(Number.isFinite);
}

function pointTraces() {
  const many = map.rows.length > 1500 && hasWebGL();
  const bottom = heights().reduce((least, value) => Math.min(least, value), Infinity);
  return ["good", "bad", "diverged"].flatMap((kind) => {
    const rows = map.rows.filter((row) => kindOf(outcomeOf(row)) === kind);
    if (!rows.length) return [];
    const height = (row) => {
      if (map.y !== VALUE) return cellOf(map.y, row);
      const value = cellOf(map.metric, row);
      return Number.isNaN(value) ? (Number.isFinite(bottom) ? bottom : 0) : value;
    };
    const word = { good: report.words[0], bad: report.words[1], diverged: "diverged" }[kind];
    const colored = kind === "good" && map.y !== VALUE;
    const plain = { good: COLORS[0], bad: paint("bad"), diverged: COLORS[1] }[kind];
    return {
      type: many ? "scattergl" : "scatter", mode: "markers", name: escaped(`${word} (${rows.length})`),
      x: rows.map((row) => cellOf(map.x, row)), y: rows.map(height), customdata: rows, text: rows.map(hoverOf),
      hovertemplate: "%{text}<extra></extra>",
      marker: {
        symbol: MARKS[kind], size: kind === "good" ? 7 : 8, line: { width: kind === "good" ? 0 : 1.5, color: plain },
        color: colored ? rows.map((row) => colorOf(cellOf(map.metric, row))) : plain,
        ...(colored ? { colorscale: "Viridis", colorbar: colorBar(), cmin: map.shades.low, cmax: map.shades.high } : {}),
      },
    };
  });
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
    type: "scatter", mode: "markers", x: [x, x], y: [y, y], hoverinfo: "skip", showlegend: false, name: "open",
    marker: { symbol: "square-open", size: [15, 19], color: ["#000", "#fff"], line: { width: [2.5, 2] } },
  };
}

function markOnMap(row) {
  map.row = row;
  if (!map.isDrawn) return undefined;
  const holder = byId("map-plot");
  const { x, y } = chosenTrace();
  return Plotly.restyle(holder, { x: [x], y: [y] }, [holder.data.length - 1]);
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

function mapLayout() {
  const y = map.y === VALUE ? { title: { text: escaped(titled(map.metric.label, map.metric.unit)) }, type: isWide(heights()) ? "log" : "linear" } : axisLayout(map.y);
  return {
    height: isNarrowMap() ? 520 : 470, margin: { l: 66, r: 10, t: 26, b: isNarrowMap() ? 120 : 50 }, hovermode: "closest", dragmode: "pan", xaxis: axisLayout(map.x),
    yaxis: y, showlegend: !map.isGrid,
    legend: { orientation: "h", x: 0, y: 1.0, yanchor: "bottom" },
    uirevision: [map.x.name, map.y === VALUE ? VALUE : map.y.name].join(),
  };
}

function axisLayout(axis) {
  const type = axis.words ? "category" : axis.logarithmic ? "log" : "linear";
  return { title: { text: escaped(titled(axis.label, axis.unit)), standoff: 8 }, type, zeroline: false, exponentformat: "power" };
}
