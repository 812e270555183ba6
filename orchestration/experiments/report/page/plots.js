// Plots as SVG: lines and points over axes, and cells of a grid, all drawn anew from traces and a layout. A trace names
// its axes ("x", "y3"), which the layout has as "xaxis", "yaxis3" with their place in shares of the plot.

const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
const CIVIDIS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"];
const DIFFERENCES = ["#8e0b23", "#c2373a", "#e58368", "#f8c4ab", "#f3f4f5", "#b5d5e7", "#6aaccf", "#2f79b4", "#0b3c78"];
const SCALES = { Viridis: VIRIDIS, Cividis: CIVIDIS, Differences: DIFFERENCES };
const DASHED = { solid: "", dash: "7 4", dashdot: "7 3 2 3", dot: "2 3", longdash: "11 4", longdashdot: "11 3 2 3" };
const SHADES_OF_COLOR = 64;
const NEAR = 24;
const DOUBLE_CLICK = 400;

function svg(tag, properties = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(properties)) if (value !== undefined && value !== null) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

const measuring = document.createElement("canvas").getContext("2d");

function widthOf(text, size) {
  measuring.font = `${size}px ${FONT.family}`;
  return measuring.measureText(text).width;
}

/** Text with the few tags of labels, as lines of plain text. */
function linesOf(text) {
  return String(text).split("<br>").map((line) => {
    const plain = line.replace(/<\/?[bi]>/g, "").replace(/&lt;/g, "<").replace(/&gt;/g, ">").replace(/&amp;/g, "&");
    return { plain, isBold: line.includes("<b>"), isItalic: line.includes("<i>") };
  });
}

/** The colour at a share of a scale. */
function shadeAt(scale, share) {
  const place = Math.max(0, Math.min(1, share)) * (scale.length - 1);
  const i = Math.min(scale.length - 2, Math.floor(place));
  const part = (color, k) => parseInt(color.slice(1 + 2 * k, 3 + 2 * k), 16);
  const mixed = [0, 1, 2].map((k) => Math.round(part(scale[i], k) + (place - i) * (part(scale[i + 1], k) - part(scale[i], k))));
  return `rgb(${mixed.join()})`;
}

// -- axes -------------------------------------------------------------------------------------------------

const axisName = (id) => `${id[0]}axis${id.slice(1)}`;

/** A value on an axis as a number: the place of a word, the logarithm on a logarithmic axis. */
function onAxis(axis, value) {
  if (value === null || value === undefined) return NaN;
  if (axis.words) return typeof value === "string" ? axis.words.indexOf(value) : value;
  return axis.isLogarithmic ? Math.log10(value) : value;
}

/** The axis with its range and its place in pixels. */
function axisOf(id, spec, traces, [from, to]) {
  const values = traces.flatMap((trace) => (trace.type === "heatmap" ? [trace[id[0]]] : [trace[id[0]]]));
  const isWords = spec.type === "category" || values.some((some) => typeof some[0] === "string");
  const axis = { ...spec, id, isLogarithmic: spec.type === "log", words: isWords ? spec.words ?? [...new Set(values.flatMap((some) => [...some]))].filter((value) => typeof value === "string") : null };
  const domain = spec.domain ?? [0, 1];
  axis.at = domain.map((share) => from + share * (to - from));
  axis.ends = spec.range ? [...spec.range] : rangeOf(axis, traces);
  axis.toPixel = (value) => axis.at[0] + ((onAxis(axis, value) - axis.ends[0]) / (axis.ends[1] - axis.ends[0])) * (axis.at[1] - axis.at[0]);
  axis.fromPixel = (pixel) => axis.ends[0] + ((pixel - axis.at[0]) / (axis.at[1] - axis.at[0])) * (axis.ends[1] - axis.ends[0]);
  return axis;
}

