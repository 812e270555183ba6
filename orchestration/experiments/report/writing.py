"""Writes the report of runs, a study or a comparison."""

import os
import shlex
from collections.abc import Sequence
from pathlib import Path

from orchestration.experiments.report import html, of_runs
from orchestration.experiments.report.sources import report_of
from orchestration.experiments.report.subset import Progress, Wanted
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.simulation.runs.result import Result

ENDINGS = (".html", ".htm")


def report(
    *what: Result | str | Path,
    out: str | Path | None = None,
    flights: int | None = None,
    runs: Sequence[int] = (),
    progress: Progress | None = None,
) -> Path:
    """Write one HTML file of results or directories of runs, or of a study, its store or a comparison; its path.

    Of two studies over the same axes the second is drawn over the first. The file is self-contained. `out` is the file,
    by default `report_NAME.html`, or the folder of the store of the study, by default `results/NAME`, which the file is
    then written to. Of a study, the signals of `flights` runs are included, those of the runs with the numbers `runs`
    among them.

    Raises `UsageError` for anything else.
    """
    if not what:
        raise UsageError("report: expected runs, a study or a comparison")
    for each in what:
        if not isinstance(each, (Result, str, os.PathLike)):
            raise UsageError(
                f"report: {shown(repr(each))}: expected a Result, or the path of a run, a study or a store"
            )
    paths = [Path(each) for each in what if not isinstance(each, Result)]
    results = [each for each in what if isinstance(each, Result)]
    name = f"report_{paths[0].resolve().stem if paths else 'run'}.html"
    to = Path(name if out is None else out)
    folder = to if to.is_dir() else None
    if folder is not None:
        to = folder / name
    elif to.suffix.lower() not in ENDINGS:
        raise UsageError(f"--out {to}: expected a file that ends in .html, or the folder of a store")
    command = _command(paths, folder, flights, runs)
    if results:
        if paths:
            raise UsageError("report: expected results or paths, not both")
        named = {f"run {number}" if len(results) > 1 else "run": one for number, one in enumerate(results, start=1)}
        return html.write(of_runs.runs_report(named, "quadcosim.report(...) in Python"), to)
    wanted = Wanted(required=runs, most=flights, progress=progress)
    return html.write(report_of(paths, command, wanted, store=folder), to)


def _command(what: Sequence[Path], folder: Path | None, flights: int | None, runs: Sequence[int]) -> str:
    """The command that makes this report."""
    words = ["quadcosim", "report", *map(str, what)]
    words += ["--out", str(folder)] if folder is not None else []
    words += ["--flights", str(flights)] if flights is not None else []
    return shlex.join([*words, *(word for index in runs for word in ("--run", str(index)))])
