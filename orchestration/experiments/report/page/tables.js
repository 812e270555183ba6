// Tables and sentences of the page.

function startHeader() {
  byId("title").textContent = { runs: "", study: "Study ", comparison: "Comparison " }[report.kind] + report.title;
  byId("summary").textContent = report.summary;
  byId("warnings").hidden = !report.warnings.length;
  byId("warnings").replaceChildren(...report.warnings.map((text) => element("li", { textContent: text })));
}

function startContents() {
  byId("contents-list").replaceChildren(...report.contents.map((text) => element("li", { textContent: text })));
  byId("command").textContent = report.command;
  byId("provenance").replaceChildren(provenanceTable());
}

function provenanceTable() {
  const table = tableOf(report.provenance);
  for (const cell of table.querySelectorAll("td")) cell.className = "";
  return table;
}

/** Metrics of the runs, a column for each. */
function startRunsTable() {
  if (report.kind !== "runs" || report.runs.length < 2) return;
  byId("runs").hidden = false;
  const names = [...new Set(report.runs.flatMap((run) => Object.keys(run.metrics)))];
  const text = (run, name) => {
    const value = run.metrics[name];
    return typeof value === "boolean" ? (value ? "yes" : "no") : shown(value);
  };
  const rows = names.map((name) => [titled(report.labels[name] ?? name, report.units[name]), ...report.runs.map((run) => text(run, name))]);
  byId("runs-table").replaceChildren(tableOf(rows, ["", ...report.runs.map((run) => run.name)]));
}
