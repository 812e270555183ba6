"""Figures, layouts and linear analysis of flights of the quadrotor, registered in the tables of the rooms below."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestration.components.checks.validation.roles import ROLES
from orchestration.experiments.comparison.crossovers import CROSSOVERS
from orchestration.experiments.report.known_layouts import LAYOUTS
from orchestration.quadrotor.flight.names import FIGURES, KIND, NEEDED
from orchestration.quadrotor.flight.ports import CONTROLLER, PLANT
from orchestration.simulation.figures.views import VIEWS, Drawing, View
from orchestration.simulation.requests.kinds import KINDS
from orchestration.theory.stability.known_loops import LOOPS

if TYPE_CHECKING:
    from orchestration.experiments.comparison.crossovers import Crossover
    from orchestration.experiments.report.known_layouts import KnownLayout
    from orchestration.simulation.requests.kinds import RequestKind
    from orchestration.theory.stability.known_loops import KnownLoop


def _scenarios() -> RequestKind:
    from orchestration.quadrotor.scenarios.kind import SCENARIOS

    return SCENARIOS


def _drawing() -> Drawing:
    from orchestration.quadrotor.flight.figures import DRAWING

    return DRAWING


def _layout() -> KnownLayout:
    from orchestration.quadrotor.flight.layout import FlightLayout

    return FlightLayout()


def _loop() -> KnownLoop:
    from orchestration.quadrotor.flight.hover_limit import ABOUT_HOVER

    return ABOUT_HOVER


def _crossover() -> Crossover:
    from orchestration.quadrotor.flight.bandwidth import crossover

    return crossover


KINDS.register(KIND, _scenarios)
VIEWS[KIND] = View(names=FIGURES, first=FIGURES[:4], load=_drawing, needs=NEEDED)
LAYOUTS.register(KIND, _layout)
LOOPS.register(KIND, _loop)
CROSSOVERS.register(KIND, _crossover)
ROLES.extend((CONTROLLER, PLANT))
