"""What acts on the rigid body: its wind and its actuators, as pure functions of state and parameters.

Inertial frame north-east-down, body frame forward-right-down, thrust along -z of the body, SI units.
"""

import math
from dataclasses import dataclass

from fmu_kit.algebra import Vec3
from fmu_kit.rigid_body import Wrench
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps


@dataclass(frozen=True, kw_only=True, slots=True)
class Wind:
    """F_d = amplitude cos(frequency t) (section V)."""

    amplitude: Vec3 = Vec3(0.01, 0.01, 0.01)
    """[N], inertial"""
    frequency: float = 0.1
    """[rad/s]"""

    def force(self, t: Scalar, ops: ScalarOps = FLOAT) -> Vec3:
        """F_d [N], inertial, at `t` [s]."""
        force: Vec3 = ops.cos(self.frequency * t) * self.amplitude
        return force


@dataclass(frozen=True, kw_only=True, slots=True)
class Actuators:
    """Limits, then a first-order lag of thrust and of each torque."""

    thrust_max: float = 1e6
    """[N]; thrust is limited to [0, thrust_max]"""
    torque_max: float = 1e6
    """[N·m]; each torque is limited to ±torque_max"""
    time_constant: float = 0.0
    """[s]; 0: no lag"""

    def limited(self, command: Wrench) -> Wrench:
        """`command` within the limits."""
        highest = self.torque_max
        return Wrench(
            min(max(command.thrust, 0.0), self.thrust_max),
            command.torque.map(lambda component: min(max(component, -highest), highest)),
        )

    def response(self, start: Wrench, target: Wrench, elapsed: float) -> Wrench:
        """The wrench `elapsed` [s] after it was `start`, with the limited command held at `target`.

        This is the exact solution of the lag, so no integration step is too long for it.
        """
        if self.time_constant == 0.0:
            return target
        left = math.exp(-elapsed / self.time_constant)
        return Wrench(
            target.thrust + left * (start.thrust - target.thrust),
            target.torque + left * (start.torque - target.torque),
        )
