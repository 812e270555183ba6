"""How fast a curve through way-points may be: of which its times follow."""

from dataclasses import dataclass

from orchestration.basics.errors import UsageError

AXES = ("x", "y", "z")
"""Columns of way-points [m], inertial"""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How fast a curve through way-points without times may be."""

    speed: float = 1.0
    """[m/s], where the file does not say it of a point"""
    acceleration: float = 1.0
    """[m/s²]"""

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration"):
            value = getattr(self, name)
            if not value > 0.0:
                raise UsageError(f"{name} = {value}: expected a positive number")