function rangeOf(axis, traces) {
  if (axis.words) return [-0.5, axis.words.length - 0.5];
  let [low, high, hasPoints] = [Infinity, -Infinity, false];
  for (const trace of traces) {
    const isCells = trace.type === "heatmap";
    hasPoints ||= !isCells && trace.mode.includes("markers");
    for (const value of isCells ? edgesOfCells(axis, trace[axis.id[0]]) : trace[axis.id[0]]) {
      const place = isCells ? value : onAxis(axis, value);
      if (!Number.isFinite(place)) continue;
      low = Math.min(low, place);
      high = Math.max(high, place);
    }
  }
  if (low > high) return [0, 1];
  const isCells = traces.some((trace) => trace.type === "heatmap");
  const air = isCells ? 0 : (axis.id[0] === "y" || hasPoints ? 0.06 : 0) * (high - low) || (high === low ? 0.5 * Math.abs(high) || 1 : 0);
  return [low - air, high + air];
}

/** The edges of the cells around values, on the axis. */
function edgesOfCells(axis, values) {
  const edges = edgesOf(values);
  if (!axis.isLogarithmic) return edges;
  return edges.map((edge, i) => (edge > 0 ? Math.log10(edge) : Math.log10(values[0]) - (i ? 0 : Math.log10(values[1] / values[0]) / 2)));
}

/** The values with a tick, and their texts. */
function ticksOf(axis) {
  const room = Math.abs(axis.at[1] - axis.at[0]);
  if (axis.tickvals) return axis.tickvals.map((value, i) => [value, axis.ticktext[i]]);
  if (axis.words) {
    const step = Math.max(1, Math.ceil((axis.words.length * (axis.id[0] === "x" ? 60 : 14)) / room));
    return axis.words.map((word, i) => [i, word]).filter((_, i) => i % step === 0);
  }
  const each = axis.each ?? 1; // ticks are round in the unit that is shown
  const [low, high] = [each * Math.min(...axis.ends), each * Math.max(...axis.ends)];
  if (axis.isLogarithmic) return ticksOfPowers(low, high, room);
  const most = Math.min(axis.nticks ?? 99, Math.max(2, Math.floor(room / (axis.id[0] === "x" ? 75 : 24))));
  const step = niceStep((5 * (high - low)) / most);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push(Number((k * step).toPrecision(12)));
  return found.map((value) => [value / each, axis.tickformat ? `${Math.round(100 * value)}%` : tickText(value)]);
}

function ticksOfPowers(low, high, room) {
  const factors = high - low > 2.5 ? [1] : [1, 2, 5];
  const step = Math.max(1, Math.ceil((24 * (high - low)) / room));
  const found = [];
  for (let power = Math.floor(low / step) * step; power <= high; power += step) {
    for (const factor of factors) {
      const place = power + Math.log10(factor);
      if (place >= low && place <= high) found.push([10 ** place, power < -3 || power > 3 ? `${factor === 1 ? "" : `${factor}·`}10${superscript(power)}` : String(Number((factor * 10 ** power).toPrecision(3)))]);
    }
  }
  return found;
}

function tickText(value) {
  const text = Math.abs(value) >= 1e5 || (value && Math.abs(value) < 1e-4) ? value.toExponential().replace("e+", "e") : String(value);
  return text.replace("-", "−");
}

// -- a plot -----------------------------------------------------------------------------------------------

