"""Writes the report of runs, a study or a comparison."""

import html
import json
import os
import re
import shlex
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from fmu_kit.new_files import write_atomically
from orchestration.experiments.report import of_runs
from orchestration.experiments.report.model import Report, as_json
from orchestration.experiments.report.sources import report_of, source_of
from orchestration.experiments.report.subset import Progress, Wanted
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.figures import palette, shades
from orchestration.simulation.runs.result import Result

if TYPE_CHECKING:
    from orchestration.experiments.comparison.design import Comparison
    from orchestration.experiments.comparison.run import Compared
    from orchestration.experiments.studies.study import Study
    from orchestration.experiments.studies.study_file import FileLike
    from orchestration.experiments.studies.swept import Swept

ENDINGS = (".html", ".htm")


def report(
    *what: "Result | Study | Swept | Comparison | Compared | FileLike",
    out: str | Path | None = None,
    store: str | Path | None = None,
    flights: int | None = None,
    runs: Sequence[int] = (),
    progress: Progress | None = None,
) -> Path:
    """Write one HTML file of results or directories of runs, or of a study, its store or a comparison; its path.

    A study or a comparison is also what `sweep` or `compare` has returned, or the content of its file. Of two studies
    over the same axes the second is drawn over the first. The file is self-contained. `out` is the file, by default
    `report_NAME.html`, or the folder to write it to; `store` is the folder of the store of the study, by default `out`
    if it is there, else `results/NAME`. Of a study, the signals of `flights` runs are included, those of the runs with
    the numbers `runs` among them.

    Raises `UsageError` for anything else.
    """
    if not what:
        raise UsageError("report: expected runs, a study or a comparison")
    results = [each for each in what if isinstance(each, Result)]
    if results and len(results) < len(what):
        raise UsageError("report: expected results alone, or paths of them")
    folder = Path(out) if out is not None and Path(out).is_dir() else None
    first = None if store is None else Path(store)
    sources = [] if results else [source_of(each, first if i == 0 else None, folder) for i, each in enumerate(what)]
    name = f"report_{sources[0].name if sources else 'run'}.html"
    to = Path(name if out is None else out) if folder is None else folder / name
    if to.suffix.lower() not in ENDINGS:
        raise UsageError(f"--out {to}: expected a file that ends in .html, or a folder")
    if results:
        named = {f"run {number}" if len(results) > 1 else "run": one for number, one in enumerate(results, start=1)}
        return write(of_runs.runs_report(named, IN_PYTHON), to)
    paths = [str(each) for each in what if isinstance(each, (str, os.PathLike))]
    command = _command(paths, folder, first, flights, runs) if len(paths) == len(what) else IN_PYTHON
    return write(report_of(sources, command, Wanted(required=runs, most=flights, progress=progress)), to)


IN_PYTHON = "quadcosim.report(...) in Python"


def _command(
    what: Sequence[str], folder: Path | None, store: Path | None, flights: int | None, runs: Sequence[int]
) -> str:
    """The command that makes this report."""
    words = ["quadcosim", "report", *what]
    words += ["--out", str(folder)] if folder is not None else []
    words += ["--store", str(store)] if store is not None else []
    words += ["--flights", str(flights)] if flights is not None else []
    return shlex.join([*words, *(word for index in runs for word in ("--run", str(index)))])


SCRIPTS = (
    "data.js", "words.js", "theme.js", "plots.js", "scene.js", "peaks.js", "timeplots.js", "map.js", "shares.js",
    "repeated.js", "run.js", "tables.js", "page.js",
)  # fmt: skip
"""Scripts in the order of loading; each depends only on those before it"""
FIGURES = {
    "CYCLE": palette.CYCLE,
    "NOT_GOOD": {"bad": palette.NOT_GOOD, "diverged": palette.DIVERGED},
    "SHADES": {
        name: getattr(shades, name) for name in ("OUTER_SHARE", "OUTLIER_RATIO", "MIN_RANGE", "LOGARITHMIC_RATIO")
    },
    "PEAKS": {name: getattr(shades, name) for name in ("OUTSIDE", "CLIPPED")},
}
"""Constants that the page shares with figures: colours, and what ranges leave out"""
_PAGE = resources.files("orchestration.experiments.report") / "page"
_PLACE = re.compile(r"\{\{(\w+)\}\}")


def write(report: Report, out: Path) -> Path:
    """Write the file of a report; raises `WriteError`."""
    write_atomically(out, as_html(report))
    return out


def as_html(report: Report) -> str:
    """The text of the file."""
    parts = {
        "title": html.escape(report.title),
        "style": _text("style.css"),
        "data": _in_script(as_json(report)),
        "figures": json.dumps(FIGURES),
        "script": "\n".join(_text(name) for name in SCRIPTS),
    }
    return _PLACE.sub(lambda place: parts[place[1]], _text("page.html"))


def _in_script(document: str) -> str:
    """JSON escaped for a script element: names in it cannot open or close a tag."""
    return document.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _text(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")
