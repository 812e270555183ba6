"""From the desired force to an attitude, and from attitude errors to angular velocities.

PX4: ControlMath.cpp, AttitudeControl.cpp.
"""

import math
from dataclasses import dataclass

from controller_fmu.cascaded.filters import clamped_axes
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.scalar import FLOAT

SMALLEST_SINE = 1e-5
"""Sine below which thrust axes are opposite: there is no shortest rotation between them."""
SMALLEST_WEIGHT = 1e-4
"""A yaw weight up to it counts as zero."""


@dataclass(frozen=True, kw_only=True, slots=True)
class AttitudeLoop:
    """P on quaternions, with less weight on yaw than on tilt; the defaults are PX4's."""

    gain: Vec3 = Vec3(6.5, 6.5, 2.8)
    """K [1/s] (MC_ROLL_P, MC_PITCH_P, MC_YAW_P)"""
    yaw_weight: float = 0.4
    """w [1], in [0, 1] (MC_YAW_WEIGHT)"""
    rate_limit: Vec3 = Vec3(math.radians(220.0), math.radians(220.0), math.radians(200.0))
    """Largest desired angular velocity [rad/s], body (MC_ROLLRATE_MAX, MC_PITCHRATE_MAX, MC_YAWRATE_MAX)"""

    def angular_velocity(self, attitude: Quaternion, desired: Quaternion, yaw_rate: float) -> Vec3:
        """The desired angular velocity [rad/s], body: 2 K ∘ q of Q⁻¹ ⊙ Q_d with its yaw weighted, within the limits.

        `yaw_rate` dψ_d [rad/s], about z of the inertial frame, is fed forward.
        """
        error = attitude.inverse() * with_weighted_yaw(attitude, desired, self.yaw_weight)
        sign = FLOAT.where(error.scalar < 0.0, -2.0, 2.0)  # Q and -Q are one attitude: rotate the short way
        weighted = self.yaw_weight > SMALLEST_WEIGHT
        yaw_gain = self.gain.z / FLOAT.where(weighted, self.yaw_weight, 1.0)  # cancels the weight for small yaw errors
        feedback = Vec3(self.gain.x, self.gain.y, yaw_gain) * (sign * error.vector)
        return clamped_axes(feedback + attitude.to_body(Vec3(0.0, 0.0, yaw_rate)), self.rate_limit)


def attitude_of(force: Vec3, yaw: float) -> Quaternion:
    """The attitude whose thrust axis exerts `force` [N], inertial, its z negative, with the nose to `yaw` ψ_d [rad]."""
    z = -force / force.norm()
    sine, cosine = math.sin(yaw), math.cos(yaw)
    x = Vec3(cosine * z.z, sine * z.z, -(cosine * z.x + sine * z.y))  # in the vertical plane of the yaw
    x = x / x.norm()
    return Quaternion.from_axes(x, z.cross(x), z)


def with_weighted_yaw(attitude: Quaternion, desired: Quaternion, weight: float) -> Quaternion:
    """`desired` with its yaw scaled by `weight` [1]: Q_d = Q_tilt ⊙ Q_yaw becomes Q_tilt ⊙ Q_yaw^w.

    Q_tilt is `attitude` after the shortest rotation to the thrust axis of `desired`.
    """
    tilted = tilted_to(attitude, desired)
    yaw = tilted.inverse() * desired  # about z alone
    sign = FLOAT.where(yaw.scalar < 0.0, -1.0, 1.0)
    half = weight * math.atan2(sign * yaw.vector.z, sign * yaw.scalar)
    return tilted * Quaternion(Vec3(0.0, 0.0, math.sin(half)), math.cos(half))


def tilted_to(attitude: Quaternion, desired: Quaternion) -> Quaternion:
    """`attitude` after the shortest rotation to the thrust axis of `desired`; for opposite axes, `desired` itself."""
    current, target = attitude.z_axis(), desired.z_axis()
    axis, cosine = current.cross(target), current @ target
    opposite = (cosine < 0.0) & (axis @ axis < SMALLEST_SINE * SMALLEST_SINE)
    turn = Quaternion(axis, FLOAT.where(opposite, 1.0, 1.0 + cosine)).normalised()
    return Quaternion.where(opposite, desired, turn * attitude)
