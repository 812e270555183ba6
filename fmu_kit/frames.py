"""Axes conventions: quantities of one of them, in the other.

The equations of this project are north-east-down, with body axes forward, right and down. Each variable of a slave
with a choice of convention (`fmu_kit.framed`) declares by `frame=` which function of this module converts it between
the two; methods see the convention of the equations. Every function is its own inverse: it converts where `turned`
holds, and otherwise returns its argument to the bit.
"""

import enum
import math

from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.scalar import FLOAT, Scalar

_HALF = math.sqrt(0.5)


class Frame(enum.IntEnum):
    """Directions of the axes of the inertial and of the body frame."""

    NED = 1
    """north-east-down; forward-right-down"""
    ENU = 2
    """east-north-up; forward-left-up"""


def inertial(turned: Scalar, v: Vec3) -> Vec3:
    """A vector in the inertial frame: x and y change places, z changes its sign."""
    where = FLOAT.where
    return Vec3(where(turned, v.y, v.x), where(turned, v.x, v.y), where(turned, -v.z, v.z))


def inertial_sizes(turned: Scalar, v: Vec3) -> Vec3:
    """Magnitudes along each inertial axis, such as gains: x and y change places."""
    return Vec3(FLOAT.where(turned, v.y, v.x), FLOAT.where(turned, v.x, v.y), v.z)


def body(turned: Scalar, v: Vec3) -> Vec3:
    """A vector in the body frame: y and z change their signs."""
    return Vec3(v.x, FLOAT.where(turned, -v.y, v.y), FLOAT.where(turned, -v.z, v.z))


def body_matrix(turned: Scalar, J: Inertia) -> Inertia:
    """An inertia matrix in the body frame: the products with x change their signs."""
    xy, xz = FLOAT.where(turned, -J.xy, J.xy), FLOAT.where(turned, -J.xz, J.xz)
    return Inertia(xx=J.xx, yy=J.yy, zz=J.zz, xy=xy, xz=xz, yz=J.yz)


def attitude(turned: Scalar, Q: Quaternion) -> Quaternion:
    """An attitude, body to inertial: with half turns about forward before it and about north-east after it."""
    x, y, z, w = Q
    other = Quaternion.from_xyzw(_HALF * (x + y), _HALF * (x - y), _HALF * (w - z), _HALF * (w + z))
    return Quaternion.where(turned, other, Q)


def rotation(turned: Scalar, Q: Quaternion) -> Quaternion:
    """A rotation between body frames, such as an attitude error: its axis is a vector in the body frame."""
    return Quaternion(body(turned, Q.vector), Q.scalar)


def yaw(turned: Scalar, angle: Scalar) -> Scalar:
    """A direction [rad] in the horizontal plane, from x of the inertial frame towards y."""
    return FLOAT.where(turned, 0.5 * math.pi - angle, angle)


def about_z(turned: Scalar, angle: Scalar) -> Scalar:
    """An angle [rad] turned in the horizontal plane, or its rate, from x of the inertial frame towards y."""
    return FLOAT.where(turned, -angle, angle)
