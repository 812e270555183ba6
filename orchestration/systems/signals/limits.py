"""Limits of a curve through way-points, from which its times follow."""

from dataclasses import dataclass

from orchestration.foundation.basics.errors import UsageError

AXES = ("x", "y", "z")
"""Columns of way-points [m], inertial"""


@dataclass(frozen=True, kw_only=True)
class SignalLimits:
    """The limits of a curve through way-points without times."""

    speed: float = 1.0
    """Speed for points without one in the file [m/s]"""
    acceleration: float = 1.0
    """Largest acceleration [m/s²]"""

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration"):
            value = getattr(self, name)
            if not value > 0.0:
                raise UsageError(f"{name} = {value}: expected a positive number")
