"""The figures of runs by name: of one, or of several laid over each other."""

from collections.abc import Callable, Collection, Mapping, Sequence

from matplotlib.figure import Figure

from orchestration.basics.errors import UsageError
from orchestration.figures import phase as phases
from orchestration.figures.commands import COLUMNS, commands
from orchestration.figures.energy import COLUMN, energy
from orchestration.figures.errors import DRAWN, components_of_errors, errors
from orchestration.figures.gallery import Figures
from orchestration.figures.names import FLIGHT, SYSTEM
from orchestration.figures.path import path
from orchestration.figures.phase import phase
from orchestration.figures.run import Run, Window
from orchestration.figures.signals import signals
from orchestration.figures.spectrum import spectrum
from orchestration.figures.style import SCREEN, STYLES, Style
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.wiring import POSITION, POSITION_REFERENCE
from orchestration.recording.recording import thinned
from orchestration.runs.result import Result
from orchestration.runs.run_labels import told_apart

Maker = Callable[[Sequence[Run], Style], Figure | None]
_MAKERS: Mapping[str, Maker] = dict(
    zip(
        (*FLIGHT, *SYSTEM),
        (path, errors, components_of_errors, commands, energy, phase, spectrum, signals),
        strict=True,
    )
)
_DRAWN = {
    "time", *POSITION_REFERENCE, *(f"plant.{name}" for name in POSITION), *COLUMNS, COLUMN, *DRAWN, *phases.DRAWN,
}  # fmt: skip

MOST = 2**16
"""Rows that are drawn of the whole of a longer run, beside all in the window"""


def draw(
    results: Result | Sequence[Result],
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
    listed = [results] if isinstance(results, Result) else list(results)
    kinds = {isinstance(result.asked, Scenario) for result in listed}
    components = {frozenset(result.system.components) for result in listed}
    if len(kinds) != 1 or len(components) != 1:
        raise UsageError("expected runs of one system to lay over each other")
    known = FLIGHT if kinds == {True} else SYSTEM
    for name in which or ():
        if name not in (*FLIGHT, *SYSTEM):
            raise UsageError(f"--figure {name}: expected one of {', '.join(known)}")
    columns = _DRAWN if known is FLIGHT else None
    told = names or told_apart(listed, [f"run {i + 1}" for i in range(len(listed))])
    runs = runs_of(listed, told, columns, window)
    with style.applied():
        made = {name: _MAKERS[name](runs, style) for name in known if which is None or name in which}
    return {name: figure for name, figure in made.items() if figure is not None}


def figures_of(
    results: Sequence[Result], which: Collection[str] | None, *, window: Window | None, style: str
) -> Figures:
    """The figures of runs laid over each other; raises `UsageError` for a name of a figure or a style that is none."""
    if style not in STYLES:
        raise UsageError(f"style {style}: expected one of {', '.join(STYLES)}")
    names = told_apart(results, [f"run {i + 1}" for i in range(len(results))])
    return Figures(draw(results, which, names=names, window=window, style=STYLES[style]), STYLES[style])


def runs_of(
    results: Sequence[Result], names: Sequence[str], columns: Collection[str] | None, window: Window | None
) -> list[Run]:
    """Runs ready to be drawn; of a run of more than `MOST` rows every n-th, all in the window; of some columns."""
    return [
        Run(
            name=name,
            place=place,
            title=_title(result),
            system=result.system,
            recording=thinned(
                result.recording, set(result.columns if columns is None else columns), window or (0.0, 1.0), MOST
            ),
            whole=result.recording,
            described=result.described,
            parameters=result.parameters,
            window=window,
        )
        for place, (result, name) in enumerate(zip(results, names, strict=True))
    ]


def _title(result: Result) -> str:
    parts = []
    if isinstance(result.asked, Scenario):
        timing = result.asked.timing
        parts.append(f"{result.asked.controller.fmu}, period {timing.period * 1e3:g} ms")
        if timing.delay:
            parts.append(f"delay {timing.delay * 1e3:g} ms")
        if timing.order != "gauss-seidel":
            parts.append("Jacobi")
    if result.divergence is not None:
        parts.append(f"diverged at {result.metrics['divergence_time']:g} s")
    if result.interrupted_at is not None:
        parts.append(f"interrupted at {result.interrupted_at:g} s")
    return ", ".join(parts)
