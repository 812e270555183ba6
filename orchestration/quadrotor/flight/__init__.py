"""Figures, layouts and linear analysis of flights of the quadrotor, registered in the tables of the rooms below."""

from collections.abc import Iterable, Iterator
from functools import partial
from pkgutil import resolve_name

from orchestration.components.checks.validation.roles import ROLES, Port, Role
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD, TRAJECTORY, USE_REFERENCE_INPUTS
from orchestration.experiments.comparison.crossovers import CROSSOVERS
from orchestration.experiments.live.known_sliders import KNOWN_SLIDERS
from orchestration.experiments.report.known_layouts import LAYOUTS
from orchestration.quadrotor.flight.names import FIGURES, KIND, NEEDED
from orchestration.quadrotor.scenarios import wiring
from orchestration.simulation.figures.views import VIEWS, View
from orchestration.simulation.requests.kinds import KINDS
from orchestration.theory.stability.known_loops import LOOPS


def _ports(causality: str, names: Iterable[str]) -> Iterator[Port]:
    for name in names:
        yield Port(name, causality, wiring.UNITS.get(name))


CONTROLLER = Role(
    identified_by=wiring.COMMAND,
    ports=(
        *_ports("output", wiring.COMMAND),
        *_ports("input", wiring.MEASUREMENT),
    ),
    optional=(
        *_ports("input", wiring.REFERENCE),
        *_ports("parameter", (SAMPLE_PERIOD, SAMPLE_OFFSET, *TRAJECTORY)),
        Port(USE_REFERENCE_INPUTS, "parameter", None, "Boolean"),
    ),
    complete_by=(*TRAJECTORY,),
)
PLANT = Role(
    identified_by=wiring.MEASUREMENT,
    ports=(
        *_ports("output", wiring.MEASUREMENT),
        *_ports("input", (*wiring.COMMAND, *wiring.EXTERNAL_FORCE)),
    ),
)


_DRAWING = partial(resolve_name, f"{__name__}.figures:DRAWING")

KINDS.register(KIND, "orchestration.quadrotor.scenarios.file:SCENARIOS")
VIEWS[KIND] = View(names=FIGURES, first=FIGURES[:4], load=_DRAWING, needs=NEEDED)
LAYOUTS.register(KIND, f"{__name__}.layout:LAYOUT")
KNOWN_SLIDERS.register(KIND, f"{__name__}.sliders:sliders")
LOOPS.register(KIND, f"{__name__}.hover_limit:ABOUT_HOVER")
CROSSOVERS.register(KIND, f"{__name__}.hover_loop:crossover")
ROLES.extend((CONTROLLER, PLANT))
