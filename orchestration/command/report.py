"""`quadcosim report`."""

from pathlib import Path
from typing import Annotated

import typer

from orchestration.command.options import option
from orchestration.command.registry import CommandResult, build_option, result_of_files
from orchestration.foundation.basics.terminal import progress_bar


@build_option
def report(
    what: Annotated[
        list[Path],
        typer.Argument(
            help="Directories of runs, or one study file, its store, or a comparison file.", metavar="WHAT..."
        ),
    ],
    out: Annotated[
        Path | None,
        option(
            "--out",
            "The file; default: report_NAME.html here. Or the folder of the study's store, default results/NAME, "
            "which the file is then written to.",
            "FILE.html|DIR",
        ),
    ] = None,
    flights: Annotated[
        int | None,
        option("--flights", "Number of runs of a study whose signals are embedded; default: 1000.", "N", min=0),
    ] = None,
    run: Annotated[list[int] | None, option("--run", "A run of the study to embed; may be repeated.", "K")] = None,
) -> CommandResult:
    """Write runs, a study or a comparison as one HTML file: replay, plots, maps; it needs no network."""
    from orchestration.experiments.report.writing import report as write

    with progress_bar("running") as progress:
        return result_of_files([write(*what, out=out, flights=flights, runs=run or [], progress=progress)])
