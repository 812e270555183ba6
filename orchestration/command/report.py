"""`quadcosim report`."""

from pathlib import Path
from typing import Annotated

import typer

from orchestration.command.options import option
from orchestration.command.registry import CommandResult, build_option, result_of_files
from orchestration.command.study_flags import STORE
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import progress_bar


@build_option
def report(
    what: Annotated[
        list[Path],
        typer.Argument(
            help="Directories of runs; a study file or its store, or two over one another; or a comparison file.",
            metavar="WHAT...",
        ),
    ],
    out: Annotated[
        Path | None,
        option(
            "--out",
            "The file, or the folder to write it to; default: report_NAME.html here.",
            "FILE.html|DIR",
        ),
    ] = None,
    store: Annotated[Path | None, STORE] = None,
    flights: Annotated[
        int | None,
        option("--flights", "Number of runs of a study whose signals are embedded; default: 1000.", "N", min=0),
    ] = None,
    run: Annotated[list[int] | None, option("--run", "A run of the study to embed; may be repeated.", "K")] = None,
    live: Annotated[
        bool, option("--live", "Beside the report of one run, write NAME_live.html, in which it runs.", metavar="")
    ] = False,
) -> CommandResult:
    """Write runs, a study or a comparison as one HTML file: replay, plots, maps; it needs no network."""
    from orchestration.experiments.report.writing import report as write

    if live and len(what) != 1:
        raise UsageError("--live: expected the directory of one run")
    with progress_bar("running") as progress:
        written = write(*what, out=out, store=store, flights=flights, runs=run or [], progress=progress)
    return result_of_files([written, *([_live(what[0], written)] if live else [])])


def _live(directory: Path, report: Path) -> Path:
    """The page beside a report, which begins with the values of the stored run; raises as `live`."""
    from orchestration.experiments.live.live import live as page_of
    from orchestration.simulation.runs.run_directory import SCENARIO, load_run

    if not directory.is_dir():
        raise UsageError("--live: expected the directory of one run")
    page = page_of(load_run(directory).request, name=str(directory / SCENARIO))
    return page.save(report.with_name(f"{report.stem}_live.html"))
