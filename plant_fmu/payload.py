"""A payload at the centre of gravity that is dropped at a given time, as pure functions of time."""

from dataclasses import dataclass

from fmu_kit.scalar import FLOAT, Scalar, ScalarOps

AT_ONCE = 1e-9
"""Tolerance of times [s]; a drop this close to the beginning or the end of a step takes place there"""


@dataclass(frozen=True, kw_only=True, slots=True)
class Payload:
    """A point mass: it adds to the mass but not to the inertia, and is dropped with the velocity of the vehicle."""

    mass: float = 0.0
    """Mass [kg]"""
    drop_time: float = 0.0
    """Time from which on it is gone [s]; 0: never"""

    def carried(self, t: Scalar, ops: ScalarOps = FLOAT) -> Scalar:
        """The mass [kg] of the payload still carried at `t` [s]."""
        left = ops.where(t < self.drop_time - AT_ONCE, self.mass, 0.0)
        return ops.where(self.drop_time > 0.0, left, self.mass)

    def until_drop(self, t: Scalar, h: Scalar, ops: ScalarOps = FLOAT) -> Scalar:
        """The time [s] until the drop in a step from `t` to `t + h`, if it is dropped within the step; else 0."""
        left = self.drop_time - t
        inside = ops.where(left > AT_ONCE, ops.where(left < h - AT_ONCE, left, 0.0), 0.0)
        return ops.where(self.mass > 0.0, ops.where(self.drop_time > 0.0, inside, 0.0), 0.0)
