"""The variables of the cascade's FMU: those of every controller, and what its loops add, with PX4's names for them."""

from controller_fmu.cascaded.airframe import Airframe
from controller_fmu.cascaded.attitude_loop import AttitudeLoop
from controller_fmu.cascaded.position_loop import PositionLoop
from controller_fmu.cascaded.rate_loop import RateLoop
from controller_fmu.cascaded.velocity_loop import VelocityLoop
from controller_fmu.interface import (
    COMMAND,
    COMMON_LOCALS,
    COMMON_PARAMETERS,
    COUNT_AND_SWITCH,
    MEASUREMENT,
    REFERENCE,
)
from fmu_kit.algebra import Vec3
from fmu_kit.variables import Variable, discrete_local, fixed_parameter, tunable_parameter, vector

VELOCITY_RATIO, ATTITUDE_RATIO = 20, 4
"""With a `sample_period` of 1 ms these are PX4's 50 and 250 Hz below a rate loop of 1000 Hz."""
STEEPEST = 89.0 / 90.0 * 1.5707963267948966
"""[rad]; a tilt limit is no larger, as with PX4"""

_POSITION, _VELOCITY, _ATTITUDE, _RATE, _FRAME = PositionLoop(), VelocityLoop(), AttitudeLoop(), RateLoop(), Airframe()


def _gain(name: str, description: str, unit: str, start: Vec3, above: float | None = None) -> list[Variable]:
    """A gain of each axis, at least 0 or larger than `above`."""
    bound = {"minimum": 0.0} if above is None else {"above": above}
    return vector(tunable_parameter(name, description, unit, **bound), start=start)


def _plane(
    name: str, description: str, unit: str, start: Vec3, names: tuple[str, str], *, positive: bool = False
) -> list[Variable]:
    """A gain of both horizontal axes and one of the vertical axis; `names` are PX4's."""
    horizontal = {"above": 0.0} if positive else {"minimum": 0.0}
    return [
        tunable_parameter(f"{name}.horizontal", f"{description} ({names[0]})", unit, start.x, **horizontal),
        tunable_parameter(f"{name}.vertical", f"{description} ({names[1]})", unit, start.z, minimum=0.0),
    ]


AIRFRAME = (
    fixed_parameter("motor.thrust_max", "largest thrust T_m of each motor", "N", _FRAME.motor_thrust, above=0.0),
    fixed_parameter("motor.arm.x", "from the centre to each motor along x of the body", "m", _FRAME.arm_x, above=0.0),
    fixed_parameter("motor.arm.y", "from the centre to each motor along y of the body", "m", _FRAME.arm_y, above=0.0),
    fixed_parameter(
        "motor.drag_to_thrust", "torque about z by thrust of a propeller", "m", _FRAME.drag_to_thrust, above=0.0
    ),
)

TRANSLATION = (
    *_plane("gain.position", "velocity by position error", "1/s", _POSITION.gain, ("MPC_XY_P", "MPC_Z_P")),
    *_plane(
        "gain.velocity",
        "acceleration by velocity error",
        "1/s",
        _VELOCITY.proportional,
        ("MPC_XY_VEL_P_ACC", "MPC_Z_VEL_P_ACC"),
        positive=True,
    ),
    *_plane(
        "gain.velocity_integral",
        "acceleration by integral of the velocity error",
        "1/s2",
        _VELOCITY.integral,
        ("MPC_XY_VEL_I_ACC", "MPC_Z_VEL_I_ACC"),
    ),
    *_plane(
        "gain.velocity_derivative",
        "acceleration by derivative of the velocity",
        "1",
        _VELOCITY.derivative,
        ("MPC_XY_VEL_D_ACC", "MPC_Z_VEL_D_ACC"),
    ),
    tunable_parameter(
        "cutoff.velocity_derivative",
        "of its low-pass (MPC_VELD_LP: 5 Hz)",
        "rad/s",
        _VELOCITY.derivative_cutoff,
        above=0.0,
    ),
    tunable_parameter("limit.velocity.horizontal", "(MPC_XY_VEL_MAX)", "m/s", _POSITION.horizontal_limit, above=0.0),
    tunable_parameter("limit.velocity.up", "(MPC_Z_VEL_MAX_UP)", "m/s", _POSITION.upward_limit, minimum=0.0),
    tunable_parameter("limit.velocity.down", "(MPC_Z_VEL_MAX_DN)", "m/s", _POSITION.downward_limit, minimum=0.0),
    tunable_parameter("limit.tilt", "(MPC_TILTMAX_AIR)", "rad", _VELOCITY.tilt_limit, minimum=0.0, maximum=STEEPEST),
    tunable_parameter(
        "limit.thrust.least", "of full thrust (MPC_THR_MIN)", "1", _VELOCITY.least_thrust, above=0.0, maximum=1.0
    ),
    tunable_parameter(
        "limit.thrust.most", "of full thrust (MPC_THR_MAX)", "1", _VELOCITY.most_thrust, above=0.0, maximum=1.0
    ),
    tunable_parameter(
        "limit.thrust.horizontal_margin",
        "of full thrust: what the vertical leaves to the horizontal if need be (MPC_THR_XY_MARG)",
        "1",
        _VELOCITY.horizontal_margin,
        minimum=0.0,
        maximum=1.0,
    ),
)

