// Signals over time: a panel under the other over one axis of time, with the instant of the replay as a line.

const PANEL = 128;
const MARGIN = { l: 62, r: 14, t: 34, b: 44 };
const NARROW = 620;
const BARS = "who has computers and networks";

const timePlot = { signals: null, beside: null, shownPanels: new Map(), isDrawn: false };

/** Room between panels: on a narrow page the legend has a separate line under the title. */
function gap() {
  return byId("time-plot").clientWidth < NARROW ? 66 : 46;
}

function topMargin() {
  return MARGIN.t + gap() - 46;
}

/** The panels of a layout that are chosen. */
function panelsOf(layout) {
  return layout.panels.filter((panel) => timePlot.shownPanels.get(panel.title) ?? panel.shown);
}

/** Those of a run: of its layout, and of its computers and networks. */
function panelsOfRun(signals) {
  const bars = signals.bars ? [{ title: BARS, unit: null, lines: [], bars: signals.bars }] : [];
  return [...panelsOf(signals.layout), ...bars.filter(() => timePlot.shownPanels.get(BARS) ?? true)];
}

/** Draw them, `whole` with insets where peaks are clipped. */
function drawTimePlot(signals, beside, names, whole = true) {
  Object.assign(timePlot, { signals, beside, whole });
  const panels = panelsOfRun(signals);
  const height = topMargin() + MARGIN.b + panels.length * PANEL + (panels.length - 1) * gap();
  const byPanel = panels.map((panel, k) => tracesOf(panel, k, signals, beside, names));
  const peaks = byPanel.map((traces, k) => (whole && !panels[k].logarithmic && !panels[k].bars ? peakOf(traces) : null));
  const traces = [...byPanel.flat(), ...peaks.flatMap((peak, k) => (peak ? tracesOfInset(byPanel[k], peak, panels.length + 1 + k) : []))];
  const holder = byId("time-plot");
  holder.style.height = `${height}px`;
  holder.redraw = () => drawTimePlot(timePlot.signals, timePlot.beside, names, timePlot.whole);
  return drawPlot(holder, traces, timeLayout(panels, height, signals, peaks)).then(() => {
    if (!timePlot.isDrawn) listenToTimePlot(holder);
    timePlot.isDrawn = true;
    moveCursor();
  });
}

/** The pieces of a row are one line with gaps. */
function tracesOfBars({ rows, row, begin, end }, k) {
  const lines = rows.map(() => ({ x: [], y: [] }));
  for (let i = 0; i < row.length; i += 1) {
    lines[row[i]].x.push(begin[i], end[i], null);
    lines[row[i]].y.push(row[i], row[i], null);
  }
  return lines.map(({ x, y }, place) => ({
    x, y, name: escaped(rows[place]), yaxis: k ? `y${k + 1}` : "y", mode: "lines", showlegend: false, connectgaps: false,
    line: { color: COLORS[place % 8], width: Math.min(12, 90 / rows.length) }, said: (_, t) => (row.some((own, i) => own === place && begin[i] <= t && t <= end[i]) ? escaped(rows[place]) : ""),
  }));
}

function tracesOf(panel, k, signals, beside, names) {
  if (panel.bars) return tracesOfBars(panel.bars, k);
  const found = [];
  panel.lines.forEach((line, i) => {
    if (!(line.column in signals.columns)) return;
    found.push(traceOf(panel, line, i, k, signals, ""));
    if (beside && line.column in beside.columns && !line.reference) {
      found.push(traceOf(panel, line, i, k, beside, names[1]));
    }
  });
  return found;
}

function traceOf(panel, line, i, k, of, other) {
  const place = line.reference ? i - panel.lines.filter((each) => !each.reference).length : i;
  const alone = panel.lines.length === 1;
  const name = other ? `${line.label} (${other})` : line.label;
  const isNarrow = gap() > 46; // there is room for few words
  const inLegend = other || (line.reference ? (isNarrow ? "ref." : "reference") : line.label);
  return {
    x: of.time,
    y: of.columns[line.column],
    name: escaped(inLegend),
    yaxis: k ? `y${k + 1}` : "y",
    legend: k ? `legend${k + 1}` : "legend",
    showlegend: other ? place === 0 && !(isNarrow && k) : line.reference ? place === 0 : !alone,
    mode: "lines",
    opacity: other ? 0.75 : 1,
    line: {
      color: other ? (alone ? paint("beside") : COLORS[place % 8]) : COLORS[place % 8],
      width: line.reference || other ? 1.1 : 1.7,
      dash: other || line.reference ? "dot" : DASHES[place % 8],
      shape: line.held ? "hv" : "linear",
    },
    said: (i) => `${escaped(name)}: ${shown(Number((of.columns[line.column][i] ?? NaN).toPrecision(5)))}${escaped(afterNumber(panel.unit))}`,
  };
}

