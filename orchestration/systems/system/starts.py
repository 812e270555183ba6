"""Starts: the initial conditions of many runs, as errors about the start of a reference."""

import math
from dataclasses import dataclass

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import record
from orchestration.systems.system.component import Values


@dataclass(frozen=True, kw_only=True)
class InitialConditions:
    """The initial conditions of one run."""

    size: float
    """Size of the initial error, in (0, 1], as a share of the largest of each kind"""
    values: Values
    """Values by target, as axes of studies name them"""


@record("starts.")
class Starts:
    """Initial errors in position, velocity, attitude and angular velocity, each in its own random direction.

    Raises `UsageError` for invalid values.
    """

    count: int = 200
    """The number of initial conditions."""
    first: int = 0
    """The index of the first initial condition. The same index gives the same one in every ensemble."""
    seed: int = 0
    """The seed of the random directions."""
    position: float = 4.0
    """The largest distance from the start of the reference, ‖P(0) - P_d(0)‖ [m]."""
    velocity: float = 2.0
    """The largest difference from the velocity of the reference, ‖V(0) - V_d(0)‖ [m/s]."""
    angle: float = 2.0
    """The largest angle from level and no yaw, about any axis [rad]."""
    rate: float = 2.0
    """The largest angular velocity, ‖Ω(0)‖ [rad/s]."""

    def __post_init__(self) -> None:
        for name, lowest in (("count", 1), ("first", 0), ("seed", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < lowest:
                raise UsageError(f"starts.{name} = {value}: expected a whole number from {lowest}")
        for name, highest in (("position", math.inf), ("velocity", math.inf), ("angle", math.pi), ("rate", math.inf)):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0.0 <= value <= highest):
                raise UsageError(f"starts.{name} = {value}: expected a number from 0{_to(highest)}")


def _to(highest: float) -> str:
    return "" if math.isinf(highest) else f" to {highest:.6g}"
