"""The outermost loop: from position errors to the desired velocity, within its limits (PX4: PositionControl.cpp)."""

import math
from dataclasses import dataclass

from controller_fmu.cascaded.filters import clamped
from fmu_kit.algebra import Vec3
from fmu_kit.scalar import FLOAT

SMALLEST_SPEED = 1e-12
"""Speed below which there is no direction [m/s]"""


@dataclass(frozen=True, kw_only=True, slots=True)
class PositionLoop:
    """P with feed-forward; the defaults are PX4's."""

    gain: Vec3 = Vec3(0.95, 0.95, 1.0)
    """K_p [1/s] (MPC_XY_P, MPC_Z_P)"""
    horizontal_limit: float = 12.0
    """Largest horizontal speed that is asked for [m/s] (MPC_XY_VEL_MAX)"""
    upward_limit: float = 3.0
    """Largest upward speed that is asked for [m/s] (MPC_Z_VEL_MAX_UP)"""
    downward_limit: float = 1.5
    """Largest downward speed that is asked for [m/s] (MPC_Z_VEL_MAX_DN)"""

    def velocity(self, position: Vec3, desired: Vec3, feedforward: Vec3) -> Vec3:
        """The desired velocity [m/s], inertial: K_p ∘ (P_d - P) + V_d within the limits.

        `position` and `desired` [m], `feedforward` V_d [m/s], all inertial. If the horizontal sum exceeds its limit,
        the part from the position error has priority over the feed-forward.
        """
        correction = self.gain * (desired - position)
        x, y = limited_sum(correction.x, correction.y, feedforward.x, feedforward.y, self.horizontal_limit)
        return Vec3(x, y, clamped(correction.z + feedforward.z, -self.upward_limit, self.downward_limit))


def limited_sum(ax: float, ay: float, bx: float, by: float, limit: float) -> tuple[float, float]:
    """a + b of two vectors in a plane, no longer than `limit`: a has priority, and b is shortened."""
    a = math.sqrt(ax * ax + ay * ay)
    b = max(math.sqrt(bx * bx + by * by), SMALLEST_SPEED)
    ux, uy = bx / b, by / b
    along = ax * ux + ay * uy
    room = math.sqrt(max(0.0, along * along + limit * limit - a * a)) - along  # |a + room u| = limit
    share = limit / max(a, limit)
    taken = FLOAT.where(a < limit, min(b, room), 0.0)
    return share * ax + taken * ux, share * ay + taken * uy
