"""The variables of a controller FMU: what any controller offers, and what this law adds."""

from fmu_kit.trajectory import Trajectory
from fmu_kit.variables import INERTIA_AXES, QUATERNION_AXES, Variable, vector


def _input(name: str, description: str, unit: str) -> Variable:
    return Variable(name=name, description=description, causality="input", variability="continuous", unit=unit)


def _local(name: str, description: str, unit: str | None) -> Variable:
    return Variable(name=name, description=description, causality="local", variability="discrete", unit=unit)


def _parameter(name: str, description: str, unit: str, start: float, **bounds: float) -> Variable:
    return Variable(
        name=name, description=description, causality="parameter", variability="fixed", unit=unit, start=start, **bounds
    )


def _gain(name: str, description: str, unit: str, start: float, **bounds: float) -> Variable:
    return Variable(
        name=name, description=description, causality="parameter", variability="tunable", unit=unit, start=start,
        **bounds,
    )  # fmt: skip


MEASUREMENT = (
    *vector(_input("position", "measured position P, inertial frame (north-east-down)", "m")),
    *vector(_input("velocity", "measured velocity V, inertial frame", "m/s")),
    *vector(
        _input("quaternion", "measured attitude Q, inertial to body; all zero: no measurement", "1"),
        QUATERNION_AXES,
        (0.0, 0.0, 0.0, 1.0),
    ),
    *vector(_input("angular_velocity", "measured angular velocity, body frame (forward-right-down)", "rad/s")),
)

REFERENCE = tuple(
    variable
    for derivative, unit in (
        ("position", "m"), ("velocity", "m/s"), ("acceleration", "m/s2"), ("jerk", "m/s3"), ("snap", "m/s4"),
    )  # fmt: skip
    for variable in vector(
        _input(f"reference.{derivative}", f"desired {derivative}, used when use_reference_inputs is true", unit)
    )
)

COMMAND = (
    Variable(
        name="thrust", description="total thrust along -z of the body, held between samples",
        causality="output", variability="discrete", unit="N",
    ),
    *vector(
        Variable(
            name="torque", description="body torque, held between samples",
            causality="output", variability="discrete", unit="N.m",
        )
    ),
)  # fmt: skip

_TRAJECTORY = Trajectory()

COMMON_PARAMETERS = (
    _parameter("trajectory.amplitude_x", "a_x of P_d = [a_x sin wt cos wt, a_y sin wt, z0 + vz t]", "m", _TRAJECTORY.amplitude_x),
    _parameter("trajectory.amplitude_y", "a_y of the built-in trajectory", "m", _TRAJECTORY.amplitude_y),
    _parameter("trajectory.frequency", "w of the built-in trajectory", "rad/s", _TRAJECTORY.frequency),
    _parameter("trajectory.start_z", "z0 of the built-in trajectory, positive down", "m", _TRAJECTORY.start_z),
    _parameter("trajectory.rate_z", "vz of the built-in trajectory, positive down", "m/s", _TRAJECTORY.rate_z),
    _parameter("mass", "nominal mass m", "kg", 1.0, above=0.0),
    _parameter("gravity", "nominal gravity g", "m/s2", 9.81, minimum=0.0),
    *vector(
        _parameter("inertia", "entry of the nominal inertia matrix J, body frame", "kg.m2", 0.0),
        INERTIA_AXES,
        (1.0, 1.0, 1.0, 0.0, 0.0, 0.0),
    ),
    _parameter("sample_period", "period of the FMU's own sample clock; 0: sample at every communication point", "s", 0.01, minimum=0.0),
    _parameter("sample_offset", "time of the first sample of the FMU's own clock", "s", 0.0, minimum=0.0),
)  # fmt: skip

GAINS = (
    *vector(_gain("gain.translation", "k_t, of tanh(s) in the virtual control (22)", "m/s2", 2.0, minimum=0.0)),
    _gain("gain.disturbance", "beta, of tanh(s) against the disturbance (32)", "m/s2", 0.99, minimum=0.0),
    _gain("gain.surface", "k_s of the sliding surface (19)-(21); in 1/s for an exponent of 1", "1/s", 5.0, minimum=0.0),
    _gain("gain.eta", "k_eta, of the attitude error in Psi (29)", "rad/s", 15.0, minimum=0.0),
    _gain("gain.theta", "k_theta, of Theta in the torque (30)", "N.m.s", 15.0, minimum=0.0),
    _gain("gain.attitude", "k_q, of the attitude error in the torque (30)", "N.m", 15.0, above=0.0),
    _gain("surface_exponent", "beta_t of the sliding surface (19)-(21)", "1", 0.99, above=0.0, maximum=1.0),
    _gain("boundary_layer", "epsilon: below this position error the surface is linear", "m", 0.001, above=0.0),
    _gain("coupling", "kappa, of the attitude loop to s: 1 as the proof needs, 0 none, k_q as printed", "1", 1.0),
)  # fmt: skip

COMMON_LOCALS = (
    *vector(_local("desired_quaternion", "desired attitude Q_d as of the last sample (12)", "1"), QUATERNION_AXES),
    *vector(_local("position_error", "P - P_d as of the last sample, inertial frame", "m")),
    *vector(_local("velocity_error", "V - V_d as of the last sample, inertial frame", "m/s")),
    *vector(_local("attitude_error", "Q_d^-1 Q as of the last sample (8)", "1"), QUATERNION_AXES),
    *vector(_local("angular_velocity_error", "angular velocity minus the desired one, body frame", "rad/s")),
)

LAW_LOCALS = (
    *vector(_local("sliding", "sliding variable s as of the last sample (19)-(21)", "m/s")),
    *vector(_local("theta", "Theta as of the last sample (9), body frame", "rad/s")),
    *vector(_local("desired_angular_velocity", "Omega_d as of the last sample (13), desired body frame", "rad/s")),
    _local("energy", "energy function L as of the last sample (33), s.s taken per unit mass", "J"),
)

COUNT_AND_SWITCH = (
    Variable(
        name="sample_count", description="number of samples since the start, initialisation not counted",
        causality="local", variability="discrete", start=0,
    ),
    Variable(
        name="use_reference_inputs", description="true: follow reference.*; false: the built-in trajectory",
        causality="parameter", variability="fixed", start=False,
    ),
)  # fmt: skip

UNIFIED = (
    *MEASUREMENT, *REFERENCE, *COMMAND, *COMMON_PARAMETERS, *GAINS, *COMMON_LOCALS, *LAW_LOCALS, *COUNT_AND_SWITCH,
)  # fmt: skip
"""All variables of the unified controller; the place in this list is the value reference."""
