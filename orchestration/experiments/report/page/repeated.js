// The map of a study that repeats: shares of its cells with their intervals, and the difference of two laws.

const repeated = { map: 0, rows: null };

function startRepeated() {
  const { maps } = report.repeated;
  repeated.map = maps.length - 1;
  byId("map").hidden = false;
  byId("map-title").textContent = "Map of the cells";
  const plot = byId("map-plot");
  plot.setAttribute("aria-label", "Cells of the study. Arrow keys open the neighbouring cell.");
  plot.addEventListener("keydown", stepOverRepeated);
  map.metric = columnsByName.get(report.metric) ?? drawable[0];
  if (maps.length > 1) {
    byId("map-controls").append(choice("Map", maps.map((each, i) => [i, each.title]), repeated.map, (i) => {
      const { x, y } = cells.open;
      repeated.map = Number(i);
      openRepeated(repeatedHere().find((cell) => cell.x === x && cell.y === y) ?? firstRepeated());
    }));
  }
  const dots = maps.at(-1).is_difference ? " Dots: the 95 % interval of the difference (Newcombe) excludes 0." : "";
  byId("map-hint").textContent = `Each cell is all runs that differ in ${report.kind === "comparison" ? "their start" : "what repeats"} alone.${dots} Hover for its interval; click, or move with the arrow keys, to see its runs below.`;
  redraws.push(drawRepeated, drawRunsOfCell);
  return drawRepeated();
}

function repeatedHere() {
  return report.repeated.maps[repeated.map].cells;
}

/** The cell that is open at first: where the laws differ most, or half of the runs are good. */
function firstRepeated() {
  const { is_difference: isDifference, cells: here } = report.repeated.maps[repeated.map];
  const apart = (cell) => (isDifference ? -Math.abs(cell.value) : Math.abs(cell.value - 0.5));
  return here.filter((cell) => cell.low !== null).sort((a, b) => apart(a) - apart(b))[0] ?? here[0];
}

function drawRepeated() {
  const { across, up, maps } = report.repeated;
  const { is_difference: isDifference, cells: here } = maps[repeated.map];
  const [x, y] = [columnsByName.get(across), columnsByName.get(up)];
  const different = (values) => (typeof values[0] === "string" ? [...new Set(values)] : [...new Set(values)].sort((a, b) => a - b));
  const [columns, rows] = [different(here.map((cell) => cell.x)), different(here.map((cell) => cell.y))];
  const at = (i, j) => here.find((cell) => cell.x === columns[j] && cell.y === rows[i]);
  const table = (make) => rows.map((_, i) => columns.map((__, j) => { const cell = at(i, j); return cell ? make(cell) : null; }));
  const room = byId("map-plot").clientWidth > (isDifference ? 58 : 46) * columns.length + 180;
  const marked = isDifference ? here.filter((cell) => cell.low > 0 || cell.high < 0) : [];
  const alone = room ? [] : marked;
  const heat = {
    type: "heatmap", x: columns, y: rows, z: table((cell) => cell.value), zmin: isDifference ? -1 : 0, zmax: 1, xgap: 1, open: cells.open && [cells.open.x, cells.open.y],
    colorscale: isDifference ? "Differences" : "Cividis", text: table((cell) => (room ? cell.text + (marked.includes(cell) ? " ●" : "") : "")),
    customdata: table((cell) => here.indexOf(cell)), said: (i, j) => hoverOfRepeated(at(i, j)),
    colorbar: { tickformat: ".0%", title: { text: isDifference ? "difference of the shares" : "share" }, ...(isNarrowMap() ? { orientation: "h" } : {}) },
  };
  const dots = { type: "scatter", mode: "markers", x: alone.map((cell) => cell.x), y: alone.map((cell) => cell.y), showlegend: false, marker: { symbol: "circle", size: 7, color: "#000", line: { width: 1, color: "#fff" } } };
  const layout = {
    height: isNarrowMap() ? 520 : 430, margin: { l: 66, r: 10, t: 10, b: isNarrowMap() ? 120 : 50 }, showlegend: false,
    xaxis: { ...axisLayout(x), showgrid: false }, yaxis: { ...axisLayout(y), showgrid: false },
  };
  const holder = byId("map-plot");
  holder.redraw = drawRepeated;
  holder.onpoint = ({ data }) => openRepeated(here[data]);
  return drawPlot(holder, [heat, dots], layout);
}

