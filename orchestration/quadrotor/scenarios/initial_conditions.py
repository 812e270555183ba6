"""Initial conditions of the quadrotor: errors of evenly spread size about the start of its reference."""

import dataclasses
import math
from typing import Any

import numpy as np

from fmu_kit.trajectory import Trajectory
from orchestration.components.fmi.kit import TRAJECTORY
from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios.wiring import REFERENCE
from orchestration.simulation.engines.resolved import source_values
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.model import System
from orchestration.systems.system.starts import InitialConditions, Starts


def initial_conditions(starts: Starts, flight: System) -> tuple[InitialConditions, ...]:
    """The initial conditions about the start of the reference of a flight, in the order of their indices.

    An initial condition of size r has r times the largest error of each kind. Sizes follow van der Corput's sequence:
    they are spread evenly, and a larger ensemble begins with the same members as a smaller one. Directions do too, as
    each index has its own random stream.
    """
    position, velocity = _start_of_reference(flight)
    return tuple(_start(starts, i, position, velocity) for i in range(starts.first, starts.first + starts.count))


def _start(starts: Starts, index: int, position: Floats, velocity: Floats) -> InitialConditions:
    size = 1.0 - _van_der_corput(index)
    generator = Streams(starts.seed).of(f"starts.{index}", "direction")
    place, motion, axis, spin = (_direction(generator) for _ in range(4))
    half = 0.5 * size * starts.angle
    vectors = {
        "plant.initial.position": position + size * starts.position * place,
        "plant.initial.velocity": velocity + size * starts.velocity * motion,
        "plant.initial.quaternion": np.array([*(math.sin(half) * axis), math.cos(half)]),
        "plant.initial.angular_velocity": size * starts.rate * spin,
    }
    values = {f"{name}.{letter}": float(x) for name, vector in vectors.items() for letter, x in zip("xyzw", vector)}
    return InitialConditions(size=size, values=values)


def _start_of_reference(flight: System) -> tuple[Floats, Floats]:
    """P_d(0) [m] and V_d(0) [m/s] of the reference of a flight: built in, a motion or a file."""
    source = flight.sources["reference"]
    if not source.is_built_in:
        to_controller = tuple(f"controller.{name}" for name in REFERENCE[:6])
        fed = dataclasses.replace(source, trajectory=None, to=to_controller)
        with_inputs = dataclasses.replace(flight, sources={"reference": fed})
        values = np.array(source_values(with_inputs, "reference", {}, Streams(flight.seed)).at(0.0))
        return values[:3], values[3:]
    values_set = flight.components["controller"].parameters
    fields: dict[str, Any] = {field: values_set[name] for name, field in TRAJECTORY.items() if name in values_set}
    reference = Trajectory(**fields).at(0.0)
    return np.array([*reference.position]), np.array([*reference.velocity])


def _direction(generator: np.random.Generator) -> Floats:
    """A unit vector, uniform over the sphere; bit-identical on all machines, unlike a norm computed by BLAS."""
    vector = generator.standard_normal(3)
    x, y, z = vector.tolist()
    return vector / math.sqrt(x * x + y * y + z * z)


def _van_der_corput(index: int) -> float:
    """Element `index` of the sequence, in [0, 1): its binary digits mirrored at the point."""
    element, weight = 0.0, 0.5
    while index:
        element += weight * (index & 1)
        index, weight = index >> 1, 0.5 * weight
    return element
