"""What is observed of the plant: each variable against a formula of its own, in a flight in wind."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from plant_fmu.interface import PlantInterface
from plant_fmu.observed import Observed
from tests.plant_fmu.test_slave import BODY, MOVING, POSITION, QUATERNION, SPIN, VELOCITY, run_steps, started
from tests.reference.law import rotation
from tests.slaves import get

COMMAND = {"thrust": 12.0, "torque.x": 1.0, "torque.y": -2.0, "torque.z": 3.0}
WIND = {"wind.amplitude.x": 0.5, "wind.amplitude.y": -0.2, "wind.amplitude.z": 0.1, "wind.frequency": 2.0}


@dataclass(frozen=True, kw_only=True)
class Seen:
    """The vehicle of BODY under COMMAND and WIND, without lag, and an external force of 0.4 N along y."""

    t: float
    position: Any
    velocity: Any
    R: Any
    """from inertial to body components"""
    spin: Any

    @property
    def wind(self) -> Any:
        return np.array([0.5, -0.2, 0.1]) * math.cos(2.0 * self.t)


KNOWN: dict[str, tuple[str, Callable[[Seen], Any]]] = {
    "acceleration": ("m/s2", lambda at: (at.wind + np.array([0, 0.4, 0]) - 12.0 * at.R[2]) / 1.3 + [0.0, 0.0, 9.7]),
    "wind.force": ("N", lambda at: at.wind),
    "tilt": ("rad", lambda at: math.acos(at.R[2, 2])),
}
"""Unit and value of each, written independently of `plant_fmu`; a vector by its stem"""

AXES = "xyz"
OF_PLANT = {v.name for v in PlantInterface.variables}
NAMES = [v.name for v in Observed.variables if v.name not in OF_PLANT]


def known(name: str) -> tuple[str, Callable[[Seen], Any]]:
    """Unit and value of a variable, or of a part of one."""
    stem, _, axis = name.rpartition(".")
    is_part = stem != "" and axis in AXES
    whole = stem if is_part else name
    assert whole in KNOWN, (
        f"plant_fmu/observed.py declares {whole}: expected its unit, and its value by an independent formula, as a "
        f'line "{whole}": ("UNIT", lambda at: …) of KNOWN in tests/plant_fmu/test_observed.py'
    )
    unit, value = KNOWN[whole]
    return unit, (lambda at: value(at)[AXES.index(axis)]) if is_part else value


@pytest.mark.parametrize("name", NAMES)
def test_what_is_observed_has_its_unit(name: str) -> None:
    (declared,) = (v.unit for v in Observed.variables if v.name == name)
    unit, _ = known(name)
    assert declared == unit, (
        f"{name} is declared in {declared}: expected the unit that KNOWN in tests/plant_fmu/test_observed.py has, "
        f"{unit}, as the second argument of its declaration in plant_fmu/observed.py"
    )


@pytest.mark.parametrize("steps", [0, 20])
@pytest.mark.parametrize("name", NAMES)
def test_what_is_observed_has_its_known_value(name: str, steps: int) -> None:
    slave = started({**BODY, **MOVING, **WIND, **COMMAND, "external_force.y": 0.4})
    run_steps(slave, 0.05, steps)
    position, velocity, attitude, spin = (np.array(get(slave, *of)) for of in (POSITION, VELOCITY, QUATERNION, SPIN))
    at = Seen(t=0.05 * steps, position=position, velocity=velocity, R=rotation(attitude), spin=spin)
    _, value = known(name)
    assert get(slave, name) == [pytest.approx(float(value(at)), rel=1e-12, abs=1e-12)], (
        f"{name}: expected `observe` in plant_fmu/observed.py to set it as KNOWN has it"
    )
