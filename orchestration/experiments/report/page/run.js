// The run that is open: what it is, its replay, its signals.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];
const player = { t: 0, speed: 1, isPlaying: false, run: null, beside: null, last: 0 };
const controlsOf = {};

function startRun() {
  startScene(byId("scene"));
  redraws.push(drawScene, redrawSignals);
  buildPlayer();
  buildSignalControls();
  buildRunControls();
}

/** The runs of the slider: those with signals, in a comparison those of the open cell, in a study those of the box. */
function sliderRuns() {
  return cells.open ? map.rows.map(runOfRow).filter(Boolean) : map.inside ? [...map.inside].map(runOfRow).filter(Boolean) : report.runs;
}

/** The slider over the current runs. */
function measureSlider() {
  if (!controlsOf.slider) return;
  const count = sliderRuns().length;
  Object.assign(controlsOf.slider, { max: Math.max(0, count - 1), disabled: count < 2 });
  controlsOf.over.textContent = cells.open ? `${count} of the cell` : map.inside ? `${count} of the box` : report.table ? "Flights" : "Runs";
}

function buildRunControls() {
  const controls = byId("run-controls");
  const runs = sliderRuns();
  if (runs.length > 1) {
    const slider = element("input", { type: "range", min: 0, max: runs.length - 1, value: 0, step: 1 });
    slider.oninput = () => openPlace(Number(slider.value));
    controlsOf.slider = slider;
    controlsOf.over = element("span");
    controls.append(
      button("‹", () => openPlace(placeOpen() - 1), { ariaLabel: "Previous run" }),
      element("label", { className: "wide" }, controlsOf.over, slider),
      button("›", () => openPlace(placeOpen() + 1), { ariaLabel: "Next run" }),
    );
    measureSlider();
  }
  if (report.table) {
    const number = element("input", { type: "number", min: 0, step: 1 });
    number.onchange = () => openIndex(Number(number.value));
    controlsOf.number = number;
    controls.append(element("label", {}, "Run", number));
  } else if (runs.length > 1) {
    controlsOf.name = choice("Run", runs.map((run, i) => [i, run.name]), 0, (i) => openPlace(Number(i))).select;
    controls.append(controlsOf.name.parentElement);
  }
  if (runs.length > 1 && runs.length <= 300) {
    const chosen = choice("Beside it", [], "", (i) => { player.beside = i === "" ? null : report.runs[i]; showSignals(); });
    controlsOf.beside = chosen.select;
    controls.append(chosen);
    if (!report.table) player.beside = runs[1];
  } else if (runs.length > 1) {
    controlsOf.keep = button("Keep beside the next", () => { player.beside = player.beside ? null : player.run; showSignals(); nameKeeping(); });
    controls.append(controlsOf.keep);
  }
}

/** The runs that may be drawn beside the open one, which is replaced by the one before it. */
function offerBeside(opened) {
  const before = player.run;
  if (player.beside === opened && opened) player.beside = before === opened ? null : before;
  if (!controlsOf.beside) return;
  const others = report.runs.map((run, i) => [run, i]).filter(([run]) => run !== opened);
  controlsOf.beside.replaceChildren(element("option", { value: "", textContent: "none" }), ...others.map(([run, i]) => element("option", { value: i, textContent: run.name })));
  controlsOf.beside.value = player.beside ? report.runs.indexOf(player.beside) : "";
}

function nameKeeping() {
  if (!controlsOf.keep) return;
  controlsOf.keep.textContent = player.beside ? `Beside: ${player.beside.name} – take away` : "Keep beside the next";
  controlsOf.keep.setAttribute("aria-pressed", String(Boolean(player.beside)));
}

function placeOpen() {
  return Math.max(0, sliderRuns().indexOf(player.run));
}

function openPlace(place) {
  const runs = sliderRuns();
  const run = runs[Math.max(0, Math.min(runs.length - 1, place))];
  if (!run) return;
  if (report.table) openIndex(run.index);
  else openRun(run, null);
}

let rowsByIndex = null;

/** Open a run of a study by its number in the design. */
function openIndex(index) {
  if (!rowsByIndex) rowsByIndex = new Map([...numbersOf(columnsByName.get("design_index").values)].map((each, row) => [each, row]));
  if (rowsByIndex.has(index)) openRow(rowsByIndex.get(index));
}

function openRow(row) {
  if (row === null || row === undefined) return;
  openRun(runOfRow(row) ?? null, row);
  if (report.compared || report.repeated) markInCell(row);
  else markOnMap(row);
}

