"""The figures of runs by name: of one, or of several laid over each other."""

from collections.abc import Callable, Collection, Mapping, Sequence

from matplotlib.figure import Figure

from orchestration.drawing import phase as phases
from orchestration.drawing.commands import COLUMNS, commands
from orchestration.drawing.energy import COLUMN, energy
from orchestration.drawing.errors import DRAWN, components_of_errors, errors
from orchestration.drawing.names import FLIGHT, SYSTEM
from orchestration.drawing.path import path
from orchestration.drawing.phase import phase
from orchestration.drawing.run import Run, Window, runs_of
from orchestration.drawing.signals import signals
from orchestration.drawing.spectrum import spectrum
from orchestration.drawing.style import SCREEN, Style
from orchestration.errors import UsageError
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.wiring import POSITION, POSITION_REFERENCE
from orchestration.results.differences import told_apart
from orchestration.results.result import Result

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
