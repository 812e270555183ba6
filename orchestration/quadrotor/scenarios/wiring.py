"""Names of both FMUs and of their variables, and their connections; no other file of this package has them."""

from collections.abc import Iterable, Mapping

from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD, TRAJECTORY

DEFAULT_CONTROLLER = "UnifiedController"
DEFAULT_PLANT = "QuadrotorPlant"


def components(name: str, axes: Iterable[str] = "xyz") -> tuple[str, ...]:
    """The scalar variables of a vector."""
    return tuple(f"{name}.{axis}" for axis in axes)


POSITION = components("position")
VELOCITY = components("velocity")
QUATERNION = components("quaternion", "xyzw")
ANGULAR_VELOCITY = components("angular_velocity")

MEASUREMENT = POSITION + VELOCITY + QUATERNION + ANGULAR_VELOCITY
"""Outputs of the plant and, by the same names, inputs of the controller."""

COMMAND = ("thrust", *components("torque"))
"""Outputs of the controller and, by the same names, inputs of the plant."""

_REFERENCE_UNITS = {"position": "m", "velocity": "m/s", "acceleration": "m/s2", "jerk": "m/s3", "snap": "m/s4"}

REFERENCE = tuple(name for derivative in _REFERENCE_UNITS for name in components(f"reference.{derivative}"))
"""Inputs of the controller that a reference from a file feeds."""

POSITION_REFERENCE = components("reference.position")
"""P_d as it is recorded beside the signals."""

ENERGY = "energy"
EXTERNAL_FORCE = components("external_force")
DISTURBANCE = components("wind.amplitude") + EXTERNAL_FORCE
"""Parameters that move the plant beside its commands."""
PAYLOAD = "payload.mass"
"""Mass of the plant beyond its own that its controller does not know."""

BOUNDARY_LAYER = "boundary_layer"
SURFACE = tuple(f"controller.{name}" for name in ("gain.surface", "surface_exponent", BOUNDARY_LAYER))
"""Parameters k_s, β_t and ε of the controller: its gain is constant for position errors below ε, a power beyond."""
UNREDESIGNED: Mapping[str, tuple[object, ...]] = {"discretisation": ("explicit", 1), "prediction": (0.0,)}
"""Parameters of the controller, and their values without a redesign: the law is evaluated at the sample and held."""

RIGID_BODY = ("mass", *components("inertia", ("xx", "yy", "zz", "xy", "xz", "yz")))
"""Parameters of the plant and, by the same names, of the controller's nominal model."""

UNITS = {
    **dict.fromkeys(POSITION, "m"),
    **dict.fromkeys(VELOCITY, "m/s"),
    **dict.fromkeys(QUATERNION, "1"),
    **dict.fromkeys(ANGULAR_VELOCITY, "rad/s"),
    **dict.fromkeys(EXTERNAL_FORCE, "N"),
    **dict(zip(COMMAND, ("N", "N.m", "N.m", "N.m"))),
    **{name: unit for derivative, unit in _REFERENCE_UNITS.items() for name in components(f"reference.{derivative}")},
    **dict(zip(TRAJECTORY, ("m", "m", "rad/s", "m", "m/s"))),
    **dict.fromkeys((SAMPLE_PERIOD, SAMPLE_OFFSET), "s"),
}
"""Units of the variables that are connected or set by the master."""
