"""The command that draws runs: one, or several overlaid."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from orchestration.command.figure_flags import FigureFlags
from orchestration.command.options import option
from orchestration.command.registry import CommandResult, option_group, result_of_files
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.terminal import Share, progress_bar, warn
from orchestration.quadrotor.flight.names import FIGURES

if TYPE_CHECKING:
    from orchestration.simulation.figures.style import Style
    from orchestration.simulation.runs.result import Result

OVERLAY = "overlay"
"""Folder beside the runs for figures of several of them"""


@option_group("look", FigureFlags)
def plot(
    directory: Annotated[list[Path], typer.Argument(help="Directories of runs.", metavar="DIR…")],
    start: Annotated[float | None, option("--from", "Start of the time axis, in seconds.")] = None,
    end: Annotated[float | None, option("--to", "End of the time axis.")] = None,
    figure: Annotated[
        list[str] | None,
        option("--figure", f"One of {', '.join(FIGURES)}, or a recorded signal; default: all of these.", "NAME"),
    ] = None,
    out: Annotated[
        Path | None,
        option("--out", f"Folder of the figures; default: that of the run, or {OVERLAY}/ beside several.", "DIR"),
    ] = None,
    film: Annotated[
        Path | None, option("--film", "Write the flight as a film instead; .mp4 needs ffmpeg.", "FILE.gif|FILE.mp4")
    ] = None,
    *,
    look: FigureFlags,
) -> CommandResult:
    """Draw the figures of a run again, or of several runs overlaid, for a screen, a paper or slides."""
    with progress_bar("drawing") as progress:  # first, as importing matplotlib takes time
        from orchestration.simulation.figures.style import save
        from orchestration.simulation.runs.draw import draw, labels_of_runs
        from orchestration.simulation.runs.run_directory import load_run

        results = [load_run(one) for one in directory]
        names = labels_of_runs(results, [str(one) for one in directory])
        window = _window(results, start, end)
        if film is not None:
            return result_of_files([_write_film(results, names, window, film, look.figure_style, progress)])
        figures = draw(results, figure, names=names, window=window, style=look.figure_style)
        for name in figure or ():
            if name not in figures:
                warn(f"--figure {name}: left out, as these runs have none")
        folder = out or (directory[0] if len(directory) == 1 else _beside(directory))
        return result_of_files(save(figures, folder, look.figure_style, progress))


def _write_film(
    results: "Sequence[Result]",
    names: Sequence[str],
    window: tuple[float, float] | None,
    film: Path,
    style: "Style",
    progress: Share,
) -> Path:
    from orchestration.quadrotor.flight import film as filming
    from orchestration.simulation.runs.draw import runs_of

    if not all({*result.recording.columns} >= filming.COLUMNS for result in results):
        raise UsageError("--film: expected runs of a quadrotor; other systems have figures only")
    return filming.film(runs_of(results, names, filming.COLUMNS | {"time"}, window), film, style, progress)


def _window(results: "Sequence[Result]", start: float | None, end: float | None) -> tuple[float, float] | None:
    from orchestration.simulation.runs.arguments import window_within

    if start is None and end is None:
        return None
    last = max(result.end for result in results)
    window = (0.0 if start is None else start, last if end is None else end)
    return window_within(window, last, f"--from {shown(window[0])} --to {shown(window[1])}")


def _beside(directories: Sequence[Path]) -> Path:
    """The folder of overlaid figures, in the nearest folder that contains all runs."""
    return Path(os.path.commonpath([path.absolute().parent for path in directories])) / OVERLAY
