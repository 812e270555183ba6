// Short peaks that would flatten the rest: clipped in their panel, with a note, and shown in full in an inset, as in
// figures.

const { OUTSIDE, CLIPPED } = FIGURES.PEAKS;

/** The range of a signal but for a small share of the time. */
function withoutPeaks({ x, y }) {
  const order = [...y.keys()].filter((i) => Number.isFinite(y[i])).sort((a, b) => y[a] - y[b]);
  const held = (i) => (i + 1 < x.length ? x[i + 1] - x[i] : 0);
  const total = order.reduce((sum, i) => sum + held(i), 0) || 1;
  const at = (share) => {
    let gone = 0;
    for (const i of order) {
      gone += held(i);
      if (gone / total >= share) return y[i];
    }
    return y[order.at(-1)];
  };
  return [at(OUTSIDE), at(1 - OUTSIDE)];
}

/** The visible range of the traces of a panel, and the clipped peak; null if no peak hides the rest. */
function peakOf(traces) {
  const known = traces.filter(({ y }) => y.some(Number.isFinite));
  if (!known.length) return null;
  const inner = known.map(withoutPeaks);
  const [low, high] = [Math.min(...inner.map(([a]) => a)), Math.max(...inner.map(([, b]) => b))];
  const [bottom, top] = known.reduce(([a, b], { y }) => y.reduce(([c, d], value) => (Number.isFinite(value) ? [Math.min(c, value), Math.max(d, value)] : [c, d]), [a, b]), [Infinity, -Infinity]);
  if (high <= low || top - bottom <= CLIPPED * (high - low)) return null;
  const air = 0.25 * (high - low);
  const isOut = (value) => value < low - air || value > high + air;
  let [first, last, peak, time] = [Infinity, -Infinity, 0, 0];
  for (const { x, y } of known) {
    for (let i = 0; i < x.length; i += 1) {
      if (Number.isFinite(y[i]) && isOut(y[i])) [first, last] = [Math.min(first, x[i]), Math.max(last, x[i])];
      if (Math.abs(y[i]) > Math.abs(peak)) [peak, time] = [y[i], x[i]];
    }
  }
  const [from, to] = [Math.max(bottom, low - air), Math.min(top, high + air)];
  return { range: [from - 0.05 * (to - from), to + 0.9 * (to - from)], peak, time, span: [first, last] };
}

/** The traces of an inset: what is near its peak. */
function tracesOfInset(traces, { span: [first, last] }, number) {
  const all = traces[0].x;
  const width = Math.max(last - first, 0.01 * (all[all.length - 1] - all[0]));
  const [from, to] = [first - 0.15 * width, last + 0.4 * width];
  return traces.map(({ x, y, line, opacity }) => {
    const near = [Math.max(0, placeAt(x, from)), Math.min(x.length, placeAt(x, to) + 2)];
    return {
      x: x.slice(...near), y: y.slice(...near), line: { ...line, width: 1.1 }, opacity, mode: "lines", showlegend: false,
      xaxis: `x${number}`, yaxis: `y${number}`,
    };
  });
}

/** The place and the note of an inset in the panel whose upper edge is at `top` of a plot of this height in pixels. */
function layoutOfInset({ peak, time }, unitOfPeak, number, top, inner) {
  const { unit, each } = unitOfTimes(wholeSpan()[1]);
  const left = gap() > 46 ? 0.42 : 0.58;
  const [low, high] = [top - (0.54 * PANEL) / inner, top - (0.2 * PANEL) / inner];
  const axis = { showgrid: false, zeroline: false, tickfont: { size: 9 }, fixedrange: true, linecolor: paint("edge"), showline: true };
  return {
    axes: {
      [`xaxis${number}`]: { ...axis, domain: [left, 0.995], anchor: `y${number}`, nticks: 5, each },
      [`yaxis${number}`]: { ...axis, domain: [low, high], anchor: `x${number}`, nticks: 3 },
    },
    note: {
      text: `clipped: peak ${shown(Number(peak.toPrecision(4)))}${escaped(afterNumber(unitOfPeak))} at ${shown(Number((each * time).toPrecision(3)))} ${unit}`.replace("-", "−"),
      x: 0.995, xref: "paper", xanchor: "right", y: high, yref: "paper", yanchor: "bottom", showarrow: false, font: { size: 10 },
    },
  };
}
