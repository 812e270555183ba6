"""What people wire to: names, causalities, variabilities, units and starts, written down apart from the sources."""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

XYZ, XYZW, INERTIA = ("x", "y", "z"), ("x", "y", "z", "w"), ("xx", "yy", "zz", "xy", "xz", "yz")
MOTORS = ("front_right", "rear_left", "front_left", "rear_right")
PLANES = ("horizontal", "vertical")


class Row(NamedTuple):
    """One scalar variable; a start of None: calculated."""

    name: str
    causality: str
    variability: str
    type: str
    unit: str | None
    start: float | bool | None


def row(
    name: str,
    kind: str,
    unit: str | None,
    start: float | bool | None = None,
    *,
    axes: Iterable[str] = (),
    starts: Iterable[float] = (),
    type: str = "Real",
) -> Iterator[Row]:
    """The rows of a scalar, or of a vector with these axes."""
    causality, variability = kind.split()
    names = [f"{name}.{axis}" for axis in axes] or [name]
    values: list[float | bool | None] = [*starts] or [start] * len(names)
    for scalar, value in zip(names, values, strict=True):
        yield Row(scalar, causality, variability, type, unit, value)


def _motion(kind: str, starts: Iterable[float] = ()) -> Iterator[Row]:
    at_rest = 0.0 if kind == "input continuous" else None
    yield from row("position", kind, "m", at_rest, axes=XYZ)
    yield from row("velocity", kind, "m/s", at_rest, axes=XYZ)
    yield from row("quaternion", kind, "1", axes=XYZW, starts=starts)
    yield from row("angular_velocity", kind, "rad/s", at_rest, axes=XYZ)


_FRAME = (
    *row("frame", "parameter fixed", None, 1.0, type="Enumeration"),
    *row("frame_index", "parameter fixed", None, 0, type="Integer"),
)


def _body() -> Iterator[Row]:
    yield from row("mass", "parameter fixed", "kg", 1.0)
    yield from row("gravity", "parameter fixed", "m/s2", 9.81)
    yield from row("inertia", "parameter fixed", "kg.m2", axes=INERTIA, starts=(1.0, 1.0, 1.0, 0.0, 0.0, 0.0))


PLANT = (
    *_FRAME,
    *row("thrust", "input continuous", "N", 9.81),
    *row("torque", "input continuous", "N.m", 0.0, axes=XYZ),
    *row("external_force", "input continuous", "N", 0.0, axes=XYZ),
    *_motion("output continuous"),
    *_body(),
    *row("initial.position", "parameter fixed", "m", 0.0, axes=XYZ),
    *row("initial.velocity", "parameter fixed", "m/s", 0.0, axes=XYZ),
    *row("initial.quaternion", "parameter fixed", "1", axes=XYZW, starts=(0.1699, 0.3058, 0.1699, 0.9212)),
    *row("initial.angular_velocity", "parameter fixed", "rad/s", 0.0, axes=XYZ),
    *row("wind.amplitude", "parameter tunable", "N", 0.01, axes=XYZ),
    *row("wind.frequency", "parameter tunable", "rad/s", 0.1),
    *row("thrust_max", "parameter fixed", "N", 1e6),
    *row("thrust_min", "parameter fixed", "N", 0.0),
    *row("torque_max", "parameter fixed", "N.m", 1e6),
    *row("actuator_time_constant", "parameter fixed", "s", 0.0),
    *row("max_internal_step", "parameter fixed", "s", 0.002),
    *row("motor.thrust_max", "parameter fixed", "N", 0.0),
    *row("motor.thrust_min", "parameter fixed", "N", 0.0),
    *row("motor.arm", "parameter fixed", "m", 0.1, axes=("x", "y")),
    *row("motor.drag_to_thrust", "parameter fixed", "m", 0.016),
    *row("motor.time_constant", "parameter fixed", "s", 0.0, axes=("up", "down")),
    *row("payload.mass", "parameter tunable", "kg", 0.0),
    *row("payload.drop_time", "parameter tunable", "s", 0.0),
    *row("acceleration", "local continuous", "m/s2", axes=XYZ),
    *row("wind.force", "local continuous", "N", axes=XYZ),
    *row("tilt", "local continuous", "rad"),
)

