"""The variables of the cascade's FMU: those of every controller, and those of its loops, with PX4's names."""

from typing import Any

from controller_fmu.cascaded.airframe import Airframe
from controller_fmu.cascaded.attitude_loop import AttitudeLoop
from controller_fmu.cascaded.position_loop import PositionLoop
from controller_fmu.cascaded.rate_loop import RateLoop
from controller_fmu.cascaded.velocity_loop import VelocityLoop
from controller_fmu.interface import ControllerInterface
from fmu_kit import frames
from fmu_kit.algebra import ZERO, Vec3
from fmu_kit.interface import FixedParameter, Local, Parameter

VELOCITY_RATIO, ATTITUDE_RATIO = 20, 4
"""Ratios of periods; with a `sample_period` of 1 ms these give PX4's 50 and 250 Hz, for a rate loop of 1000 Hz."""
STEEPEST = 89.0 / 90.0 * 1.5707963267948966
"""Bound of the tilt limit [rad], as in PX4"""

_POSITION, _VELOCITY, _ATTITUDE, _RATE, _FRAME = PositionLoop(), VelocityLoop(), AttitudeLoop(), RateLoop(), Airframe()


def _parameter(name: str, description: str, unit: str, start: float | Vec3, **bounds: Any) -> Parameter:
    """A parameter; without other bounds one that is not negative."""
    return Parameter(description, unit, start, name=name, **bounds or {"minimum": 0.0})


def _gains(name: str, description: str, unit: str, start: Vec3) -> tuple[Parameter, Parameter]:
    """The horizontal and the vertical gain, where PX4 has XY or Z for {}."""
    across = _parameter(f"gain.{name}.horizontal", f"horizontal {description.format('XY')}", unit, start.x)
    return across, _parameter(f"gain.{name}.vertical", f"vertical {description.format('Z')}", unit, start.z)


def _cutoff(name: str, description: str, start: float) -> Parameter:
    return Parameter(description, "rad/s", start, name=f"cutoff.{name}", above=0.0, quantity="AngularFrequency")