function timeLayout(panels, height, signals, peaks) {
  const inner = height - topMargin() - MARGIN.b;
  const isNarrow = gap() > 46;
  const { unit, each } = unitOfTimes(wholeSpan()[1]);
  const layout = {
    height, margin: { ...MARGIN, t: topMargin() }, annotations: [],
    xaxis: {
      title: { text: `time [${unit}]` }, unit, each, anchor: panels.length > 1 ? `y${panels.length}` : "y", showgrid: true,
      range: [signals.time[0], signals.time[signals.time.length - 1]],
    },
  };
  panels.forEach((panel, k) => {
    const top = 1 - (k * (PANEL + gap())) / inner;
    layout[k ? `yaxis${k + 1}` : "yaxis"] = {
      ...(panel.bars ? rowsOf(panel.bars) : {}), domain: [top - PANEL / inner, top], type: panel.logarithmic ? "log" : "linear", nticks: 5,
    };
    layout[k ? `legend${k + 1}` : "legend"] = {
      orientation: "h", x: isNarrow ? 0 : 1, xanchor: isNarrow ? "left" : "right", y: top + 2 / inner, yanchor: "bottom", font: { size: 11 },
    };
    if (peaks[k]) {
      const { axes: own, note } = layoutOfInset(peaks[k], panel.unit, panels.length + 1 + k, top, inner);
      Object.assign(layout, own);
      layout.annotations.push(note);
      layout[k ? `yaxis${k + 1}` : "yaxis"].range = peaks[k].range;
    }
    layout.annotations.push({
      text: `<b>${escaped(titled(panel.title, panel.unit))}</b>`, x: 0, xref: "paper", xanchor: "left",
      y: top + (isNarrow && (panel.lines.length > 1 || (timePlot.beside && !k)) ? 22 : 3) / inner, yref: "paper", yanchor: "bottom", showarrow: false,
    });
  });
  return layout;
}

/** An axis with a row for each task and message, the first on top. */
function rowsOf({ rows }) {
  return { tickvals: rows.map((_, place) => place), ticktext: rows.map((name) => escaped(name.slice(name.indexOf(".") + 1))), range: [rows.length - 0.5, -0.5], tickfont: { size: 9 }, zeroline: false };
}

function listenToTimePlot(holder) {
  holder.onpoint = ({ x }) => setTime(x);
  holder.onspan = showSpan;
  holder.onwhole = () => showSpan(...wholeSpan());
}

function wholeSpan() {
  const time = timePlot.signals.time;
  return [time[0], time[time.length - 1]];
}

/** Show the signals from one time to another, within the run, each panel scaled to its visible part. */
function showSpan(from, to) {
  const [first, last] = wholeSpan();
  if (from <= first && to >= last) return redrawSignals();
  if (timePlot.whole) redrawSignals(false); // who looks closer sees peaks where they are
  const range = [Math.max(first, from), Math.min(last, to)];
  const { data, layout } = byId("time-plot");
  layout.xaxis.range = range;
  panelsOfRun(timePlot.signals).forEach((panel, k) => {
    if (panel.bars) return;
    const own = k ? `y${k + 1}` : "y";
    layout[axisName(own)].range = seenRange(data.filter((trace) => trace.yaxis === own), range, panel.logarithmic) ?? layout[axisName(own)].range;
  });
  return drawTraces(byId("time-plot"), data, layout).then(moveCursor);
}

/** The range of the traces in a span of time, with some margin; null without values. */
function seenRange(traces, [from, to], isLogarithmic) {
  let [low, high] = [Infinity, -Infinity];
  for (const { x, y } of traces) {
    for (let i = placeAt(x, from); i < x.length && x[i] <= to; i += 1) {
      const value = isLogarithmic ? Math.log10(y[i]) : y[i];
      if (!Number.isFinite(value)) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  }
  if (low > high) return null;
  const air = 0.06 * (high - low) || 0.5 * Math.abs(high) || 1;
  return [low - air, high + air];
}

/** Save the visible part as a picture. */
function saveSignals() {
  savePlot(byId("time-plot"), "signals.svg");
}

/** Zoom about the instant of the replay. */
function zoomTime(factor) {
  const range = byId("time-plot").layout.xaxis.range;
  const half = (factor * (range[1] - range[0])) / 2;
  return showSpan(player.t - half, player.t + half);
}

function moveCursor() {
  const { plot } = byId("time-plot");
  const cursor = byId("cursor");
  if (!plot) return;
  const { x } = plot.axes;
  const at = x.toPixel(player.t);
  cursor.style.display = at >= x.at[0] - 0.5 && at <= x.at[1] + 0.5 ? "block" : "none";
  cursor.style.left = `${at}px`;
  cursor.style.top = `${topMargin()}px`;
  cursor.style.height = `${plot.height - topMargin() - MARGIN.b}px`;
}
