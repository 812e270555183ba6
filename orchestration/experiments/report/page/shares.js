// Shares of runs that are good, with their intervals.

const shares = { of: 0 };

function startShares() {
  if (report.kind !== "study" || !report.shares.length) return;
  byId("shares").hidden = false;
  byId("shares-title").textContent = `Share that is ${report.words[0]}`;
  byId("shares-controls").replaceChildren(choice("along", report.shares.map((each, i) => [i, each.axis]), 0, (i) => { shares.of = Number(i); drawShares(); }));
  redraws.push(drawShares);
  drawShares();
}

function drawShares() {
  const { axis, unit, logarithmic, shares: found } = report.shares[shares.of];
  byId("shares-plot").redraw = drawShares;
  const about = found.some((each) => each.low !== null) ? "Bars: Wilson intervals at 95 %." : "Runs at chosen values are counted together, which are not drawn by chance, so that the shares have no interval.";
  byId("shares-text").textContent = `All runs: ${shareText(report.overall)}. ${about}`;
  const isNumber = found.every((each) => each.value !== null);
  const other = report.other?.shares.find((each) => each.axis === axis);
  const traces = [traceOfShares(report.title, axis, unit, found, isNumber, 0)];
  if (other) traces.push(traceOfShares(report.other.name, axis, unit, other.shares, isNumber, 1));
  const layout = {
    height: 270, margin: { l: 60, r: 10, t: other ? 26 : 10, b: 48 }, legend: { x: 0, y: 1, isAbove: true }, showlegend: Boolean(other),
    xaxis: { title: { text: escaped(titled(axis, unit)) }, type: isNumber ? (logarithmic ? "log" : "linear") : "category", zeroline: false },
    yaxis: { title: { text: `share ${escaped(report.words[0])}` }, range: [-0.03, 1.03], tickformat: ".0%", zeroline: false },
  };
  drawPlot(byId("shares-plot"), traces, layout);
  const rowOf = (each, name) => [name + each.label, `${each.good} of ${each.runs}`, percent(each.good / each.runs), each.low === null ? "–" : `${percent(each.low)} to ${percent(each.high)}`];
  const rows = [...found.map((each) => rowOf(each, other ? `${report.title}: ` : "")), ...(other?.shares ?? []).map((each) => rowOf(each, `${report.other.name}: `))];
  byId("shares-table").replaceChildren(tableOf(rows, [titled(axis, unit), report.words[0], "share", "95 % interval"]));
}

function traceOfShares(name, axis, unit, found, isNumber, place) {
  const share = found.map((each) => each.good / each.runs);
  const has = found.some((each) => each.low !== null);
  return {
    type: "scatter", mode: isNumber ? "lines+markers" : "markers", name: escaped(name), x: found.map((each) => (isNumber ? each.value : each.label)), y: share,
    line: { color: COLORS[place], width: 1.2, dash: DASHES[place] }, marker: { symbol: SHAPES[place], size: 7, color: COLORS[place] },
    said: (i) => `${escaped(name)}, ${escaped(axis)} ${escaped(found[i].label)}${escaped(afterNumber(unit))}<br>${escaped(shareText(found[i]))}`,
    ...(has ? { error_y: { array: found.map((each, i) => each.high - share[i]), arrayminus: found.map((each, i) => share[i] - each.low), width: 4 } } : {}),
  };
}

// -- the cells of a comparison ----------------------------------------------------------------------------

/** Shares over the axis, a line for each controller, with their intervals. */
function drawSharesOfCells() {
  const { controllers, label: axis, unit } = report.compared;
  byId("shares-plot").redraw = drawSharesOfCells;
  byId("shares").hidden = false;
  byId("shares-title").textContent = "Shares that survive and settle, with 95 % intervals";
  byId("shares-text").textContent = "Wilson intervals, over the starts of each cell. Lines: those that survive; dots: those that settle by the horizon.";
  const traces = controllers.flatMap((controller, i) => {
    const found = cellsHere().filter((cell) => cell.controller === controller);
    return [["survives", "survive", "lines+markers"], ["settles", "settle", "markers"]].map(([key, word, mode]) => {
      const share = found.map((cell) => cell[key].good / cell[key].runs);
      return {
        type: "scatter", mode, name: escaped(controller), showlegend: key === "survives", x: found.map((cell) => cell.value), y: share,
        line: { color: COLORS[i % 8], dash: DASHES[i % 8], width: 1.6 }, marker: { symbol: SHAPES[i % 8] + (key === "settles" ? "-open" : ""), size: 7, color: COLORS[i % 8] },
        said: (k) => `${escaped(controller)}, ${withUnit(found[k].value, unit)}<br>${escaped(shareText(found[k][key], word))}`,
        error_y: { array: found.map((cell, k) => cell[key].high - share[k]), arrayminus: found.map((cell, k) => share[k] - cell[key].low), width: 3 },
      };
    });
  });
  const layout = {
    height: 330, margin: { l: 60, r: 10, t: 26, b: 48 }, legend: { x: 0, y: 1, isAbove: true },
    xaxis: { title: { text: escaped(titled(axis, unit)) }, zeroline: false },
    annotations: namesOnLines(controllers.map((controller) => cellsHere().filter((cell) => cell.controller === controller))),
    yaxis: { title: { text: "share of the starts" }, range: [-0.03, 1.03], tickformat: ".0%", zeroline: false },
  };
  drawPlot(byId("shares-plot"), traces, layout);
  const rows = cellsHere().map((cell) => [`${cell.controller}, ${withUnit(cell.value, unit)}`, `${cell.survives.good} of ${cell.survives.runs}`, `${percent(cell.survives.low)} to ${percent(cell.survives.high)}`, String(cell.settles.good), `${percent(cell.settles.low)} to ${percent(cell.settles.high)}`]);
  byId("shares-table").replaceChildren(tableOf(rows, ["cell", "survive", "95 % interval", "settle", "95 % interval"]));
}