class CascadeInterface(ControllerInterface):
    """Airframe, gains, limits and rates of the loops."""

    motor_thrust_max = FixedParameter(
        "largest thrust T_m of each motor", "N", _FRAME.thrust_max, name="motor.thrust_max", above=0.0
    )
    motor_arm_x = FixedParameter(
        "distance from the centre to each motor along x of the body", "m", _FRAME.arm_x, name="motor.arm.x", above=0.0
    )
    motor_arm_y = FixedParameter(
        "distance from the centre to each motor along y of the body", "m", _FRAME.arm_y, name="motor.arm.y", above=0.0
    )
    motor_drag_to_thrust = FixedParameter(
        "torque about z by thrust of a propeller", "m", _FRAME.drag_to_thrust, name="motor.drag_to_thrust", above=0.0
    )

    position_horizontal, position_vertical = _gains(
        "position", "velocity by position error (MPC_{}_P)", "1/s", _POSITION.gain
    )
    velocity_horizontal = _parameter(
        "gain.velocity.horizontal",
        "horizontal acceleration by velocity error (MPC_XY_VEL_P_ACC)",
        "1/s",
        _VELOCITY.proportional.x,
        above=0.0,
    )
    velocity_vertical = _parameter(
        "gain.velocity.vertical",
        "vertical acceleration by velocity error (MPC_Z_VEL_P_ACC)",
        "1/s",
        _VELOCITY.proportional.z,
    )
    velocity_integral_horizontal, velocity_integral_vertical = _gains(
        "velocity_integral",
        "acceleration by integral of the velocity error (MPC_{}_VEL_I_ACC)",
        "1/s2",
        _VELOCITY.integral,
    )
    velocity_derivative_horizontal, velocity_derivative_vertical = _gains(
        "velocity_derivative",
        "acceleration by derivative of the velocity (MPC_{}_VEL_D_ACC)",
        "1",
        _VELOCITY.derivative,
    )
    velocity_derivative_cutoff = _cutoff(
        "velocity_derivative",
        "cutoff of the low-pass of the velocity derivative (MPC_VELD_LP: 5 Hz)",
        _VELOCITY.derivative_cutoff,
    )
    horizontal_limit = _parameter(
        "limit.velocity.horizontal",
        "largest horizontal speed that the position loop asks for (MPC_XY_VEL_MAX)",
        "m/s",
        _POSITION.horizontal_limit,
        above=0.0,
    )
    upward_limit = _parameter(
        "limit.velocity.up",
        "largest upward speed that the position loop asks for (MPC_Z_VEL_MAX_UP)",
        "m/s",
        _POSITION.upward_limit,
    )
    downward_limit = _parameter(
        "limit.velocity.down",
        "largest downward speed that the position loop asks for (MPC_Z_VEL_MAX_DN)",
        "m/s",
        _POSITION.downward_limit,
    )
    tilt_limit = _parameter(
        "limit.tilt",
        "largest tilt that the velocity loop asks for (MPC_TILTMAX_AIR)",
        "rad",
        _VELOCITY.tilt_limit,
        maximum=STEEPEST,
    )
    least_thrust = _parameter(
        "limit.thrust.least",
        "least thrust, as a share of full thrust (MPC_THR_MIN)",
        "1",
        _VELOCITY.least_thrust,
        above=0.0,
        maximum=1.0,
    )
    most_thrust = _parameter(
        "limit.thrust.most",
        "largest thrust, as a share of full thrust (MPC_THR_MAX)",
        "1",
        _VELOCITY.most_thrust,
        above=0.0,
        maximum=1.0,
    )
    horizontal_margin = _parameter(
        "limit.thrust.horizontal_margin",
        "share of full thrust that the vertical leaves to the horizontal if need be (MPC_THR_XY_MARG)",
        "1",
        _VELOCITY.horizontal_margin,
        maximum=1.0,
    )

    attitude_gain = _parameter(
        "gain.attitude",
        "angular velocity by attitude error, each axis (MC_ROLL_P, MC_PITCH_P, MC_YAW_P)",
        "1/s",
        _ATTITUDE.gain,
    )
    yaw_weight = Parameter(
        "weight of yaw beside tilt (MC_YAW_WEIGHT)", "1", _ATTITUDE.yaw_weight, minimum=0.0, maximum=1.0
    )
    rate_limit = _parameter(
        "limit.angular_velocity",
        "largest angular velocity that the attitude loop asks for (MC_ROLLRATE_MAX, MC_PITCHRATE_MAX, MC_YAWRATE_MAX)",
        "rad/s",
        _ATTITUDE.rate_limit,
    )
    rate_proportional = _parameter(
        "gain.rate",
        "angular acceleration by error of the angular velocity (MC_*RATE_P times full torque / inertia)",
        "1/s",
        _RATE.proportional,
    )
    rate_integral = _parameter(
        "gain.rate_integral",
        "angular acceleration by integral of the rate error (MC_*RATE_I times full torque / inertia)",
        "1/s2",
        _RATE.integral,
    )
    rate_derivative = _parameter(
        "gain.rate_derivative",
        "angular acceleration by derivative of the angular velocity (MC_*RATE_D times full torque / inertia)",
        "1",
        _RATE.derivative,
    )
    rate_feedforward = _parameter(
        "gain.rate_feedforward",
        "angular acceleration by desired angular velocity (MC_*RATE_FF times full torque / inertia)",
        "1/s",
        _RATE.feedforward,
    )
    rate_derivative_cutoff = _cutoff(
        "rate_derivative",
        "cutoff of the low-pass of the rate derivative (IMU_DGYRO_CUTOFF: 30 Hz)",
        _RATE.derivative_cutoff,
    )
    rate_yaw_cutoff = _cutoff(
        "yaw_torque", "cutoff of the low-pass of the yaw command (MC_YAW_TQ_CUTOFF: 2 Hz)", _RATE.yaw_cutoff
    )
    rate_integral_limit = _parameter(
        "limit.rate_integral",
        "largest integral, as a share of a full command (MC_RR_INT_LIM, MC_PR_INT_LIM, MC_YR_INT_LIM)",
        "1",
        _RATE.integral_limit,
    )

    desired_velocity = Local(
        "velocity to fly, of the position loop, inertial frame", "m/s", ZERO, frame=frames.inertial
    )
    held_velocity_integral = Local(
        "integral of the velocity loop, inertial frame", "m/s2", ZERO, name="velocity_integral", frame=frames.inertial
    )
    desired_angular_velocity = Local(
        "angular velocity that the attitude loop asks for, body frame", "rad/s", ZERO, frame=frames.body
    )
    held_rate_integral = Local(
        "integral of the rate loop, body frame", "rad/s2", ZERO, name="rate_integral", frame=frames.body
    )

    velocity_ratio = FixedParameter(
        "samples from one run of the position and velocity loops to the next", None, VELOCITY_RATIO, minimum=1
    )
    attitude_ratio = FixedParameter(
        "samples from one run of the attitude loop to the next", None, ATTITUDE_RATIO, minimum=1
    )