/** Draw traces into a holder, whose `onpoint`, `onspan`, `onbox` and `onwhole` are called for clicks and drags. */
function drawTraces(holder, traces, layout) {
  holder.data = traces;
  holder.layout = layout;
  const width = holder.clientWidth;
  const { height } = layout;
  const margin = marginOf(traces, layout, width);
  const plot = { width, height, margin, axes: {}, layout, traces };
  const spans = { x: [margin.l, width - margin.r], y: [height - margin.b, margin.t] };
  for (const [name, spec] of Object.entries(layout)) {
    const id = /^([xy])axis(\d*)$/.exec(name);
    if (!id) continue;
    const own = id[1] + id[2];
    plot.axes[own] = axisOf(own, spec, traces.filter((trace) => (trace[`${own[0]}axis`] ?? own[0]) === own), spans[own[0]]);
    spec.range = plot.axes[own].ends;
  }
  holder.plot = plot;
  const drawn = svg("svg", { xmlns: "http://www.w3.org/2000/svg", width, height, viewBox: `0 0 ${width} ${height}`, "font-family": FONT.family, "font-size": FONT.size, fill: paint("ink") });
  drawn.append(svg("rect", { width, height, fill: layout.paper_bgcolor }));
  const subplots = subplotsOf(plot);
  subplots.forEach((each) => drawn.append(...frameOf(plot, each)));
  subplots.forEach((each, i) => {
    const id = `${holder.id}-${i}`;
    drawn.append(svg("clipPath", { id }, svg("rect", boxOfSubplot(each))), svg("g", { "clip-path": `url(#${id})` }, ...each.traces.flatMap((trace) => markOf(each, trace))));
  });
  drawn.append(...legendsOf(plot), ...(layout.annotations ?? []).map((note) => noteOf(plot, note)), ...traces.filter((trace) => trace.colorbar ?? trace.marker?.colorbar).map((trace) => barOf(plot, trace)).filter(Boolean));
  const areas = subplots.filter((each) => !each.x.fixedrange).map((each) => element("div", { className: "plot-area", style: styleOf(boxOfSubplot(each)) }));
  const said = element("div", { className: "said", hidden: true });
  holder.replaceChildren(drawn, ...areas, said);
  areas.forEach((area, i) => listenTo(holder, area, subplots[i], said));
  watchSize(holder);
  return Promise.resolve();
}

function styleOf({ x, y, width, height }) {
  return `left:${x}px;top:${y}px;width:${width}px;height:${height}px`;
}

/** Draw again when the page has another width. */
function watchSize(holder) {
  if (holder.watcher) return;
  holder.watcher = new ResizeObserver(() => {
    if (holder.clientWidth && holder.plot && holder.clientWidth !== holder.plot.width) later(() => holder.redraw ? holder.redraw() : drawTraces(holder, holder.data, holder.layout));
  });
  holder.watcher.observe(holder);
}

/** Margins with room for words at the left, a bar of colours at the right, and a legend above. */
function marginOf(traces, layout, width) {
  const margin = { ...layout.margin };
  if (layout.yaxis?.type === "category") margin.l += Math.max(...traces.flatMap((trace) => [...trace.y]).map((word) => (word === null ? 0 : widthOf(word, FONT.size))));
  const bar = traces.map((trace) => trace.showscale === false ? null : trace.colorbar ?? trace.marker?.colorbar).find(Boolean);
  if (bar && bar.orientation !== "h") margin.r += 84;
  if (layout.legend?.isAbove && layout.showlegend !== false) margin.t += 16 * (rowsOfLegend(traces, width - margin.l - margin.r).length - 1) + 6;
  return margin;
}

/** The pairs of axes that are drawn over one another, in the order of their vertical axes. */
function subplotsOf(plot) {
  const found = new Map();
  for (const [id, axis] of Object.entries(plot.axes)) {
    if (id[0] === "y") found.set(id, { y: axis, x: plot.axes[axis.anchor ?? "x"], traces: [] });
  }
  for (const trace of plot.traces) found.get(trace.yaxis ?? "y").traces.push(trace);
  return [...found.values()];
}

function boxOfSubplot({ x, y }) {
  return { x: x.at[0], y: y.at[1], width: Math.max(0, x.at[1] - x.at[0]), height: Math.max(0, y.at[0] - y.at[1]) };
}