function hoverOfRepeated(cell) {
  return `<b>${escaped(placeOfRepeated(cell))}</b><br>${escaped(cell.said)}`;
}

function placeOfRepeated(cell) {
  const [x, y] = [report.repeated.across, report.repeated.up].map((name) => columnsByName.get(name));
  return `${x.label} ${withUnit(cell.x, x.unit)}, ${y.label} ${typeof cell.y === "string" ? cell.y : withUnit(cell.y, y.unit)}`;
}

function stepOverRepeated(event) {
  const [dx, dy] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [0, 0];
  if (!dx && !dy) return;
  event.preventDefault();
  const here = repeatedHere();
  const next = (key, value, step) => {
    const values = [...new Set(here.map((cell) => cell[key]))];
    if (typeof value !== "string") values.sort((a, b) => a - b);
    return values[values.indexOf(value) + step];
  };
  const [x, y] = [next("x", cells.open.x, dx), next("y", cells.open.y, dy)];
  const found = here.find((cell) => cell.x === x && cell.y === y);
  if (found) openRepeated(found);
}

/** Show the runs of a cell over the axis that repeats, and open one. */
function openRepeated(cell) {
  cells.open = cell;
  drawRepeated();
  byId("cell").hidden = false;
  byId("cell-title").textContent = placeOfRepeated(cell);
  const beside = cell.others.length ? ` Those of ${report.other.name} a report of that study alone opens.` : "";
  const click = cell.runs.length ? `; click one${beside && ` of ${report.title}`}, or use the arrow keys, to open it` : "";
  const hint = `Each point is a run${click}.${beside}`;
  byId("cell-text").textContent = `${cell.said}. ${hint}`;
  map.rows = cell.runs.map(rowOfIndex).filter((row) => row !== undefined);
  map.x = axes.findLast((axis) => ![report.repeated.across, report.repeated.up].includes(axis.name) && !axis.words) ?? axes.at(-1);
  map.y = VALUE;
  measureSlider();
  byId("cell-controls").replaceChildren(choice("Metric", drawable.map((column) => [column.name, column.label]), map.metric.name, (name) => { map.metric = columnsByName.get(name); drawRunsOfCell(); }));
  drawRunsOfCell().then(() => openRow(firstOf(map.rows)));
}

/** The runs of the open cell, and those of a second study or law with marks of their own. */
function tracesOfCell() {
  const { others } = cells.open;
  const different = (axis) => [...new Set(map.rows.map((row) => cellOf(axis, row)))];
  const law = axes.find((axis) => axis.words && axis !== map.x && different(axis).length === 2);
  if (law && !report.other) {
    return different(law).flatMap((name, i) => pointTraces(footOf(heights()), map.rows.filter((row) => cellOf(law, row) === name), `${name.split("/").at(-1)}: `, i ? [MARKS_OF_OTHER, COLORS[2]] : undefined));
  }
  if (!others?.length) return pointTraces();
  const wanted = new Set(others);
  return tracesOfBoth((at) => wanted.has(at("design_index")), false);
}

/** The row of the table of a run by its index in the design. */
function rowOfIndex(index) {
  if (!repeated.rows) {
    const column = columnsByName.get("design_index");
    repeated.rows = new Map([...Array(report.table.count).keys()].map((row) => [cellOf(column, row), row]));
  }
  return repeated.rows.get(index);
}

/** All cells of all maps, with their intervals. */
function startTableOfRepeated() {
  byId("shares").hidden = false;
  byId("shares-title").textContent = "The cells as a table";
  byId("shares-text").textContent = "Shares with Wilson intervals at 95 %, differences with those of Newcombe for pairs of runs with the same seed or start; none where nothing is random.";
  byId("shares-plot").hidden = true;
  const rows = report.repeated.maps.flatMap(({ title, cells: here }) => here.map((cell) => [`${title}: ${placeOfRepeated(cell)}`, cell.said]));
  byId("shares-table").replaceChildren(tableOf(rows, ["cell", "share and interval"]));
}