ROTATION = (
    *_gain(
        "gain.attitude",
        "angular velocity by attitude error, each axis (MC_ROLL_P, MC_PITCH_P, MC_YAW_P)",
        "1/s",
        _ATTITUDE.gain,
    ),
    tunable_parameter(
        "yaw_weight", "of yaw beside tilt (MC_YAW_WEIGHT)", "1", _ATTITUDE.yaw_weight, minimum=0.0, maximum=1.0
    ),
    *vector(
        tunable_parameter(
            "limit.angular_velocity", "(MC_ROLLRATE_MAX, MC_PITCHRATE_MAX, MC_YAWRATE_MAX)", "rad/s", minimum=0.0
        ),
        start=_ATTITUDE.rate_limit,
    ),
    *_gain(
        "gain.rate",
        "angular acceleration by error of the angular velocity (MC_*RATE_P times full torque / inertia)",
        "1/s",
        _RATE.proportional,
    ),
    *_gain(
        "gain.rate_integral",
        "angular acceleration by integral of that error (MC_*RATE_I times full torque / inertia)",
        "1/s2",
        _RATE.integral,
    ),
    *_gain(
        "gain.rate_derivative",
        "angular acceleration by derivative of the angular velocity (MC_*RATE_D times full torque / inertia)",
        "1",
        _RATE.derivative,
    ),
    *_gain(
        "gain.rate_feedforward",
        "angular acceleration by desired angular velocity (MC_*RATE_FF times full torque / inertia)",
        "1/s",
        _RATE.feedforward,
    ),
    tunable_parameter(
        "cutoff.rate_derivative",
        "of its low-pass (IMU_DGYRO_CUTOFF: 30 Hz)",
        "rad/s",
        _RATE.derivative_cutoff,
        above=0.0,
    ),
    tunable_parameter(
        "cutoff.yaw_torque",
        "of the low-pass of the yaw command (MC_YAW_TQ_CUTOFF: 2 Hz)",
        "rad/s",
        _RATE.yaw_cutoff,
        above=0.0,
    ),
    *vector(
        tunable_parameter(
            "limit.rate_integral",
            "of a full command (MC_RR_INT_LIM, MC_PR_INT_LIM, MC_YR_INT_LIM)",
            "1",
            minimum=0.0,
        ),
        start=_RATE.integral_limit,
    ),
)

LOOP_LOCALS = (
    *vector(discrete_local("desired_velocity", "velocity to fly, of the position loop, inertial frame", "m/s")),
    *vector(discrete_local("velocity_integral", "integral of the velocity loop, inertial frame", "m/s2")),
    *vector(discrete_local("desired_angular_velocity", "of the attitude loop, body frame", "rad/s")),
    *vector(discrete_local("rate_integral", "integral of the rate loop, body frame", "rad/s2")),
)

RATIOS = (
    fixed_parameter(
        "velocity_ratio",
        "samples from one run of the position and velocity loops to the next",
        None,
        VELOCITY_RATIO,
        minimum=1,
    ),
    fixed_parameter(
        "attitude_ratio", "samples from one run of the attitude loop to the next", None, ATTITUDE_RATIO, minimum=1
    ),
)

CASCADED = (
    *MEASUREMENT,
    *REFERENCE,
    *COMMAND,
    *COMMON_PARAMETERS,
    *AIRFRAME,
    *TRANSLATION,
    *ROTATION,
    *COMMON_LOCALS,
    *LOOP_LOCALS,
    *COUNT_AND_SWITCH,
    *RATIOS,
)
"""All variables of the cascade; the place in this list is the value reference."""