_REFERENCE_UNITS = {"position": "m", "velocity": "m/s", "acceleration": "m/s2", "jerk": "m/s3", "snap": "m/s4"}

_COMMON = (
    *_FRAME,
    *_motion("input continuous", (0.0, 0.0, 0.0, 1.0)),
    *(
        variable
        for derivative, unit in _REFERENCE_UNITS.items()
        for variable in row(f"reference.{derivative}", "input continuous", unit, 0.0, axes=XYZ)
    ),
    *row("reference.yaw", "input continuous", "rad", 0.0),
    *row("reference.yaw_rate", "input continuous", "rad/s", 0.0),
    *row("use_reference_inputs", "parameter fixed", None, False, type="Boolean"),
    *row("trajectory.amplitude_x", "parameter fixed", "m", 4.0),
    *row("trajectory.amplitude_y", "parameter fixed", "m", 4.0),
    *row("trajectory.frequency", "parameter fixed", "rad/s", 0.15),
    *row("trajectory.start_z", "parameter fixed", "m", 2.0),
    *row("trajectory.rate_z", "parameter fixed", "m/s", 0.1),
    *row("trajectory.yaw", "parameter fixed", "rad", 0.0),
    *row("trajectory.yaw_rate", "parameter fixed", "rad/s", 0.0),
    *row("thrust", "output discrete", "N"),
    *row("torque", "output discrete", "N.m", axes=XYZ),
    *_body(),
    *row("motor_thrust", "output discrete", "N", axes=MOTORS),
    *row("sample_period", "parameter fixed", "s", 0.01),
    *row("sample_offset", "parameter fixed", "s", 0.0),
    *row("desired_quaternion", "local discrete", "1", axes=XYZW),
    *row("position_error", "local discrete", "m", axes=XYZ),
    *row("velocity_error", "local discrete", "m/s", axes=XYZ),
    *row("attitude_error", "local discrete", "1", axes=XYZW),
    *row("angular_velocity_error", "local discrete", "rad/s", axes=XYZ),
    *row("sample_count", "local discrete", None, type="Integer"),
)

_SCALING = (
    *row("gain_scaling", "parameter fixed", None, 1.0, type="Enumeration"),
    *row("gain_scaling_index", "parameter fixed", None, 0, type="Integer"),
)

_MIXER = (
    *row("motor.arm", "parameter fixed", "m", 0.0, axes=("x", "y")),
    *row("motor.drag_to_thrust", "parameter fixed", "m", 0.0),
)

_REDESIGN = (
    *row("hold_period", "parameter fixed", "s", 0.0),
    *row("weight", "parameter fixed", "1", 1.0),
    *row("prediction", "parameter fixed", "s", 0.0),
    *row("discretisation", "parameter fixed", None, 1.0, type="Enumeration"),
    *row("discretisation_index", "parameter fixed", None, 0, type="Integer"),
    *row("stages", "parameter fixed", None, 3, type="Integer"),
)

UNIFIED = (
    *_COMMON,
    *_MIXER,
    *_REDESIGN,
    *_SCALING,
    *row("gain.translation", "parameter tunable", "m/s2", 2.0, axes=XYZ),
    *row("gain.disturbance", "parameter tunable", "m/s2", 0.99),
    *row("gain.surface", "parameter tunable", "1/s", 5.0),
    *row("gain.eta", "parameter tunable", "rad/s", 15.0),
    *row("gain.theta", "parameter tunable", "N.m.s", 15.0),
    *row("gain.attitude", "parameter tunable", "N.m", 15.0),
    *row("surface_exponent", "parameter tunable", "1", 0.99),
    *row("boundary_layer", "parameter tunable", "m", 0.001),
    *row("coupling", "parameter tunable", "kg", 1.0),
    *row("sliding", "local discrete", "m/s", axes=XYZ),
    *row("theta", "local discrete", "rad/s", axes=XYZ),
    *row("desired_angular_velocity", "local discrete", "rad/s", axes=XYZ),
    *row("energy", "local discrete", "J"),
)

