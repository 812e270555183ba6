"""The variables of the cascade's FMU: those of every controller, and those of its loops, with PX4's names."""

from controller_fmu.cascaded.airframe import Airframe
from controller_fmu.cascaded.attitude_loop import AttitudeLoop
from controller_fmu.cascaded.position_loop import PositionLoop
from controller_fmu.cascaded.rate_loop import RateLoop
from controller_fmu.cascaded.velocity_loop import VelocityLoop
from controller_fmu.interface import ControllerInterface
from fmu_kit import frames
from fmu_kit.algebra import ZERO
from fmu_kit.interface import FixedParameter, Local, Parameter

VELOCITY_RATIO, ATTITUDE_RATIO = 20, 4
"""Ratios of periods; with a `sample_period` of 1 ms these give PX4's 50 and 250 Hz, for a rate loop of 1000 Hz."""
STEEPEST = 89.0 / 90.0 * 1.5707963267948966
"""Bound of the tilt limit [rad], as in PX4"""

_POSITION, _VELOCITY, _ATTITUDE, _RATE, _FRAME = PositionLoop(), VelocityLoop(), AttitudeLoop(), RateLoop(), Airframe()


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

    position_horizontal = Parameter(
        "horizontal velocity by position error (MPC_XY_P)",
        "1/s",
        _POSITION.gain.x,
        name="gain.position.horizontal",
        minimum=0.0,
    )
    position_vertical = Parameter(
        "vertical velocity by position error (MPC_Z_P)",
        "1/s",
        _POSITION.gain.z,
        name="gain.position.vertical",
        minimum=0.0,
    )
    velocity_horizontal = Parameter(
        "horizontal acceleration by velocity error (MPC_XY_VEL_P_ACC)",
        "1/s",
        _VELOCITY.proportional.x,
        name="gain.velocity.horizontal",
        above=0.0,
    )
    velocity_vertical = Parameter(
        "vertical acceleration by velocity error (MPC_Z_VEL_P_ACC)",
        "1/s",
        _VELOCITY.proportional.z,
        name="gain.velocity.vertical",
        minimum=0.0,
    )
    velocity_integral_horizontal = Parameter(
        "horizontal acceleration by integral of the velocity error (MPC_XY_VEL_I_ACC)",
        "1/s2",
        _VELOCITY.integral.x,
        name="gain.velocity_integral.horizontal",
        minimum=0.0,
    )
    velocity_integral_vertical = Parameter(
        "vertical acceleration by integral of the velocity error (MPC_Z_VEL_I_ACC)",
        "1/s2",
        _VELOCITY.integral.z,
        name="gain.velocity_integral.vertical",
        minimum=0.0,
    )
    velocity_derivative_horizontal = Parameter(
        "horizontal acceleration by derivative of the velocity (MPC_XY_VEL_D_ACC)",
        "1",
        _VELOCITY.derivative.x,
        name="gain.velocity_derivative.horizontal",
        minimum=0.0,
    )
    velocity_derivative_vertical = Parameter(
        "vertical acceleration by derivative of the velocity (MPC_Z_VEL_D_ACC)",
        "1",
        _VELOCITY.derivative.z,
        name="gain.velocity_derivative.vertical",
        minimum=0.0,
    )
    velocity_derivative_cutoff = Parameter(
        "cutoff of the low-pass of the velocity derivative (MPC_VELD_LP: 5 Hz)",
        "rad/s",
        _VELOCITY.derivative_cutoff,
        name="cutoff.velocity_derivative",
        above=0.0,
        quantity="AngularFrequency",
    )
    horizontal_limit = Parameter(
        "largest horizontal speed that the position loop asks for (MPC_XY_VEL_MAX)",
        "m/s",
        _POSITION.horizontal_limit,
        name="limit.velocity.horizontal",
        above=0.0,
    )
    upward_limit = Parameter(
        "largest upward speed that the position loop asks for (MPC_Z_VEL_MAX_UP)",
        "m/s",
        _POSITION.upward_limit,
        name="limit.velocity.up",
        minimum=0.0,
    )
    downward_limit = Parameter(
        "largest downward speed that the position loop asks for (MPC_Z_VEL_MAX_DN)",
        "m/s",
        _POSITION.downward_limit,
        name="limit.velocity.down",
        minimum=0.0,
    )
    tilt_limit = Parameter(
        "largest tilt that the velocity loop asks for (MPC_TILTMAX_AIR)",
        "rad",
        _VELOCITY.tilt_limit,
        name="limit.tilt",
        minimum=0.0,
        maximum=STEEPEST,
    )
    least_thrust = Parameter(
        "least thrust, as a share of full thrust (MPC_THR_MIN)",
        "1",
        _VELOCITY.least_thrust,
        name="limit.thrust.least",
        above=0.0,
        maximum=1.0,
    )
    most_thrust = Parameter(
        "largest thrust, as a share of full thrust (MPC_THR_MAX)",
        "1",
        _VELOCITY.most_thrust,
        name="limit.thrust.most",
        above=0.0,
        maximum=1.0,
    )
    horizontal_margin = Parameter(
        "share of full thrust that the vertical leaves to the horizontal if need be (MPC_THR_XY_MARG)",
        "1",
        _VELOCITY.horizontal_margin,
        name="limit.thrust.horizontal_margin",
        minimum=0.0,
        maximum=1.0,
    )

    attitude_gain = Parameter(
        "angular velocity by attitude error, each axis (MC_ROLL_P, MC_PITCH_P, MC_YAW_P)",
        "1/s",
        _ATTITUDE.gain,
        name="gain.attitude",
        minimum=0.0,
    )
    yaw_weight = Parameter(
        "weight of yaw beside tilt (MC_YAW_WEIGHT)", "1", _ATTITUDE.yaw_weight, minimum=0.0, maximum=1.0
    )
    rate_limit = Parameter(
        "largest angular velocity that the attitude loop asks for (MC_ROLLRATE_MAX, MC_PITCHRATE_MAX, MC_YAWRATE_MAX)",
        "rad/s",
        _ATTITUDE.rate_limit,
        name="limit.angular_velocity",
        minimum=0.0,
    )
    rate_proportional = Parameter(
        "angular acceleration by error of the angular velocity (MC_*RATE_P times full torque / inertia)",
        "1/s",
        _RATE.proportional,
        name="gain.rate",
        minimum=0.0,
    )
    rate_integral = Parameter(
        "angular acceleration by integral of the rate error (MC_*RATE_I times full torque / inertia)",
        "1/s2",
        _RATE.integral,
        name="gain.rate_integral",
        minimum=0.0,
    )
    rate_derivative = Parameter(
        "angular acceleration by derivative of the angular velocity (MC_*RATE_D times full torque / inertia)",
        "1",
        _RATE.derivative,
        name="gain.rate_derivative",
        minimum=0.0,
    )
    rate_feedforward = Parameter(
        "angular acceleration by desired angular velocity (MC_*RATE_FF times full torque / inertia)",
        "1/s",
        _RATE.feedforward,
        name="gain.rate_feedforward",
        minimum=0.0,
    )
    rate_derivative_cutoff = Parameter(
        "cutoff of the low-pass of the rate derivative (IMU_DGYRO_CUTOFF: 30 Hz)",
        "rad/s",
        _RATE.derivative_cutoff,
        name="cutoff.rate_derivative",
        above=0.0,
        quantity="AngularFrequency",
    )
    rate_yaw_cutoff = Parameter(
        "cutoff of the low-pass of the yaw command (MC_YAW_TQ_CUTOFF: 2 Hz)",
        "rad/s",
        _RATE.yaw_cutoff,
        name="cutoff.yaw_torque",
        above=0.0,
        quantity="AngularFrequency",
    )
    rate_integral_limit = Parameter(
        "largest integral, as a share of a full command (MC_RR_INT_LIM, MC_PR_INT_LIM, MC_YR_INT_LIM)",
        "1",
        _RATE.integral_limit,
        name="limit.rate_integral",
        minimum=0.0,
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
