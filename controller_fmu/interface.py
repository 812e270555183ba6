"""The variables that every controller FMU has; each law adds its own."""

from fmu_kit.trajectory import Trajectory
from fmu_kit.variables import (
    INERTIA_AXES,
    QUATERNION_AXES,
    continuous_input,
    discrete_local,
    discrete_output,
    fixed_parameter,
    vector,
)

MEASUREMENT = (
    *vector(continuous_input("position", "measured position P, inertial frame (north-east-down)", "m")),
    *vector(continuous_input("velocity", "measured velocity V, inertial frame", "m/s")),
    *vector(
        continuous_input("quaternion", "measured attitude Q, inertial to body; all zero: no measurement", "1"),
        QUATERNION_AXES,
        (0.0, 0.0, 0.0, 1.0),
    ),
    *vector(
        continuous_input("angular_velocity", "measured angular velocity, body frame (forward-right-down)", "rad/s")
    ),
)

REFERENCE = tuple(
    variable
    for derivative, unit in (
        ("position", "m"),
        ("velocity", "m/s"),
        ("acceleration", "m/s2"),
        ("jerk", "m/s3"),
        ("snap", "m/s4"),
    )
    for variable in vector(
        continuous_input(
            f"reference.{derivative}", f"desired {derivative}, used when use_reference_inputs is true", unit
        )
    )
)

COMMAND = (
    discrete_output("thrust", "total thrust along -z of the body, held between samples", "N"),
    *vector(discrete_output("torque", "body torque, held between samples", "N.m")),
)

_TRAJECTORY = Trajectory()

COMMON_PARAMETERS = (
    fixed_parameter(
        "trajectory.amplitude_x", "a_x of [a_x sin wt cos wt, a_y sin wt, z0 + vz t]", "m", _TRAJECTORY.amplitude_x
    ),
    fixed_parameter("trajectory.amplitude_y", "a_y of the built-in trajectory", "m", _TRAJECTORY.amplitude_y),
    fixed_parameter("trajectory.frequency", "w of the built-in trajectory", "rad/s", _TRAJECTORY.frequency),
    fixed_parameter("trajectory.start_z", "z0 of the built-in trajectory, positive down", "m", _TRAJECTORY.start_z),
    fixed_parameter("trajectory.rate_z", "vz of the built-in trajectory, positive down", "m/s", _TRAJECTORY.rate_z),
    fixed_parameter("mass", "nominal mass m", "kg", 1.0, above=0.0),
    fixed_parameter("gravity", "nominal gravity g", "m/s2", 9.81, minimum=0.0),
    *vector(
        fixed_parameter("inertia", "entry of the nominal inertia matrix J, body frame", "kg.m2", 0.0),
        INERTIA_AXES,
        (1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
    ),
    fixed_parameter(
        "sample_period",
        "of the FMU's own clock; 0: sample at every communication point from sample_offset on",
        "s",
        0.01,
        minimum=0.0,
    ),
    fixed_parameter("sample_offset", "time of the first sample of the FMU's own clock", "s", 0.0, minimum=0.0),
)

COMMON_LOCALS = (
    *vector(
        discrete_local("desired_quaternion", "desired attitude Q_d as of the last sample (12)", "1"), QUATERNION_AXES
    ),
    *vector(discrete_local("position_error", "P - P_d as of the last sample, inertial frame", "m")),
    *vector(discrete_local("velocity_error", "V - V_d as of the last sample, inertial frame", "m/s")),
    *vector(discrete_local("attitude_error", "Q_d^-1 Q as of the last sample (8)", "1"), QUATERNION_AXES),
    *vector(discrete_local("angular_velocity_error", "angular velocity minus the desired one, body frame", "rad/s")),
)

COUNT_AND_SWITCH = (
    discrete_local("sample_count", "number of samples since the start, initialisation not counted", None, 0),
    fixed_parameter("use_reference_inputs", "true: follow reference.*; false: the built-in trajectory", None, False),
)