GEOMETRIC = (
    *_COMMON,
    *_MIXER,
    *_REDESIGN,
    *_SCALING,
    *row("gain.position", "parameter tunable", "1/s2", 4.0),
    *row("gain.velocity", "parameter tunable", "1/s", 2.8),
    *row("gain.attitude", "parameter tunable", "N.m", 104.26),
    *row("gain.angular_velocity", "parameter tunable", "N.m.s", 30.06),
    *row("heading", "parameter tunable", "rad", 0.0),
    *row("rotation_error", "local discrete", "1", axes=XYZ),
    *row("error_function", "local discrete", "1"),
    *row("desired_angular_velocity", "local discrete", "rad/s", axes=XYZ),
    *row("energy", "local discrete", "J"),
)

_FULL = 2.0 * math.sqrt(2.0) * 5.0 * 0.2 / 0.025
_FULL_YAW = 4.0 * 5.0 * (2.0 / 3.0)
"""[rad/s²] of a full command, about x and y, and about z"""
_RATES = (math.radians(220.0), math.radians(220.0), math.radians(200.0))

CASCADED = (
    *_COMMON,
    *row("motor.thrust_max", "parameter fixed", "N", 5.0),
    *row("motor.arm.x", "parameter fixed", "m", 8.0),
    *row("motor.arm.y", "parameter fixed", "m", 8.0),
    *row("motor.drag_to_thrust", "parameter fixed", "m", 2.0 / 3.0),
    *row("gain.position", "parameter tunable", "1/s", axes=PLANES, starts=(0.95, 1.0)),
    *row("gain.velocity", "parameter tunable", "1/s", axes=PLANES, starts=(1.8, 4.0)),
    *row("gain.velocity_integral", "parameter tunable", "1/s2", axes=PLANES, starts=(0.4, 2.0)),
    *row("gain.velocity_derivative", "parameter tunable", "1", axes=PLANES, starts=(0.2, 0.0)),
    *row("cutoff.velocity_derivative", "parameter tunable", "rad/s", 10.0 * math.pi),
    *row("limit.velocity", "parameter tunable", "m/s", axes=("horizontal", "up", "down"), starts=(12.0, 3.0, 1.5)),
    *row("limit.tilt", "parameter tunable", "rad", math.radians(45.0)),
    *row(
        "limit.thrust", "parameter tunable", "1", axes=("least", "most", "horizontal_margin"), starts=(0.12, 1.0, 0.3)
    ),
    *row("gain.attitude", "parameter tunable", "1/s", axes=XYZ, starts=(6.5, 6.5, 2.8)),
    *row("yaw_weight", "parameter tunable", "1", 0.4),
    *row("limit.angular_velocity", "parameter tunable", "rad/s", axes=XYZ, starts=_RATES),
    *row("gain.rate", "parameter tunable", "1/s", axes=XYZ, starts=(0.15 * _FULL, 0.15 * _FULL, 0.2 * _FULL_YAW)),
    *row(
        "gain.rate_integral", "parameter tunable", "1/s2", axes=XYZ, starts=(0.2 * _FULL, 0.2 * _FULL, 0.1 * _FULL_YAW)
    ),
    *row("gain.rate_derivative", "parameter tunable", "1", axes=XYZ, starts=(0.003 * _FULL, 0.003 * _FULL, 0.0)),
    *row("gain.rate_feedforward", "parameter tunable", "1/s", 0.0, axes=XYZ),
    *row("cutoff.rate_derivative", "parameter tunable", "rad/s", 60.0 * math.pi),
    *row("cutoff.yaw_torque", "parameter tunable", "rad/s", 4.0 * math.pi),
    *row("limit.rate_integral", "parameter tunable", "1", 0.3, axes=XYZ),
    *row("desired_velocity", "local discrete", "m/s", axes=XYZ),
    *row("velocity_integral", "local discrete", "m/s2", axes=XYZ),
    *row("desired_angular_velocity", "local discrete", "rad/s", axes=XYZ),
    *row("rate_integral", "local discrete", "rad/s2", axes=XYZ),
    *row("velocity_ratio", "parameter fixed", None, 20, type="Integer"),
    *row("attitude_ratio", "parameter fixed", None, 4, type="Integer"),
)

TABLES = {
    "QuadrotorPlant": PLANT,
    "UnifiedController": UNIFIED,
    "GeometricController": GEOMETRIC,
    "CascadedController": CASCADED,
}
