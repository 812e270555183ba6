// The entry point: draws the visible part first, the rest when the browser is idle.

function noteFirstPlot() {
  if (performance.getEntriesByName("first plot").length) return;
  performance.mark("first plot");
  document.body.dataset.drawn = "yes";
}

function later(action) {
  setTimeout(action, 0);
}

function startPage() {
  document.body.classList.add(report.kind === "runs" ? "run-page" : "wide-page");
  nameScheme();
  startHeader();
  startRun();
  startContents();
  if (report.kind === "runs") {
    openPlace(0);
    later(startRunsTable);
    return;
  }
  const drawn = report.compared ? startCells() : report.repeated ? startRepeated() : startMap();
  drawn.then(() => {
    noteFirstPlot();
    later(openFirst);
    later(report.compared ? drawSharesOfCells : report.repeated ? startTableOfRepeated : startShares);
  });
}

/** The run that is open at first: a good one with signals in the file, if there is one. */
function openFirst() {
  if (report.compared) return openCell(cellsHere()[0]);
  if (report.repeated) return openRepeated(firstRepeated());
  return openRow(firstOf([...Array(report.table.count).keys()]));
}

startPage();
