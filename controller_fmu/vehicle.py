"""What any controller knows of the vehicle: what it is told, and what it believes."""

from typing import NamedTuple

from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.rigid_body import Body

Model = Body
"""The rigid body that a controller believes in."""


class Measurement(NamedTuple):
    """What the controller is told of the vehicle."""

    position: Vec3
    """P [m], inertial"""
    velocity: Vec3
    """V [m/s], inertial"""
    quaternion: Quaternion
    """Q, unit, inertial to body"""
    angular_velocity: Vec3
    """Ω [rad/s], body"""
