"""Functions that measure the bandwidth of a controller, by the kind of request."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from orchestration.foundation.basics.registry import Registry

if TYPE_CHECKING:
    from orchestration.systems.system.request import ControlLoop

    Crossover = Callable[[ControlLoop], float]
    """The bandwidth of the loop by which controllers are compared [rad/s]; `math.inf` or 0 outside of its range"""

CROSSOVERS: Registry[Crossover] = Registry()
"""Rooms above register theirs"""
