"""From forces to the normalised command of an X frame and back.

PX4 passes to its mixer a command c in [-1, 1] for each axis, and in [0, 1] for thrust. Four motors of largest
thrust T_m at (±a_x, ±a_y) exert, for a roll command alone, T_m c / √2 each, two up and two down; for a yaw command
alone, T_m c each. With the arm L = √2 a of a square frame:

    Γ_x = 2 L T_m c_x,  Γ_y = 2 L T_m c_y,  Γ_z = 4 κ_τ T_m c_z,  T = 4 T_m c
"""

import math
from dataclasses import dataclass

from fmu_kit.algebra import Vec3
from fmu_kit.mixer import Mixer


@dataclass(frozen=True, kw_only=True, slots=True)
class Airframe(Mixer):
    """The controller's model of four motors on an X frame.

    The defaults are the quadrotor that PX4 simulates itself (`sih_params.c`: 1 kg, J = diag(0.025, 0.025, 0.03) kg·m²,
    a_x = a_y = 0.2 m, κ_τ = 0.1 N·m / 5 N), its arms and κ_τ multiplied as the inertia is, by 40 and by 1/0.03, for
    J = I₃ kg·m²: so a full command gives the paper's body the angular acceleration that it gives that one.
    """

    thrust_max: float = 5.0
    """T_m [N], largest thrust of a motor"""
    arm_x: float = 0.2 / 0.025
    arm_y: float = 0.2 / 0.025
    drag_to_thrust: float = 2.0 / 3.0

    @property
    def full_thrust(self) -> float:
        """4 T_m [N], the thrust for a command of 1."""
        return 4.0 * self.thrust_max

    @property
    def full_torque(self) -> Vec3:
        """Γ [N·m], body, for a command of 1 about each axis: (2 √2 a_y, 2 √2 a_x, 4 κ_τ) T_m."""
        roll_and_pitch = 2.0 * math.sqrt(2.0) * self.thrust_max
        return Vec3(
            roll_and_pitch * self.arm_y, roll_and_pitch * self.arm_x, 4.0 * self.thrust_max * self.drag_to_thrust
        )

    def command(self, torque: Vec3) -> Vec3:
        """The command c [1] for `torque` [N·m], body."""
        full = self.full_torque
        return Vec3(torque.x / full.x, torque.y / full.y, torque.z / full.z)

    def torque(self, command: Vec3) -> Vec3:
        """Γ [N·m], body, for a `command` [1]."""
        return self.full_torque * command
