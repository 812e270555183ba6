"""Four motors on an X frame: the thrusts that make up a wrench, and the wrench that they make up.

Body frame forward-right-down, thrust along -z of the body, SI units.
"""

from dataclasses import dataclass
from typing import NamedTuple

from fmu_kit.algebra import Vec3
from fmu_kit.rigid_body import Wrench
from fmu_kit.scalar import Scalar


class Thrusts(NamedTuple):
    """Of each motor [N], in the order of PX4 and ArduPilot.

    Seen from above, the first two turn anticlockwise, so that their drag turns the body to the right, and the others
    clockwise.
    """

    front_right: Scalar
    rear_left: Scalar
    front_left: Scalar
    rear_right: Scalar


@dataclass(frozen=True, kw_only=True, slots=True)
class Mixer:
    """Where the motors are, at (±arm_x, ±arm_y), and what their propellers do."""

    arm_x: float = 0.0
    """[m], from the centre to a motor along x of the body; 0, as for all three: not known"""
    arm_y: float = 0.0
    """[m], along y"""
    drag_to_thrust: float = 0.0
    """κ_τ [m], torque about z by thrust of a propeller"""

    def thrusts(self, wrench: Wrench) -> Thrusts:
        """What each motor has to give for a wrench, whatever it can."""
        thrust, torque = 0.25 * wrench.thrust, 0.25 * wrench.torque
        roll, pitch, yaw = torque.x / self.arm_y, torque.y / self.arm_x, torque.z / self.drag_to_thrust
        return Thrusts(
            front_right=thrust - roll + pitch + yaw,
            rear_left=thrust + roll - pitch + yaw,
            front_left=thrust + roll + pitch - yaw,
            rear_right=thrust - roll - pitch - yaw,
        )

    def wrench(self, thrusts: tuple[Scalar, Scalar, Scalar, Scalar]) -> Wrench:
        """What the motors exert on the body."""
        front_right, rear_left, front_left, rear_right = thrusts
        return Wrench(
            front_right + rear_left + front_left + rear_right,
            Vec3(
                self.arm_y * (rear_left + front_left - front_right - rear_right),
                self.arm_x * (front_right + front_left - rear_left - rear_right),
                self.drag_to_thrust * (front_right + rear_left - front_left - rear_right),
            ),
        )
