"""The figures of runs by name: of one, or of several laid over each other."""

from collections.abc import Collection, Sequence

from matplotlib.figure import Figure

from orchestration.basics.errors import UsageError
from orchestration.figures.gallery import Figures
from orchestration.figures.run import Run, Window
from orchestration.figures.style import SCREEN, Style, style_named
from orchestration.figures.views import VIEWS, view_of
from orchestration.recording.recording import thinned
from orchestration.runs.ran import Ran
from orchestration.runs.run_labels import labels_of_runs

MOST = 2**16
"""Rows that are drawn of the whole of a longer run, beside all in the window"""


def draw(
    results: Ran | Sequence[Ran],
    which: Collection[str] | None = None,
    *,
    names: Sequence[str] | None = None,
    window: Window | None = None,
    style: Style = SCREEN,
) -> dict[str, Figure]:
    """Figures of a run by name, all that there are unless some are named; of several runs, laid over each other.

    `names` tell the runs apart; without them, what differs between their scenarios does. `window` is the span of
    time [s] that is seen. A figure that cannot be, as an energy of a controller that has none, is left out.

    Raises `UsageError` for a name of a figure that there is not, and for runs of different systems.
    """
    listed = list(results) if isinstance(results, Sequence) else [results]
    views = [view_of(result.asked.kind, result.recording.columns) for result in listed]
    components = {frozenset(result.system.components) for result in listed}
    if any(view is not views[0] for view in views) or len(components) != 1:
        raise UsageError("expected runs of one system to lay over each other")
    view = views[0]
    for name in which or ():
        if not any(name in each.names for each in VIEWS.values()):
            raise UsageError(f"--figure {name}: expected one of {', '.join(view.names)}")
    drawing = view.load()
    told = names or labels_of_runs(listed, [f"run {i + 1}" for i in range(len(listed))])
    runs = runs_of(listed, told, drawing.columns, window)
    with style.applied():
        made = {name: drawing.makers[name](runs, style) for name in view.names if which is None or name in which}
    return {name: figure for name, figure in made.items() if figure is not None}


def figures_of(results: Sequence[Ran], which: Collection[str] | None, *, window: Window | None, style: str) -> Figures:
    """The figures of runs laid over each other; raises `UsageError` for a name of a figure or a style that is none."""
    chosen = style_named(style)
    names = labels_of_runs(results, [f"run {i + 1}" for i in range(len(results))])
    return Figures(draw(results, which, names=names, window=window, style=chosen), chosen)


def runs_of(
    results: Sequence[Ran], names: Sequence[str], columns: Collection[str] | None, window: Window | None
) -> list[Run]:
    """Runs ready to be drawn; of a run of more than `MOST` rows every n-th, all in the window; of some columns."""
    return [
        Run(
            name=name,
            place=place,
            title=_title(result),
            system=result.system,
            recording=thinned(
                result.recording,
                set(result.recording.columns if columns is None else columns),
                window or (0.0, 1.0),
                MOST,
            ),
            whole=result.recording,
            described=result.described,
            parameters=result.parameters,
            window=window,
        )
        for place, (result, name) in enumerate(zip(results, names, strict=True))
    ]


def _title(result: Ran) -> str:
    parts = [headline] if (headline := result.asked.headline()) else []
    if result.divergence is not None:
        parts.append(f"diverged at {result.metrics['divergence_time']:g} s")
    if result.termination is not None:
        parts.append(f"terminated at {result.metrics['horizon']:g} s")
    if result.interrupted_at is not None:
        parts.append(f"interrupted at {result.interrupted_at:g} s")
    return ", ".join(parts)
