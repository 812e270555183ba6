"""The innermost loop: from angular velocities to torques, with what is kept from run to run.

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
"""[rad/s]; the integral takes up less of an error the nearer it is to this, and none beyond"""

_PER_COMMAND = Airframe().full_torque
"""[rad/s²] of a full command, where J = I₃ kg·m²: PX4's gains are commands, those here angular accelerations"""


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
    """of the desired angular velocity [1/s] (MC_ROLLRATE_FF, MC_PITCHRATE_FF, MC_YAWRATE_FF)"""
    integral_limit: Vec3 = Vec3(0.3, 0.3, 0.3)
    """of a full command [1] (MC_RR_INT_LIM, MC_PR_INT_LIM, MC_YR_INT_LIM)"""
    derivative_cutoff: float = 2.0 * math.pi * 30.0
    """[rad/s] (IMU_DGYRO_CUTOFF: 30 Hz)"""
    yaw_cutoff: float = 2.0 * math.pi * 2.0
    """[rad/s], of the yaw command (MC_YAW_TQ_CUTOFF: 2 Hz)"""


class RateState(NamedTuple):
    """What the rate loop keeps from run to run."""

    integral: Vec3
    """[rad/s²], body"""
    angular_velocity: Vec3
    """as measured at the last run [rad/s], body"""
    angular_acceleration: Vec3
    """filtered derivative of the measured angular velocity [rad/s²], body"""
    yaw_command: float
    """filtered [1]"""
    cut: Vec3
    """what the limits took of the command of the last run [1]"""


def rate_state_at(angular_velocity: Vec3) -> RateState:
    """What there is to keep before the first run, at a measured `angular_velocity` [rad/s]."""
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
    """The torque [N·m], body, and what to keep; `elapsed` [s] after the last run.

    `angular_velocity` and `desired` [rad/s], body. The output has the integral as it was before this run. Torques are
    limited to commands in [-1, 1], each axis.
    """
    change = angular_velocity - state.angular_velocity
    acceleration = filtered_derivative(state.angular_acceleration, change, elapsed, loop.derivative_cutoff)
    error = desired - angular_velocity
    wanted = (
        loop.proportional * error + state.integral - loop.derivative * acceleration + loop.feedforward * desired
    )  # [rad/s²]
    raw = airframe.command(inertia @ wanted)
    yaw = low_pass(state.yaw_command, raw.z, elapsed, loop.yaw_cutoff)
    command = Vec3(raw.x, raw.y, yaw)
    given = clamped_axes(command, Vec3(1.0, 1.0, 1.0))
    integral = integrated(loop, state, error, elapsed, inertia, airframe)
    return airframe.torque(given), RateState(integral, angular_velocity, acceleration, yaw, command - given)


def integrated(
    loop: RateLoop, state: RateState, error: Vec3, elapsed: float, inertia: Inertia, airframe: Airframe
) -> Vec3:
    """The integral [rad/s²], body, `elapsed` [s] on: none of an `error` [rad/s] that would drive a limit further."""
    full, bound = airframe.full_torque, loop.integral_limit

    def axis(before: float, gain: float, error: float, cut: float, highest: float) -> float:
        error = FLOAT.where(cut > 0.0, min(error, 0.0), FLOAT.where(cut < 0.0, max(error, 0.0), error))
        relative = error / LARGE_ERROR
        share = max(0.0, 1.0 - relative * relative)
        return clamped(before + share * gain * error * elapsed, -highest, highest)

    before, gain, cut = state.integral, loop.integral, state.cut
    return Vec3(
        axis(before.x, gain.x, error.x, cut.x, bound.x * full.x / inertia.xx),
        axis(before.y, gain.y, error.y, cut.y, bound.y * full.y / inertia.yy),
        axis(before.z, gain.z, error.z, cut.z, bound.z * full.z / inertia.zz),
    )
