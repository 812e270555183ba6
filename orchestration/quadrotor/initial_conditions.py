"""An ensemble of initial states of the quadrotor: errors of evenly spread size around the start of its reference."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fmu_kit.trajectory import Trajectory
from orchestration.basics.errors import UsageError, no_such_key
from orchestration.basics.records import record
from orchestration.basics.simulator import Floats
from orchestration.engines.wiring import source_values
from orchestration.fmi.kit import TRAJECTORY
from orchestration.quadrotor.wiring import REFERENCE
from orchestration.schedule.streams import Streams
from orchestration.system.request import Start


@record("starts.")
class Starts:
    """Initial errors in position, velocity, attitude and angular velocity, each in a direction of its own.

    A start of size r has r times the largest error of each kind. Sizes are those of van der Corput's sequence, so that
    they are spread evenly and more starts leave the first ones as they are; so do directions, each start having a
    stream of random numbers of its own. Raises `UsageError` for values that cannot be.
    """

    count: int = 200
    """How many starts there are."""
    first: int = 0
    """The index of the first start. A start is the same in every ensemble that has its index."""
    seed: int = 0
    """The seed of their directions."""
    position: float = 4.0
    """The largest distance from the beginning of the reference, ‖P(0) - P_d(0)‖ [m]."""
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

    def some(self, first: int, count: int) -> "Starts":
        """Others of the same kind: so many, from this index on."""
        return dataclasses.replace(self, first=first, count=count)

    def starts_of(self, request: Any) -> tuple[Start, ...]:
        """The starts around the beginning of what a `Scenario` follows, in the order of their indices."""
        position, velocity = _beginning(request)
        return tuple(self._start(i, position, velocity) for i in range(self.first, self.first + self.count))

    def _start(self, index: int, position: Floats, velocity: Floats) -> Start:
        size = 1.0 - _van_der_corput(index)
        generator = Streams(self.seed).of(f"starts.{index}", "direction")
        place, motion, axis, spin = (_direction(generator) for _ in range(4))
        half = 0.5 * size * self.angle
        found = {
            "plant.initial.position": position + size * self.position * place,
            "plant.initial.velocity": velocity + size * self.velocity * motion,
            "plant.initial.quaternion": np.array([*(math.sin(half) * axis), math.cos(half)]),
            "plant.initial.angular_velocity": size * self.rate * spin,
        }
        values = {f"{name}.{letter}": float(x) for name, vector in found.items() for letter, x in zip("xyzw", vector)}
        return Start(size=size, values=values)


def starts_in(table: Mapping[str, Any], beside: Sequence[str] = ()) -> Starts:
    """The ensemble that a table of a file says; keys `beside` are known too. Raises `UsageError`."""
    names = [field.name for field in dataclasses.fields(Starts)]
    for key in table:
        if key not in names:
            raise UsageError(no_such_key("starts.", key, [*names, *beside]))
    return Starts(**table)


def _beginning(request: Any) -> tuple[Floats, Floats]:
    """P_d(0) [m] and V_d(0) [m/s] of the reference of a `Scenario`, be it built in, a motion or a file."""
    scenario = request.resolved()
    system = scenario.as_system()
    source = system.sources["reference"]
    if not source.is_built_in:
        fed = dataclasses.replace(source, trajectory=None, to=tuple(f"controller.{name}" for name in REFERENCE[:6]))
        told = dataclasses.replace(system, sources={"reference": fed})
        values = np.array(source_values(told, "reference", {}, Streams(scenario.seed)).at(0.0))
        return values[:3], values[3:]
    given = scenario.controller.parameters
    reference = Trajectory(**{field: given[name] for name, field in TRAJECTORY.items() if name in given}).at(0.0)
    return np.array([*reference.position]), np.array([*reference.velocity])


def _to(highest: float) -> str:
    return "" if math.isinf(highest) else f" to {highest:.6g}"


def _direction(generator: np.random.Generator) -> Floats:
    """A unit vector, all directions alike; the same to the bit on all machines, as a BLAS is not."""
    vector = generator.standard_normal(3)
    x, y, z = vector.tolist()
    unit: Floats = vector / math.sqrt(x * x + y * y + z * z)
    return unit


def _van_der_corput(index: int) -> float:
    """The place of an index in [0, 1), its binary digits mirrored at the point."""
    found, share = 0.0, 0.5
    while index:
        found += share * (index & 1)
        index, share = index >> 1, 0.5 * share
    return found
