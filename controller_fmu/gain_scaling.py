"""Gains of the attitude as torques, or per unit inertia, so that one set of them flies every vehicle alike."""

import enum
from typing import NamedTuple

from fmu_kit.algebra import Inertia, Vec3
from fmu_kit.scalar import Scalar


class GainScaling(enum.IntEnum):
    """What the gains of the attitude are."""

    ABSOLUTE = 1
    """torques [N·m] and [N·m·s]"""
    INERTIA = 2
    """angular accelerations [1/s²] and [1/s], which the nominal inertia matrix J makes torques of"""


class Feedback(NamedTuple):
    """What a law takes back from the torque, and what its kinetic energy is made of."""

    damping: Vec3
    """[N·m]"""
    restoring: Vec3
    """[N·m]"""
    momentum: Vec3
    """½ rate·momentum is the kinetic energy [J]; per unit inertia [1/s²] where the gains are"""


def feedback(per_inertia: Scalar, J: Inertia, damping: Vec3, restoring: Vec3, rate: Vec3) -> Feedback:
    """The two terms of the attitude as torques; `damping` and `restoring` are in units of the gains.

    Per unit inertia they are J times as large, so that J drops out of the rate of `rate` [rad/s]: the closed loop is
    that of J = 1 kg·m², and so are the energy and the proof that it falls.
    """
    if per_inertia:
        return Feedback(J @ damping, J @ restoring, rate)
    return Feedback(damping, restoring, J @ rate)