/** Names on the lines of survival at different heights: the earlier a line falls, the lower, as in figures. */
function namesOnLines(groups) {
  const mean = (group) => group.reduce((sum, cell) => sum + cell.survives.good / cell.survives.runs, 0) / group.length;
  const ordered = groups.filter((group) => group.length).sort((a, b) => mean(a) - mean(b));
  return ordered.map((group, k) => {
    const height = 0.1 + (0.8 * (2 * k + 1)) / (2 * ordered.length);
    const share = group.map((cell) => cell.survives.good / cell.survives.runs);
    const below = share.findIndex((each, i) => i > 0 && each < height && share[i - 1] >= height);
    const last = group.length - 1;
    const along = below > 0 ? (share[below - 1] - height) / (share[below - 1] - share[below]) : 0;
    const x = below > 0 ? group[below - 1].value + along * (group[below].value - group[below - 1].value) : group[last].value;
    return {
      x, y: below > 0 ? height : share[last], text: escaped(group[0].controller), showarrow: false, xanchor: below > 0 ? "center" : "right",
      font: { size: 11, color: COLORS[report.compared.controllers.indexOf(group[0].controller) % 8] }, bgcolor: paint("paper"),
    };
  });
}

const cells = { place: 0, open: null };

/** The existing pairs of vehicle and condition. */
function placesOfCells() {
  const names = report.compared.cells.map((cell) => JSON.stringify([cell.vehicle, cell.condition]));
  return [...new Set(names)].map((text) => JSON.parse(text));
}

function startCells() {
  byId("map").hidden = false;
  byId("map-title").textContent = "Share of the starts that survives";
  const plot = byId("map-plot");
  plot.setAttribute("aria-label", "Cells of the comparison. Arrow keys open the neighbouring cell.");
  plot.addEventListener("keydown", stepOverCells);
  map.metric = columnsByName.get(report.metric) ?? drawable[0];
  const places = placesOfCells();
  byId("map-controls").replaceChildren();
  if (places.length > 1) {
    byId("map-controls").append(choice("Vehicle and condition", places.map((pair, i) => [i, pair.join(", ")]), 0, (i) => { cells.place = Number(i); drawCells(); drawSharesOfCells(); openCell(cellsHere()[0]); }));
  }
  byId("map-hint").textContent = `One row a controller, numbers in per cent. Click a cell, or move with the arrow keys, to see its runs below; hover for its 95 % interval.`;
  redraws.push(drawCells, drawSharesOfCells, drawRunsOfCell);
  return drawCells();
}

function cellsHere() {
  const [vehicle, condition] = placesOfCells()[cells.place];
  return report.compared.cells.filter((cell) => cell.vehicle === vehicle && cell.condition === condition);
}

function hoverOfCell(cell) {
  const { label: axis, unit } = report.compared;
  const medians = Object.entries(cell.medians).map(([name, [value, low, high]]) => `${escaped(report.labels[name] ?? name)}: ${withUnit(value, report.units[name])}${low === null || high === null ? "" : ` (${shown(low)} to ${shown(high)})`}`);
  return [`<b>${escaped(cell.controller)}, ${escaped(axis)} ${withUnit(cell.value, unit)}</b>`, escaped(shareText(cell.survives, "survive")), escaped(shareText(cell.settles, "settle")), "<i>medians of those that survive, with their 95 % intervals</i>", ...medians].join("<br>");
}

