"""Attitude gains as torques, or per unit inertia, so that one set gives every vehicle the same closed loop."""

import enum
from typing import NamedTuple

from fmu_kit.algebra import Inertia, Vec3
from fmu_kit.scalar import Scalar


class GainScaling(enum.IntEnum):
    """The meaning of the attitude gains."""

    ABSOLUTE = 1
    """torques [N·m] and [N·m·s]"""
    INERTIA = 2
    """angular accelerations [1/s²] and [1/s], multiplied by the nominal inertia matrix J"""


class Feedback(NamedTuple):
    """The feedback terms of the torque, and the momentum in the kinetic energy."""

    damping: Vec3
    """Torque of the damping [N·m]"""
    restoring: Vec3
    """Restoring torque [N·m]"""
    momentum: Vec3
    """½ rate·momentum is the kinetic energy [J]; per unit inertia [1/s²] where the gains are"""


def feedback(per_inertia: Scalar, J: Inertia, damping: Vec3, restoring: Vec3, rate: Vec3) -> Feedback:
    """The two attitude terms as torques; `damping` and `restoring` are in units of the gains.

    Per unit inertia they are J times as large, so that J cancels in the derivative of `rate` [rad/s]: the closed loop,
    its energy and the proof that this decreases are those of J = 1 kg·m².
    """
    if per_inertia:
        return Feedback(J @ damping, J @ restoring, rate)
    return Feedback(damping, restoring, J @ rate)
