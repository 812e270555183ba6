"""The wind that acts on the rigid body, as a pure function of time."""

from dataclasses import dataclass

from fmu_kit.algebra import Vec3
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps


@dataclass(frozen=True, kw_only=True, slots=True)
class Wind:
    """F_d = amplitude cos(frequency t) (section V)."""

    amplitude: Vec3 = Vec3(0.01, 0.01, 0.01)
    """Amplitude of the force [N], inertial"""
    frequency: float = 0.1
    """Frequency [rad/s]"""

    def force(self, t: Scalar, ops: ScalarOps = FLOAT) -> Vec3:
        """F_d [N], inertial, at `t` [s]."""
        force: Vec3 = ops.cos(self.frequency * t) * self.amplitude
        return force
