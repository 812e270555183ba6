"""Four motors on an X frame: the thrusts for a wrench, and the wrench of the thrusts.

Body frame forward-right-down, thrust along -z of the body, SI units.
"""

from dataclasses import dataclass
from typing import NamedTuple

from fmu_kit.algebra import Vec3
from fmu_kit.rigid_body import Wrench
from fmu_kit.scalar import Scalar


class Thrusts(NamedTuple):
    """The thrust of each motor [N], in the order of PX4 and ArduPilot.

    Seen from above, the first two propellers turn anticlockwise, so that their drag turns the body to the right; the
    others turn clockwise.
    """

    front_right: Scalar
    rear_left: Scalar
    front_left: Scalar
    rear_right: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Mixer:
    """The positions of the motors, (±arm_x, ±arm_y), and the drag of their propellers."""

    arm_x: float = 0.0
    """Distance from the centre to a motor along x of the body [m]; 0 means unknown, here and below"""
    arm_y: float = 0.0
    """Distance from the centre to a motor along y [m]"""
    drag_to_thrust: float = 0.0
    """κ_τ [m], torque about z per thrust of a propeller"""

    def thrusts(self, wrench: Wrench) -> Thrusts:
        """The thrusts of the motors for a wrench, without limits."""
        thrust, torque = 0.25 * wrench.thrust, 0.25 * wrench.torque
        roll, pitch, yaw = torque.x / self.arm_y, torque.y / self.arm_x, torque.z / self.drag_to_thrust
        return Thrusts(
            front_right=thrust - roll + pitch + yaw,
            rear_left=thrust + roll - pitch + yaw,
            front_left=thrust + roll + pitch - yaw,
            rear_right=thrust - roll - pitch - yaw,
        )

    def wrench(self, thrusts: tuple[Scalar, Scalar, Scalar, Scalar]) -> Wrench:
        """The wrench that the motors exert on the body."""
        front_right, rear_left, front_left, rear_right = thrusts
        return Wrench(
            front_right + rear_left + front_left + rear_right,
            Vec3(
                self.arm_y * (rear_left + front_left - front_right - rear_right),
                self.arm_x * (front_right + front_left - rear_left - rear_right),
                self.drag_to_thrust * (front_right + rear_left - front_left - rear_right),
            ),
        )
