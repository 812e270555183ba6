"""What any controller knows of the vehicle: what it is told, and what it believes."""

from dataclasses import dataclass
from typing import NamedTuple

from fmu_kit.algebra import Inertia, Quaternion, Vec3


@dataclass(frozen=True, kw_only=True, slots=True)
class Model:
    """The rigid body a controller believes in."""

    mass: float = 1.0
    """m [kg]"""
    inertia: Inertia = Inertia(xx=1.0, yy=1.0, zz=1.0)
    """J [kg·m²], body frame"""
    gravity: float = 9.81
    """g [m/s²]"""


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
