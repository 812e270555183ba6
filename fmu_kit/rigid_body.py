"""The rigid body (4)-(5), as pure functions of state and parameters, for the plant and for the model of a controller.

Inertial frame north-east-down, body frame forward-right-down, thrust along -z of the body, SI units.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps


@dataclass(frozen=True, kw_only=True, slots=True)
class Body:
    """A rigid body in uniform gravity."""

    mass: float = 1.0
    """m [kg]"""
    inertia: Inertia = Inertia(xx=1.0, yy=1.0, zz=1.0)
    """J [kg·m²], body frame"""
    gravity: float = 9.81
    """g [m/s²], along +z of the inertial frame"""

    def with_mass(self, mass: Scalar) -> "Body":
        """The same body with another mass [kg]."""
        return Body(mass=mass, inertia=self.inertia, gravity=self.gravity)


class Wrench(NamedTuple):
    """Thrust and torque of the propellers."""

    thrust: Scalar
    """T [N], along -z of the body"""
    torque: Vec3
    """Γ [N·m], body"""


class RigidState:
    """The motion of the body, or its time derivative."""

    __slots__ = ("angular_velocity", "position", "quaternion", "velocity")

    def __init__(self, position: Vec3, velocity: Vec3, quaternion: Quaternion, angular_velocity: Vec3) -> None:
        self.position = position
        """P [m], inertial"""
        self.velocity = velocity
        """V [m/s], inertial"""
        self.quaternion = quaternion
        """Q, body to inertial"""
        self.angular_velocity = angular_velocity
        """Ω [rad/s], body"""

    def plus(self, factor: Scalar, rate: "RigidState") -> "RigidState":
        """self + factor * rate, componentwise."""
        return RigidState(
            self.position.plus(factor, rate.position),
            self.velocity.plus(factor, rate.velocity),
            self.quaternion.plus(factor, rate.quaternion),
            self.angular_velocity.plus(factor, rate.angular_velocity),
        )

    def normalised(self, ops: ScalarOps = FLOAT) -> "RigidState":
        """The same motion with a quaternion of unit length."""
        return RigidState(self.position, self.velocity, self.quaternion.normalised(ops), self.angular_velocity)


def acceleration(quaternion: Quaternion, thrust: Scalar, force: Vec3, body: Body) -> Vec3:
    """dV/dt [m/s²], inertial, under `thrust` [N] and an external `force` [N], inertial (4)."""
    per_mass, axis = 1.0 / body.mass, quaternion.z_axis()
    lift = -thrust * per_mass
    return Vec3(
        lift * axis.x + force.x * per_mass,
        lift * axis.y + force.y * per_mass,
        lift * axis.z + force.z * per_mass + body.gravity,
    )


def derivative(state: RigidState, wrench: Wrench, force: Vec3, body: Body) -> RigidState:
    """d(state)/dt under a wrench of the propellers and an external `force` [N], inertial (4)-(5)."""
    omega = state.angular_velocity
    return RigidState(
        state.velocity,
        acceleration(state.quaternion, wrench.thrust, force, body),
        state.quaternion.rate(omega),
        body.inertia.solve(wrench.torque - omega.cross(body.inertia @ omega)),
    )


def tilt(quaternion: Quaternion) -> float:
    """Angle [rad] between the z axes of body and inertial frame, of a unit quaternion."""
    q = quaternion.vector
    return 2.0 * math.asin(min(1.0, math.sqrt(q.x * q.x + q.y * q.y)))