function drawCells() {
  const { controllers, label: axis, unit } = report.compared;
  const here = cellsHere();
  const values = [...new Set(here.map((cell) => cell.value))].sort((a, b) => a - b);
  const rows = [...controllers].reverse();
  const at = (controller, value) => here.find((cell) => cell.controller === controller && cell.value === value);
  const table = (make) => rows.map((controller) => values.map((value) => { const cell = at(controller, value); return cell ? make(cell) : null; }));
  const room = byId("map-plot").clientWidth > 42 * values.length + 180;
  const heat = {
    type: "heatmap", x: values, y: rows, z: table((cell) => cell.survives.good / cell.survives.runs), zmin: 0, zmax: 1, colorscale: "Cividis", xgap: 1,
    text: table((cell) => (room ? String(Math.round((100 * cell.survives.good) / cell.survives.runs)) : "")), open: here.includes(cells.open) && [cells.open.value, cells.open.controller],
    customdata: table((cell) => cell.number), said: (i, j) => hoverOfCell(at(rows[i], values[j])),
    colorbar: { tickformat: ".0%", title: { text: "share that survives" } },
  };
  const layout = {
    height: Math.max(220, 110 + 42 * rows.length), margin: { l: 20, r: 10, t: 10, b: 50 },
    xaxis: { title: { text: escaped(titled(axis, unit)) }, zeroline: false, showgrid: false }, yaxis: { type: "category", showgrid: false },
  };
  const holder = byId("map-plot");
  holder.redraw = drawCells;
  holder.onpoint = ({ data }) => openCell(report.compared.cells.find((cell) => cell.number === data));
  return drawPlot(holder, [heat], layout);
}

function stepOverCells(event) {
  const [dx, dy] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key] ?? [0, 0];
  if (!dx && !dy) return;
  event.preventDefault();
  const here = cellsHere();
  const { controllers } = report.compared;
  const values = [...new Set(here.map((cell) => cell.value))].sort((a, b) => a - b);
  const open = cells.open ?? here[0];
  const [i, j] = [controllers.indexOf(open.controller) + dy, values.indexOf(open.value) + dx];
  const next = here.find((cell) => cell.controller === controllers[i] && cell.value === values[j]);
  if (next) openCell(next);
}

/** Show the runs of a cell over the size of their initial error, and open the first with signals in the file. */
function openCell(cell) {
  if (!cell) return;
  cells.open = cell;
  drawCells();
  byId("cell").hidden = false;
  byId("cell-title").textContent = `${cell.controller}, ${report.compared.label} ${withUnit(cell.value, report.compared.unit)}`;
  byId("cell-text").textContent = `${shareText(cell.survives, "survive")}, ${shareText(cell.settles, "settle")}. Each point is a run; click one, or use the arrow keys, to open it.`;
  map.rows = rowsOfCell(cell);
  map.x = columnsByName.get("size of the initial error");
  map.y = VALUE;
  measureSlider();
  byId("cell-controls").replaceChildren(choice("Metric", drawable.map((column) => [column.name, column.label]), map.metric.name, (name) => { map.metric = columnsByName.get(name); drawRunsOfCell(); }));
  drawRunsOfCell().then(() => openRow(firstOf(map.rows)));
}

/** The first of some rows that is good and has signals in the file, or else that has signals. */
function firstOf(rows) {
  const there = rows.filter((row) => runOfRow(row));
  return there.find((row) => kindOf(outcomeOf(row)) === "good") ?? there[0] ?? rows[0];
}

function rowsOfCell(cell) {
  const same = [["vehicle", cell.vehicle], ["condition", cell.condition], ["controller", cell.controller]].map(([name, word]) => [columnsByName.get(name), word]);
  const axis = columnsByName.get(report.compared.axis);
  const value = Math.fround(cell.value);
  const found = [];
  for (let row = 0; row < report.table.count; row += 1) {
    if (cellOf(axis, row) === value && same.every(([column, word]) => String(cellOf(column, row)) === word)) found.push(row);
  }
  return found;
}

function drawRunsOfCell() {
  const holder = byId("cell-plot");
  const layout = { ...mapLayout(), height: 260, margin: { l: 66, r: 10, t: 26, b: 50 } };
  holder.redraw = drawRunsOfCell;
  holder.onpoint = ({ data }) => data !== undefined && openRow(data);
  return drawPlot(holder, [...tracesOfCell(), chosenTrace()], layout).then(() => {
    if (cells.hasRuns) return;
    cells.hasRuns = true;
    holder.setAttribute("aria-label", "Runs of the cell. Arrow keys open the neighbouring run.");
    holder.addEventListener("keydown", stepOnMap);
  });
}

function markInCell(row) {
  map.row = row;
  if (!cells.hasRuns) return;
  const holder = byId("cell-plot");
  drawTraces(holder, [...holder.data.slice(0, -1), chosenTrace()], holder.layout);
}
