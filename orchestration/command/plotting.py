"""The command that draws runs: one, or several laid over each other."""

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.basics.errors import UsageError, shown
from orchestration.basics.terminal import Share, progress_bar
from orchestration.command import registry as registering
from orchestration.command.answer import Answer, of_files
from orchestration.command.figure_flags import FigureFlags
from orchestration.command.shared_flags import takes
from orchestration.flight.names import FIGURES

if TYPE_CHECKING:
    from orchestration.figures.style import Style
    from orchestration.runs.result import Result

TOGETHER = "overlay"
"""Folder beside the runs for what shows several of them"""


@takes("look", FigureFlags)
def plot(
    directory: Annotated[list[Path], typer.Argument(help="Directories of runs.", metavar="DIR…")],
    start: Annotated[
        float | None, typer.Option("--from", help="Start of what is seen, in seconds.", show_default=False)
    ] = None,
    end: Annotated[float | None, typer.Option("--to", help="End of what is seen.", show_default=False)] = None,
    figure: Annotated[
        list[str] | None,
        typer.Option(
            "--figure", help=f"One of {', '.join(FIGURES)}; default: all.", metavar="NAME", show_default=False
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help=f"Folder of the figures; default: that of the run, or {TOGETHER}/ beside several.",
            metavar="DIR", show_default=False,
        ),
    ] = None,
    film: Annotated[
        Path | None,
        typer.Option(
            "--film", help="Write the flight as a film instead; .mp4 needs ffmpeg.", metavar="FILE.gif|FILE.mp4",
            show_default=False,
        ),
    ] = None,
    *,
    look: FigureFlags,
) -> Answer:  # fmt: skip
    """Draw the figures of a run again, or of several runs laid over each other, for a screen, a paper or slides."""
    with progress_bar("drawing") as progress:  # before what draws is loaded, which takes its time
        from orchestration.figures.style import save
        from orchestration.runs.draw import draw
        from orchestration.runs.run_directory import load_run
        from orchestration.runs.run_labels import labels_of_runs

        results = [load_run(one) for one in directory]
        names = labels_of_runs(results, [str(one) for one in directory])
        window = _window(results, start, end)
        if film is not None:
            return of_files([_filmed(results, names, window, film, look.chosen, progress)])
        made = draw(results, figure, names=names, window=window, style=look.chosen)
        place = out or (directory[0] if len(directory) == 1 else _beside(directory))
        return of_files(save(made, place, look.chosen, progress))


def _filmed(
    results: "Sequence[Result]",
    names: Sequence[str],
    window: tuple[float, float] | None,
    film: Path,
    style: "Style",
    progress: Share,
) -> Path:
    from orchestration.flight import film as filming
    from orchestration.runs.draw import runs_of

    if not all({*result.recording.columns} >= filming.COLUMNS for result in results):
        raise UsageError("--film: expected runs of a quadrotor; figures show what other systems do")
    return filming.film(runs_of(results, names, filming.COLUMNS | {"time"}, window), film, style, progress)


def _window(results: "Sequence[Result]", start: float | None, end: float | None) -> tuple[float, float] | None:
    if start is None and end is None:
        return None
    last = max(result.end for result in results)
    window = (0.0 if start is None else start, last if end is None else end)
    if not 0.0 <= window[0] < window[1] < math.inf or window[0] >= last:
        raise UsageError(
            f"--from {shown(window[0])} --to {shown(window[1])}: expected 0 <= from < to, and from before the "
            f"run's end at {shown(last)} s"
        )
    return window


def _beside(directories: Sequence[Path]) -> Path:
    """A folder in the nearest one that holds all of them."""
    return Path(os.path.commonpath([path.absolute().parent for path in directories])) / TOGETHER


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    registering.add(app, registering.FLY, plot)