/** Open a run; without its signals, show its row of the table. */
function openRun(run, row) {
  stop();
  offerBeside(run);
  Object.assign(player, { run, row, t: 0 });
  const index = row === null ? null : cellOf(columnsByName.get("design_index"), row);
  const outcome = row === null ? run.metrics.outcome : outcomeOf(row);
  const title = byId("run-title");
  title.replaceChildren(row === null ? `${run.name} ` : `Run ${index} `);
  if (outcome) title.append(badge(outcome));
  byId("run-text").replaceChildren(...runText(run, row, index));
  if (controlsOf.slider && run) controlsOf.slider.value = placeOpen();
  if (controlsOf.slider) controlsOf.slider.setAttribute("aria-valuetext", run ? run.name : "no flight");
  if (controlsOf.number) controlsOf.number.value = index;
  if (controlsOf.name) controlsOf.name.value = report.runs.indexOf(run);
  showMetrics(run, row);
  showSignals();
}

function runText(run, row, index) {
  const texts = row === null ? [] : [axes.map((axis) => `${axis.label} ${withUnit(cellOf(axis, row), axis.unit)}`).join(", ")];
  const message = row === null ? run.message : report.table.messages[row];
  if (message) texts.push(message);
  if (run && run.note) texts.push(`Note: ${run.note}.`);
  const parts = [texts.join(". ")];
  if (run === null && report.runs.length) {
    const near = nearestFlight(row);
    parts.push(element("br"), `Its signals are not in this file; --run ${index} includes them. `, button(`Show the nearest that is: run ${near.index}`, () => openIndex(near.index)));
  }
  return parts;
}

/** The run with signals that is nearest on the axes, each scaled by its range. */
function nearestFlight(row) {
  const numeric = axes.filter((axis) => !axis.words);
  const words = axes.filter((axis) => axis.words);
  let [best, least] = [report.runs[0], Infinity];
  for (const [other, place] of Object.entries(report.table.tracks)) {
    let distance = 0;
    for (const axis of numeric) distance += ((cellOf(axis, Number(other)) - cellOf(axis, row)) / spreadOf(axis)) ** 2;
    for (const axis of words) distance += cellOf(axis, Number(other)) === cellOf(axis, row) ? 0 : 4;
    if (distance < least) [best, least] = [report.runs[place], distance];
  }
  return best;
}

function showMetrics(run, row) {
  const metrics = row === null ? Object.entries(run.metrics).map(([name, value]) => [report.labels[name] ?? name, withUnit(typeof value === "boolean" ? (value ? "yes" : "no") : value, report.units[name])]) : drawable.map((column) => [column.label, withUnit(cellOf(column, row), column.unit)]);
  const settings = row === null ? Object.entries(run.settings).map(([name, value]) => [name, shown(value)]) : [];
  const half = Math.ceil(metrics.length / 2);
  byId("metrics-tables").replaceChildren(tableOf(metrics.slice(0, half)), tableOf(metrics.slice(half)));
  byId("settings").hidden = !settings.length;
  byId("settings-table").replaceChildren(tableOf(settings));
}

// -- its signals ------------------------------------------------------------------------------------------

let pending = 0;

/** Draw the replay immediately and the time plots when idle: the slider may be moving. */
function showSignals() {
  const signals = signalsOf(player.run);
  const beside = player.beside === player.run ? null : signalsOf(player.beside);
  const hasScene = Boolean(signals && signals.space);
  byId("replay").hidden = !hasScene;
  byId("player").hidden = !signals;
  controlsOf.play.hidden = controlsOf.speed.hidden = !hasScene;
  byId("signals").hidden = !signals;
  document.body.classList.toggle("no-signals", !signals);
  clearTimeout(pending);
  if (!signals) return;
  controlsOf.time.max = signals.time[signals.time.length - 1];
  controlsOf.time.step = Number(((signals.time[signals.time.length - 1] - signals.time[0]) / 300).toPrecision(1));
  if (hasScene) {
    showInScene([signals, beside]);
    nameScene(beside);
  }
  setTime(0);
  buildPanelChoice(signals);
  pending = setTimeout(() => drawTimePlot(signals, beside, [player.run.name, player.beside ? player.beside.name : ""]).then(noteFirstPlot), 30);
}

function redrawSignals(whole = true) {
  if (timePlot.isDrawn) drawTimePlot(timePlot.signals, timePlot.beside, ["", player.beside ? player.beside.name : ""], whole);
}

function nameScene(beside) {
  const line = (color, dash, text) => {
    const item = element("li");
    item.innerHTML = `<svg width="26" height="8" aria-hidden="true"><line x1="0" y1="4" x2="26" y2="4" stroke="var(--${color})" stroke-width="2.4" stroke-dasharray="${dash}"/></svg>`;
    item.append(text);
    return item;
  };
  const { reference, desired, thrust } = player.run.signals.space;
  const sign = desired ? "outlined: now" : "◇ now";
  byId("scene-key").replaceChildren(line("flown", "", "flown"), ...(reference ? [line("wanted", "6 4", `reference, ${sign}`)] : []), ...(thrust ? [line("thrust", "", "thrust")] : []), ...(beside ? [line("beside", "", player.beside.name)] : []));
}