/** Grid lines, numbers and titles of a subplot. */
function frameOf(plot, { x, y }) {
  const [left, right] = x.at;
  const [bottom, top] = y.at;
  const parts = [];
  const line = (x1, y1, x2, y2, color) => parts.push(svg("line", { x1, y1, x2, y2, stroke: color, "stroke-width": 1 }));
  const label = (text, at, anchor, size) => parts.push(svg("text", { ...at, "text-anchor": anchor, "font-size": size }, text));
  const isLast = (x.anchor ?? "y") === y.id;
  if (y.showline) parts.push(svg("rect", { ...boxOfSubplot({ x, y }), fill: plot.layout.plot_bgcolor, stroke: y.linecolor }));
  for (const [value, text] of ticksOf(x)) {
    const at = x.toPixel(value);
    if (x.showgrid !== false) line(at, top, at, bottom, x.gridcolor);
    if (isLast) label(text, { x: at, y: bottom + 3 + (x.tickfont?.size ?? FONT.size) }, "middle", x.tickfont?.size);
  }
  for (const [value, text] of ticksOf(y)) {
    const at = y.toPixel(value);
    if (y.showgrid !== false) line(left, at, right, at, y.gridcolor);
    label(text, { x: left - 5, y: at + 4 }, "end", y.tickfont?.size);
  }
  if (!y.words && !y.isLogarithmic && y.zeroline !== false && y.ends[0] < 0 && y.ends[1] > 0) line(left, y.toPixel(0), right, y.toPixel(0), y.zerolinecolor);
  if (x.title && isLast) label(linesOf(x.title.text)[0].plain, { x: (left + right) / 2, y: bottom + 34 }, "middle");
  if (y.title) label(linesOf(y.title.text)[0].plain, { transform: `translate(14 ${(top + bottom) / 2}) rotate(-90)` }, "middle");
  return parts;
}

function markOf(subplot, trace) {
  if (trace.type === "heatmap") return cellsOf(subplot, trace);
  const parts = [];
  if (trace.mode.includes("lines")) parts.push(lineOfTrace(subplot, trace));
  if (trace.error_y) parts.push(intervalsOf(subplot, trace));
  if (trace.mode.includes("markers")) parts.push(...pointsOf(subplot, trace));
  return parts;
}

/** A line as a path: of each column of pixels the first, lowest, highest and last value. */
function lineOfTrace({ x, y }, { x: xs, y: ys, line, opacity }) {
  const parts = [];
  let [isOpen, column, some] = [false, null, []];
  const put = (px, py) => {
    parts.push(`${isOpen ? "L" : "M"}${px.toFixed(1)} ${py.toFixed(1)}`);
    isOpen = true;
  };
  const flush = () => {
    if (some.length > 3) {
      const [low, high] = some.reduce(([a, b], each) => [each[1] < a[1] ? each : a, each[1] > b[1] ? each : b], [some[0], some[0]]);
      some = [some[0], ...(low[0] <= high[0] ? [low, high] : [high, low]), some.at(-1)];
    }
    for (const [px, py] of some) put(px, py);
    some = [];
  };
  let before = null;
  const first = Math.max(0, (Array.isArray(xs) ? 0 : placeAt(xs, x.ends[0])) - 1);
  for (let i = first; i < xs.length; i += 1) {
    const [px, py] = [x.toPixel(xs[i]), Math.max(-1e4, Math.min(1e4, y.toPixel(ys[i])))];
    if (!Number.isFinite(px) || !Number.isFinite(py)) {
      flush();
      [isOpen, before] = [false, null];
      continue;
    }
    const own = Math.floor(px);
    if (own !== column) flush();
    column = own;
    if (line.shape === "hv" && before) some.push([px, before[1]]);
    some.push([px, py]);
    before = [px, py];
    if (px > x.at[1] + 2) break;
  }
  flush();
  return svg("path", { d: parts.join(""), fill: "none", stroke: line.color, "stroke-width": line.width, "stroke-dasharray": DASHED[line.dash] || null, "stroke-linejoin": "round", opacity });
}

