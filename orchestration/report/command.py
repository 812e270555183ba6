"""`quadcosim report`."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from orchestration.command import registering
from orchestration.command.answer import Answer, of_files
from orchestration.command.terminal import progress_bar
from orchestration.errors import UsageError


def report(
    what: Annotated[
        list[Path],
        typer.Argument(
            help="Directories of runs, or one study file, its store, or a comparison file.",
            metavar="WHAT...",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", help="The file; report_NAME.html here unless told.", metavar="FILE.html")
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option("--store", help="Folder of the study's store; results/NAME unless told.", metavar="DIR"),
    ] = None,
    flights: Annotated[
        int | None,
        typer.Option(
            "--flights",
            min=0,
            help="How many runs of a study get their flights into it; 1000 unless told.",
            metavar="N",
            show_default=False,
        ),
    ] = None,
    run: Annotated[
        list[int] | None,
        typer.Option("--run", help="A run of the study whose flight is to be in it; as often as wanted.", metavar="K"),
    ] = None,
) -> Answer:
    """Write runs, a study or a comparison as one HTML file: replay, plots, maps; it needs no network."""
    from orchestration.report import html
    from orchestration.report.what import report_of

    to = out or Path(f"report_{what[0].resolve().stem}.html")
    if to.suffix.lower() not in (".html", ".htm") or to.is_dir():
        raise UsageError(f"--out {to}: expected a file that ends in .html")
    with progress_bar("flying") as progress:
        made = report_of(
            what, _again(what, store, flights, run or []), store=store, wanted=run or [], most=flights,
            progress=progress,
        )  # fmt: skip
    return of_files([html.write(made, to)])


def _again(what: list[Path], store: Path | None, flights: int | None, runs: list[int]) -> str:
    """The command that makes this report."""
    words = ["quadcosim", "report", *map(str, what)]
    words += ["--store", str(store)] if store is not None else []
    words += ["--flights", str(flights)] if flights is not None else []
    return shlex.join([*words, *(word for index in runs for word in ("--run", str(index)))])


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    registering.add(app, registering.FLY, report)
