"""Figures, layouts and linear analysis of flights of the quadrotor, registered in the tables of the rooms below."""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestration.checks.validation.roles import ROLES
from orchestration.comparison.crossovers import CROSSOVERS
from orchestration.figures.views import VIEWS, Drawing, View
from orchestration.flight.names import FIGURES, KIND, NEEDED
from orchestration.flight.ports import CONTROLLER, PLANT
from orchestration.report.known_layouts import LAYOUTS
from orchestration.stability.known_loops import LOOPS

if TYPE_CHECKING:
    from orchestration.comparison.crossovers import Crossover
    from orchestration.report.known_layouts import KnownLayout
    from orchestration.stability.known_loops import KnownLoop


def _drawing() -> Drawing:
    from orchestration.flight.figures import DRAWING

    return DRAWING


def _layout() -> KnownLayout:
    from orchestration.flight.layout import FlightLayout

    return FlightLayout()


def _loop() -> KnownLoop:
    from orchestration.flight.local_limit import AboutHover

    return AboutHover()


def _crossover() -> Crossover:
    from orchestration.flight.bandwidth import crossover

    return crossover


VIEWS[KIND] = View(names=FIGURES, first=FIGURES[:4], load=_drawing, needs=NEEDED)
LAYOUTS.register(KIND, _layout)
LOOPS.register(KIND, _loop)
CROSSOVERS.register(KIND, _crossover)
ROLES.extend((CONTROLLER, PLANT))
