"""How the bandwidth of a controller is measured, by the kind of its request."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from orchestration.basics.registry import Registry

if TYPE_CHECKING:
    from orchestration.system.request import ControlLoop

    Crossover = Callable[[ControlLoop], float]
    """Of the loop in which controllers are put side by side [rad/s]; `math.inf` or 0 outside of its range"""

CROSSOVERS: Registry[Crossover] = Registry()
"""Rooms above enter theirs"""
