"""An ensemble of initial conditions of the quadrotor: errors of evenly spread size about the start of its reference."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmu_kit.trajectory import Trajectory
from orchestration.components.fmi.kit import TRAJECTORY
from orchestration.foundation.basics.errors import UsageError, no_such_key
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios.wiring import REFERENCE
from orchestration.simulation.engines.wiring import source_values
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.request import InitialConditions


@record("starts.")
class Starts:
    """Initial errors in position, velocity, attitude and angular velocity, each in its own random direction.

    An initial condition of size r has r times the largest error of each kind. Sizes follow van der Corput's sequence:
    they are spread evenly, and a larger ensemble begins with the same members as a smaller one. Directions do too, as
    each index has its own random stream. Raises `UsageError` for invalid values.
    """

    count: int = 200
    """The number of initial conditions."""
    first: int = 0
    """The index of the first initial condition. The same index gives the same one in every ensemble."""
    seed: int = 0
    """The seed of the random directions."""
    position: float = 4.0
    """The largest distance from the start of the reference, ‖P(0) - P_d(0)‖ [m]."""
    velocity: float = 2.0
    """The largest difference from the velocity of the reference, ‖V(0) - V_d(0)‖ [m/s]."""
    angle: float = 2.0
    """The largest angle from level and no yaw, about any axis [rad]."""
    rate: float = 2.0
    """The largest angular velocity, ‖Ω(0)‖ [rad/s]."""

    def __post_init__(self) -> None:
        for name, lowest in (("count", 1), ("first", 0), ("seed", 0)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < lowest:
                raise UsageError(f"starts.{name} = {value}: expected a whole number from {lowest}")
        for name, highest in (("position", math.inf), ("velocity", math.inf), ("angle", math.pi), ("rate", math.inf)):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0.0 <= value <= highest):
                raise UsageError(f"starts.{name} = {value}: expected a number from 0{_to(highest)}")

    def subset(self, first: int, count: int) -> "Starts":
        """The same ensemble with `count` members from index `first` on."""
        return dataclasses.replace(self, first=first, count=count)

    def initial_conditions(self, request: Any) -> tuple[InitialConditions, ...]:
        """The initial conditions about the start of the reference of a `Scenario`, in the order of their indices."""
        position, velocity = _start_of_reference(request)
        return tuple(self._start(i, position, velocity) for i in range(self.first, self.first + self.count))

    def _start(self, index: int, position: Floats, velocity: Floats) -> InitialConditions:
        size = 1.0 - _van_der_corput(index)
        generator = Streams(self.seed).of(f"starts.{index}", "direction")
        place, motion, axis, spin = (_direction(generator) for _ in range(4))
        half = 0.5 * size * self.angle
        vectors = {
            "plant.initial.position": position + size * self.position * place,
            "plant.initial.velocity": velocity + size * self.velocity * motion,
            "plant.initial.quaternion": np.array([*(math.sin(half) * axis), math.cos(half)]),
            "plant.initial.angular_velocity": size * self.rate * spin,
        }
        values = {f"{name}.{letter}": float(x) for name, vector in vectors.items() for letter, x in zip("xyzw", vector)}
        return InitialConditions(size=size, values=values)


def starts_in(table: Mapping[str, Any], beside: Sequence[str]) -> Starts:
    """The ensemble that a table of a file describes; keys `beside` are accepted too. Raises `UsageError`."""
    names = [field.name for field in dataclasses.fields(Starts)]
    for key in table:
        if key not in names:
            raise UsageError(no_such_key("starts.", key, [*names, *beside]))
    return Starts(**table)


def _start_of_reference(request: Any) -> tuple[Floats, Floats]:
    """P_d(0) [m] and V_d(0) [m/s] of the reference of a `Scenario`: built in, a motion or a file."""
    scenario = request.resolved()
    system = scenario.as_system()
    source = system.sources["reference"]
    if not source.is_built_in:
        to_controller = tuple(f"controller.{name}" for name in REFERENCE[:6])
        fed = dataclasses.replace(source, trajectory=None, to=to_controller)
        with_inputs = dataclasses.replace(system, sources={"reference": fed})
        values = np.array(source_values(with_inputs, "reference", {}, Streams(scenario.seed)).at(0.0))
        return values[:3], values[3:]
    values_set = scenario.controller.parameters
    fields = {field: values_set[name] for name, field in TRAJECTORY.items() if name in values_set}
    reference = Trajectory(**fields).at(0.0)
    return np.array([*reference.position]), np.array([*reference.velocity])


def _to(highest: float) -> str:
    return "" if math.isinf(highest) else f" to {highest:.6g}"


def _direction(generator: np.random.Generator) -> Floats:
    """A unit vector, uniform over the sphere; bit-identical on all machines, unlike a norm computed by BLAS."""
    vector = generator.standard_normal(3)
    x, y, z = vector.tolist()
    unit: Floats = vector / math.sqrt(x * x + y * y + z * z)
    return unit


def _van_der_corput(index: int) -> float:
    """Element `index` of the sequence, in [0, 1): its binary digits mirrored at the point."""
    element, weight = 0.0, 0.5
    while index:
        element += weight * (index & 1)
        index, weight = index >> 1, 0.5 * weight
    return element