/** The outline of a sign of some size about a point. */
function signAt(symbol, px, py, size) {
  const r = size / 2;
  const at = (points) => `M${points.map(([a, b]) => `${(px + a * r).toFixed(1)} ${(py + b * r).toFixed(1)}`).join("L")}Z`;
  const kind = symbol.replace(/-(thin|open)/g, "");
  if (kind === "circle") return `M${(px - r).toFixed(1)} ${py.toFixed(1)}a${r} ${r} 0 1 0 ${size} 0a${r} ${r} 0 1 0 ${-size} 0`;
  if (kind === "x") return `M${(px - r).toFixed(1)} ${(py - r).toFixed(1)}l${size} ${size}m${-size} 0l${size} ${-size}`;
  if (kind === "cross" || kind === "star") return `M${(px - r).toFixed(1)} ${py.toFixed(1)}h${size}m${-r} ${-r}v${size}`;
  if (kind === "triangle-down") return at([[-1, -0.8], [1, -0.8], [0, 1]]);
  if (kind === "triangle-up") return at([[-1, 0.8], [1, 0.8], [0, -1]]);
  if (kind === "diamond") return at([[0, -1.2], [1.2, 0], [0, 1.2], [-1.2, 0]]);
  if (kind === "hexagon") return at([[-1, 0], [-0.5, -0.9], [0.5, -0.9], [1, 0], [0.5, 0.9], [-0.5, 0.9]]);
  return at([[-1, -1], [1, -1], [1, 1], [-1, 1]]);
}

/** Points as one path for each colour. */
function pointsOf({ x, y }, trace) {
  const { marker } = trace;
  const each = (value, i) => (Array.isArray(value) ? value[i] : value);
  const isOpen = /-open|^x/.test(marker.symbol ?? "");
  const groups = new Map();
  trace.x.forEach((value, i) => {
    const [px, py] = [x.toPixel(value), y.toPixel(trace.y[i])];
    if (!Number.isFinite(px) || !Number.isFinite(py)) return;
    const color = marker.cmin === undefined ? each(marker.color, i) : shadeOfValue(VIRIDIS, each(marker.color, i), marker.cmin, marker.cmax);
    const key = JSON.stringify([color, each(marker.line?.width, i) ?? 0, isFaded(trace, i)]);
    groups.set(key, (groups.get(key) ?? "") + signAt(marker.symbol ?? "circle", px, py, each(marker.size, i)));
  });
  return [...groups].map(([key, d]) => {
    const [color, width, faded] = JSON.parse(key);
    return svg("path", { d, fill: isOpen ? "none" : color, stroke: isOpen || width ? color : "none", "stroke-width": width || 1.5, opacity: faded ? 0.15 : null });
  });
}

function isFaded(trace, i) {
  return Boolean(trace.faded?.[i]);
}

function shadeOfValue(scale, value, low, high) {
  return shadeAt(scale, Math.round((SHADES_OF_COLOR * (value - low)) / (high - low || 1)) / SHADES_OF_COLOR);
}

function intervalsOf({ x, y }, { x: xs, y: ys, error_y: { array, arrayminus, width }, line }) {
  const d = xs.map((value, i) => {
    const [px, high, low] = [x.toPixel(value), y.toPixel(ys[i] + array[i]), y.toPixel(ys[i] - arrayminus[i])];
    return [high, low].every(Number.isFinite) ? `M${px} ${high}V${low}M${px - width} ${high}h${2 * width}M${px - width} ${low}h${2 * width}` : "";
  });
  return svg("path", { d: d.join(""), fill: "none", stroke: line.color, "stroke-width": 1.2 });
}

