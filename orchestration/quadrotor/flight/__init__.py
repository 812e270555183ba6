"""Figures, layouts and linear analysis of flights of the quadrotor, registered in the tables of the rooms below."""

from functools import partial
from pkgutil import resolve_name

from orchestration.components.checks.validation.roles import ROLES
from orchestration.experiments.comparison.crossovers import CROSSOVERS
from orchestration.experiments.live.known_sliders import KNOWN_SLIDERS
from orchestration.experiments.report.known_layouts import LAYOUTS
from orchestration.quadrotor.flight.names import FIGURES, KIND, NEEDED
from orchestration.quadrotor.flight.ports import CONTROLLER, PLANT
from orchestration.simulation.figures.views import VIEWS, View
from orchestration.simulation.requests.kinds import KINDS
from orchestration.theory.stability.known_loops import LOOPS

_DRAWING = partial(resolve_name, f"{__name__}.figures:DRAWING")

KINDS.register(KIND, "orchestration.quadrotor.scenarios.file:SCENARIOS")
VIEWS[KIND] = View(names=FIGURES, first=FIGURES[:4], load=_DRAWING, needs=NEEDED)
LAYOUTS.register(KIND, f"{__name__}.layout:LAYOUT")
KNOWN_SLIDERS.register(KIND, f"{__name__}.sliders:sliders")
LOOPS.register(KIND, f"{__name__}.hover_limit:ABOUT_HOVER")
CROSSOVERS.register(KIND, f"{__name__}.bandwidth:crossover")
ROLES.extend((CONTROLLER, PLANT))
