"""The innermost loop: from angular velocities to torques, with its state.

PX4: rate_control.cpp, MulticopterRateControl.cpp.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from controller_fmu.cascaded.airframe import Airframe
from controller_fmu.cascaded.filters import clamped, clamped_axes, filtered_derivative, low_pass
from fmu_kit.algebra import ZERO, Inertia, Vec3
from fmu_kit.scalar import FLOAT

LARGE_ERROR = math.radians(400.0)
"""Rate error [rad/s]; the integral weights an error less the nearer it is to this, and ignores it beyond"""

_PER_COMMAND = Airframe().full_torque
"""Angular acceleration of a full command with J = I₃ kg·m² [rad/s²]: PX4's gains give commands, those here angular
accelerations"""


@dataclass(frozen=True, kw_only=True, slots=True)
class RateLoop:
    """PID with a filtered derivative, per unit inertia; the defaults are PX4's on the default airframe."""

    proportional: Vec3 = _PER_COMMAND * Vec3(0.15, 0.15, 0.2)
    """P [1/s] (MC_ROLLRATE_P, MC_PITCHRATE_P, MC_YAWRATE_P)"""
    integral: Vec3 = _PER_COMMAND * Vec3(0.2, 0.2, 0.1)
    """I [1/s²] (MC_ROLLRATE_I, MC_PITCHRATE_I, MC_YAWRATE_I)"""
    derivative: Vec3 = _PER_COMMAND * Vec3(0.003, 0.003, 0.0)
    """D [1] (MC_ROLLRATE_D, MC_PITCHRATE_D, MC_YAWRATE_D)"""
    feedforward: Vec3 = ZERO
    """Feedforward of the desired angular velocity [1/s] (MC_ROLLRATE_FF, MC_PITCHRATE_FF, MC_YAWRATE_FF)"""
    integral_limit: Vec3 = Vec3(0.3, 0.3, 0.3)
    """Largest integral as a share of a full command [1] (MC_RR_INT_LIM, MC_PR_INT_LIM, MC_YR_INT_LIM)"""
    derivative_cutoff: float = 2.0 * math.pi * 30.0
    """Cutoff of the low-pass of the rate derivative [rad/s] (IMU_DGYRO_CUTOFF: 30 Hz)"""
    yaw_cutoff: float = 2.0 * math.pi * 2.0
    """Cutoff of the low-pass of the yaw command [rad/s] (MC_YAW_TQ_CUTOFF: 2 Hz)"""


class RateState(NamedTuple):
    """The state of the rate loop between runs."""

    integral: Vec3
    """Integral of the rate error [rad/s²], body"""
    angular_velocity: Vec3
    """Angular velocity as measured at the last run [rad/s], body"""
    angular_acceleration: Vec3
    """filtered derivative of the measured angular velocity [rad/s²], body"""
    yaw_command: float
    """filtered [1]"""
    excess: Vec3
    """part of the last command beyond the limits [1]"""


def initial_rate_state(angular_velocity: Vec3) -> RateState:
    """The state before the first run, at a measured `angular_velocity` [rad/s]."""
    return RateState(Vec3(0.0, 0.0, 0.0), angular_velocity, Vec3(0.0, 0.0, 0.0), 0.0, Vec3(0.0, 0.0, 0.0))


def control_rate(
    loop: RateLoop,
    state: RateState,
    angular_velocity: Vec3,
    desired: Vec3,
    elapsed: float,
    inertia: Inertia,
    airframe: Airframe,
) -> tuple[Vec3, RateState]:
    """The torque [N·m], body, and the new state; `elapsed` [s] after the last run.

    `angular_velocity` and `desired` [rad/s], body. The output uses the integral before this run. Torques are limited to
    commands in [-1, 1], per axis.
    """
    change = angular_velocity - state.angular_velocity
    acceleration = filtered_derivative(state.angular_acceleration, change, elapsed, loop.derivative_cutoff)
    error = desired - angular_velocity
    desired_acceleration = (
        loop.proportional * error + state.integral - loop.derivative * acceleration + loop.feedforward * desired
    )  # [rad/s²]
    raw = airframe.command(inertia @ desired_acceleration)
    yaw = low_pass(state.yaw_command, raw.z, elapsed, loop.yaw_cutoff)
    command = Vec3(raw.x, raw.y, yaw)
    limited = clamped_axes(command, Vec3(1.0, 1.0, 1.0))
    integral = integrate_error(loop, state, error, elapsed, inertia, airframe)
    return airframe.torque(limited), RateState(integral, angular_velocity, acceleration, yaw, command - limited)


def integrate_error(
    loop: RateLoop, state: RateState, error: Vec3, elapsed: float, inertia: Inertia, airframe: Airframe
) -> Vec3:
    """The integral [rad/s²], body, after `elapsed` [s], without an `error` [rad/s] that increases an excess."""
    full, bound = airframe.full_torque, loop.integral_limit

    def axis(before: float, gain: float, error: float, excess: float, highest: float) -> float:
        error = FLOAT.where(excess > 0.0, min(error, 0.0), FLOAT.where(excess < 0.0, max(error, 0.0), error))
        relative = error / LARGE_ERROR
        share = max(0.0, 1.0 - relative * relative)
        return clamped(before + share * gain * error * elapsed, -highest, highest)

    before, gain, excess = state.integral, loop.integral, state.excess
    return Vec3(
        axis(before.x, gain.x, error.x, excess.x, bound.x * full.x / inertia.xx),
        axis(before.y, gain.y, error.y, excess.y, bound.y * full.y / inertia.yy),
        axis(before.z, gain.z, error.z, excess.z, bound.z * full.z / inertia.zz),
    )