/** Cells as one path for each colour, the frame of the `open` one, [x, y], and their numbers. */
function cellsOf({ x, y }, { x: across, y: up, z, zmin, zmax, colorscale, colors, xgap, text, faded, open }) {
  const place = (axis, values) => (axis.words ? [...values.keys(), values.length].map((i) => i - 0.5) : edgesOfCells(axis, values)).map((edge) => axis.at[0] + ((edge - axis.ends[0]) / (axis.ends[1] - axis.ends[0])) * (axis.at[1] - axis.at[0]));
  const [xs, ys] = [place(x, across), place(y, up)];
  const gap = xgap ?? 0;
  const groups = new Map();
  const words = [];
  z.forEach((row, i) => row.forEach((value, j) => {
    if (value === null || !Number.isFinite(value)) return;
    const color = colors ? colors[value] : shadeOfValue(SCALES[colorscale], value, zmin, zmax);
    if (color === null) return;
    const key = JSON.stringify([color, Boolean(faded?.[i][j])]);
    groups.set(key, `${groups.get(key) ?? ""}M${(xs[j] + gap / 2).toFixed(1)} ${(ys[i] - gap / 2).toFixed(1)}H${(xs[j + 1] - gap / 2).toFixed(1)}V${(ys[i + 1] + gap / 2).toFixed(1)}H${(xs[j] + gap / 2).toFixed(1)}Z`);
    if (text?.[i][j]) words.push(svg("text", { x: (xs[j] + xs[j + 1]) / 2, y: (ys[i] + ys[i + 1]) / 2 + 4, "text-anchor": "middle", "font-size": 11, fill: isLight(colorscale, (value - zmin) / (zmax - zmin)) ? "#111" : "#fff" }, text[i][j]));
  }));
  const [i, j] = open ? [up.indexOf(open[1]), across.indexOf(open[0])] : [-1, -1];
  const frame = (inset, stroke) => svg("rect", { x: xs[j] + inset, y: ys[i + 1] + inset, width: Math.max(0, xs[j + 1] - xs[j] - 2 * inset), height: Math.max(0, ys[i] - ys[i + 1] - 2 * inset), fill: "none", stroke, "stroke-width": 2.5 });
  const frames = i < 0 || j < 0 ? [] : [frame(1.5, "#000"), frame(4, "#fff")];
  return [...[...groups].map(([key, d]) => svg("path", { d, fill: JSON.parse(key)[0], opacity: JSON.parse(key)[1] ? 0.25 : null })), ...frames, ...words];
}

/** Whether a colour is so light that words on it are dark; `share` is its place in the scale. */
function isLight(colorscale, share) {
  return colorscale === "Differences" ? Math.abs(share - 0.5) < 0.3 : share > 0.55;
}

// -- beside the axes --------------------------------------------------------------------------------------

/** The items of a legend in rows of a width. */
function rowsOfLegend(traces, width) {
  const rows = [[]];
  let used = 0;
  for (const trace of traces.filter((each) => each.name && each.showlegend !== false && each.name !== "open")) {
    const text = linesOf(trace.name)[0].plain;
    const wide = widthOf(text, 11) + 44;
    if (used && used + wide > width) {
      rows.push([]);
      used = 0;
    }
    rows.at(-1).push({ trace, text, wide });
    used += wide;
  }
  return rows.filter((row) => row.length);
}

function legendsOf(plot) {
  const { layout, margin, width, height } = plot;
  if (layout.showlegend === false) return [];
  return Object.entries(layout).filter(([name]) => /^legend\d*$/.test(name)).flatMap(([name, spec]) => {
    const rows = rowsOfLegend(plot.traces.filter((trace) => (trace.legend ?? "legend") === name), width - margin.l - margin.r);
    const bottom = height - margin.b - spec.y * (height - margin.t - margin.b) - 6;
    return rows.flatMap((row, k) => {
      let at = spec.xanchor === "right" ? width - margin.r - row.reduce((sum, { wide }) => sum + wide, 0) + 8 : margin.l;
      return row.flatMap(({ trace, text, wide }) => {
        const [x, y] = [at, bottom - 16 * (rows.length - 1 - k)];
        at += wide;
        const sign = trace.mode.includes("lines")
          ? svg("line", { x1: x, x2: x + 24, y1: y - 4, y2: y - 4, stroke: trace.line.color, "stroke-width": trace.line.width + 0.4, "stroke-dasharray": DASHED[trace.line.dash] || null })
          : svg("path", { d: signAt(trace.marker.symbol ?? "circle", x + 12, y - 4, 8), fill: /-open|^x/.test(trace.marker.symbol ?? "") ? "none" : shownColor(trace), stroke: shownColor(trace) });
        return [sign, svg("text", { x: x + 29, y, "font-size": 11 }, text)];
      });
    });
  });
}

function shownColor({ marker }) {
  return marker.cmin === undefined ? marker.color : VIRIDIS[5];
}

