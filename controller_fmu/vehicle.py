"""The vehicle as a controller knows it: its measurements and its nominal model."""

from typing import NamedTuple

from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.rigid_body import Body

Model = Body
"""The nominal model of a controller."""


class Measurement(NamedTuple):
    """The measured motion of the vehicle."""

    position: Vec3
    """P [m], inertial"""
    velocity: Vec3
    """V [m/s], inertial"""
    quaternion: Quaternion
    """Q, unit, body to inertial"""
    angular_velocity: Vec3
    """Ω [rad/s], body"""