function buildSignalControls() {
  controlsOf.panels = element("details", { className: "panels" }, element("summary", { textContent: "Panels" }), element("fieldset"));
  byId("signals-controls").append(
    button("Zoom in", () => zoomTime(0.4)), button("Zoom out", () => zoomTime(2.5)),
    button("Whole run", () => showSpan(...wholeSpan())), button("Save as SVG", saveSignals), controlsOf.panels,
  );
}

function buildPanelChoice({ layout, bars }) {
  const boxes = [...layout.panels, ...(bars ? [{ title: BARS, unit: null, shown: true }] : [])].map((panel) => {
    const box = element("input", { type: "checkbox", checked: timePlot.shownPanels.get(panel.title) ?? panel.shown });
    box.onchange = () => { timePlot.shownPanels.set(panel.title, box.checked); redrawSignals(); };
    return element("label", {}, box, titled(panel.title, panel.unit));
  });
  controlsOf.panels.querySelector("fieldset").replaceChildren(element("legend", { textContent: "Shown" }), ...boxes);
}

// -- the replay -------------------------------------------------------------------------------------------

function buildPlayer() {
  controlsOf.play = button("▶ Play", () => (player.isPlaying ? stop() : play()), { className: "main", ariaPressed: "false" });
  controlsOf.play.setAttribute("aria-pressed", "false");
  controlsOf.time = element("input", { type: "range", min: 0, max: 1, step: 0.01, value: 0 });
  controlsOf.time.oninput = () => setTime(Number(controlsOf.time.value));
  controlsOf.clock = element("output", { className: "clock" });
  controlsOf.speed = choice("Speed", SPEEDS.map((speed) => [speed, `${speed}×`]), 1, (speed) => { player.speed = Number(speed); });
  byId("player").append(
    controlsOf.play,
    element("label", { className: "wide" }, "Time", controlsOf.time),
    controlsOf.clock,
    controlsOf.speed,
  );
}

function endOfRun() {
  const time = player.run.signals.time;
  return time[time.length - 1];
}

function play() {
  if (player.t >= endOfRun() - 1e-9) setTime(0);
  player.isPlaying = true;
  player.last = performance.now();
  nameButton();
  requestAnimationFrame(advance);
}

function stop() {
  player.isPlaying = false;
  nameButton();
}

function nameButton() {
  controlsOf.play.textContent = player.isPlaying ? "❚❚ Pause" : "▶ Play";
  controlsOf.play.setAttribute("aria-pressed", String(player.isPlaying));
}

/** The next picture; with reduced motion one every second. */
function advance(now) {
  if (!player.isPlaying) return;
  const passed = (now - player.last) / 1000;
  if (!isStill.matches || passed >= 1) {
    player.last = now;
    setTime(player.t + passed * player.speed);
    if (player.t >= endOfRun()) return stop();
  }
  requestAnimationFrame(advance);
}

/** Move the replay, the slider, the line in the plots and the numbers to a time [s]. */
function setTime(t) {
  const signals = player.run.signals;
  player.t = Math.max(signals.time[0], Math.min(endOfRun(), t));
  scene.t = player.t;
  controlsOf.time.value = player.t;
  const { unit, each } = unitOfTimes(endOfRun());
  controlsOf.clock.textContent = `${(each * player.t).toFixed(2)} ${unit}`;
  controlsOf.time.setAttribute("aria-valuetext", controlsOf.clock.textContent);
  if (signals.space) {
    drawScene();
    byId("readout").textContent = readout(signals);
  }
  if (timePlot.isDrawn) moveCursor();
}

/** A number with a fixed number of decimals, and no sign on a zero. */
function fixed(value, digits) {
  return value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1");
}

function readout(signals) {
  const { position, thrust, is_enu: isEnu } = signals.layout.scene;
  const place = position.map((name) => fixed(valueAt(signals, name, player.t), 3)).join(", ");
  const angles = ["roll", "pitch", "yaw"].map((name) => `${name} ${fixed(valueAt(signals, name, player.t), 1)}°`).join(", ");
  const error = "position error" in signals.columns ? `, ${Number(valueAt(signals, "position error", player.t).toPrecision(3))} m from the reference` : "";
  const force = thrust ? `; thrust ${fixed(valueAt(signals, thrust, player.t), 2)} N` : "";
  return `${isEnu ? "east, north, up" : "north, east, down"} ${place} m${error}; ${angles}${force}`;
}