function noteOf({ axes: { x, y }, margin, width, height }, note) {
  const left = note.xref === "paper" ? margin.l + note.x * (width - margin.l - margin.r) : x.toPixel(note.x);
  const bottom = note.yref === "paper" ? height - margin.b - note.y * (height - margin.t - margin.b) - 4 : y.toPixel(note.y) + 4;
  const [{ plain, isBold }] = linesOf(note.text);
  const anchor = { left: "start", center: "middle", right: "end" }[note.xanchor];
  const text = svg("text", { x: left, y: bottom, "text-anchor": anchor, "font-size": note.font?.size ?? FONT.size, "font-weight": isBold ? 600 : null, fill: note.font?.color }, plain);
  if (note.bgcolor) for (const [name, value] of Object.entries({ stroke: note.bgcolor, "stroke-width": 4, "paint-order": "stroke" })) text.setAttribute(name, value);
  return text;
}

/** The bar of colours: at the right, or below where the page is narrow. */
function barOf({ width, height, margin }, trace) {
  const bar = trace.colorbar ?? trace.marker.colorbar;
  if (trace.showscale === false) return null;
  const [low, high] = trace.colorbar ? [trace.zmin, trace.zmax] : [trace.marker.cmin, trace.marker.cmax];
  const isFlat = bar.orientation === "h";
  const name = trace.colorscale ?? "Viridis";
  const scale = SCALES[name];
  const id = `shades-${name}`;
  const stops = scale.map((color, i) => svg("stop", { offset: i / (scale.length - 1), "stop-color": color }));
  const box = isFlat ? { x: margin.l, y: height - 44, width: width - margin.l - margin.r, height: 12 } : { x: width - margin.r + 14, y: margin.t, width: 14, height: height - margin.t - margin.b };
  const axis = { ends: [low, high], at: isFlat ? [box.x, box.x + box.width] : [box.y + box.height, box.y], id: isFlat ? "x" : "y", nticks: 6, tickformat: bar.tickformat, tickvals: bar.tickvals, ticktext: bar.ticktext };
  const at = (value) => axis.at[0] + ((value - low) / (high - low || 1)) * (axis.at[1] - axis.at[0]);
  const marks = ticksOf(axis).map(([value, text]) => svg("text", isFlat ? { x: at(value), y: box.y + 25, "text-anchor": "middle", "font-size": 11 } : { x: box.x + 18, y: at(value) + 4, "font-size": 11 }, text));
  const title = linesOf(bar.title.text)[0].plain;
  const words = isFlat ? svg("text", { x: box.x + box.width / 2, y: box.y - 5, "text-anchor": "middle" }, title) : svg("text", { transform: `translate(${width - 12} ${box.y + box.height / 2}) rotate(90)`, "text-anchor": "middle", y: 8 }, title);
  return svg("g", {}, svg("linearGradient", { id, ...(isFlat ? {} : { x1: 0, x2: 0, y1: 1, y2: 0 }) }, ...stops), svg("rect", { ...box, fill: `url(#${id})` }), ...marks, words);
}

// -- the pointer ------------------------------------------------------------------------------------------

function listenTo(holder, area, subplot, said) {
  const here = (event) => {
    const box = holder.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  area.onpointermove = (event) => say(holder, said, here(event), subplot);
  area.onpointerleave = () => { said.hidden = true; };
  area.onpointerdown = (event) => {
    if (event.button || event.pointerType === "touch") return;
    const from = here(event);
    const band = element("div", { className: "band" });
    const box = boxOfSubplot(subplot);
    const end = (then) => {
      const to = here(then);
      const isSpan = Boolean(holder.onspan);
      const [left, right] = [from[0], to[0]].sort((a, b) => a - b).map((px) => Math.max(box.x, Math.min(box.x + box.width, px)));
      const [top, bottom] = isSpan ? [box.y, box.y + box.height] : [from[1], to[1]].sort((a, b) => a - b).map((py) => Math.max(box.y, Math.min(box.y + box.height, py)));
      return { left, right, top, bottom };
    };
    const move = (then) => {
      const { left, right, top, bottom } = end(then);
      band.style = styleOf({ x: left, y: top, width: right - left, height: bottom - top });
      if (!band.parentElement && (holder.onspan || holder.onbox)) holder.append(band);
    };
    const stop = (then) => {
      window.removeEventListener("pointermove", move);
      window.removeEventListener("pointerup", stop);
      band.remove();
      const { left, right, top, bottom } = end(then);
      if (right - left > 6 && holder.onspan) holder.onspan(subplot.x.fromPixel(left), subplot.x.fromPixel(right));
      else if (right - left > 6 && bottom - top > 6 && holder.onbox) holder.onbox([subplot.x.fromPixel(left), subplot.x.fromPixel(right)], [subplot.y.fromPixel(bottom), subplot.y.fromPixel(top)]);
      else click(holder, from, subplot);
    };
    window.addEventListener("pointermove", move);
    window.addEventListener("pointerup", stop);
  };
  area.onclick = (event) => { if (event.pointerType === "touch") click(holder, here(event), subplot); };
}

/** A click chooses a point; the second of a double-click shows the whole: the first may have drawn the plot anew. */
function click(holder, at, subplot) {
  const before = holder.clicked ?? -Infinity;
  holder.clicked = performance.now();
  if (holder.onwhole && holder.clicked - before < DOUBLE_CLICK) return holder.onwhole();
  const found = holder.onspan ? { x: subplot.x.fromPixel(at[0]) } : nearest(subplot, at);
  if (found) holder.onpoint?.(found);
  return undefined;
}

/** The cell or the point at a place in pixels; undefined if none is near. */
function nearest({ x, y, traces }, [px, py]) {
  let [best, least] = [undefined, NEAR ** 2];
  for (const trace of traces) {
    if (!trace.said) continue;
    if (trace.type === "heatmap") {
      const place = (axis, values, pixel) => {
        const at = axis.fromPixel(pixel);
        return (axis.words ? [...values.keys(), values.length].map((i) => i - 0.5) : edgesOfCells(axis, values)).findIndex((edge, i, all) => i + 1 < all.length && at >= edge && at < all[i + 1]);
      };
      const [i, j] = [place(y, trace.y, py), place(x, trace.x, px)];
      const data = trace.customdata[i]?.[j];
      if (data !== null && data !== undefined) return { data, text: trace.said(i, j) };
    } else {
      for (let i = 0; i < trace.x.length; i += 1) {
        const distance = (x.toPixel(trace.x[i]) - px) ** 2 + (y.toPixel(trace.y[i]) - py) ** 2;
        if (distance < least) [best, least] = [{ data: trace.customdata?.[i], text: trace.said(i) }, distance];
      }
    }
  }
  return best;
}

/** Show what is at the pointer: of signals over time the values of all, else the point that is near. */
function say(holder, said, at, subplot) {
  const text = holder.onspan ? saidAt(holder.plot, subplot.x.fromPixel(at[0]), subplot.x) : nearest(subplot, at)?.text;
  said.hidden = !text;
  if (!text) return;
  said.replaceChildren(...linesOf(text).map(({ plain, isBold, isItalic }) => element("div", { textContent: plain, className: isBold ? "strong" : isItalic ? "soft" : "" })));
  const wide = said.offsetWidth;
  said.style.left = `${at[0] + 14 + wide > holder.clientWidth ? Math.max(0, at[0] - 14 - wide) : at[0] + 14}px`;
  said.style.top = `${Math.max(0, Math.min(holder.clientHeight - said.offsetHeight, at[1] + 10))}px`;
}

function saidAt({ traces }, t, { each, unit }) {
  const lines = traces.filter((trace) => trace.said && trace.x.length).map((trace) => trace.said(placeAt(trace.x, t), t)).filter(Boolean);
  return lines.length ? [`<b>${Number((each * t).toPrecision(5))} ${unit}</b>`, ...lines].join("<br>") : "";
}

/** Save a plot as a file. */
function savePlot(holder, name) {
  const text = new XMLSerializer().serializeToString(holder.querySelector("svg"));
  element("a", { href: `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`, download: name }).click();
}
