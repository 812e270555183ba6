"""What is observed of the plant: each variable against a formula of its own, in a flight in wind."""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from fmu_kit.frames import Frame
from plant_fmu.interface import PlantInterface
from plant_fmu.observed import Observed
from plant_fmu.slave import QuadrotorPlant
from tests.controller_fmu.wired import created
from tests.plant_fmu.test_slave import BODY, MOVING, QUATERNION, instance, run_steps
from tests.reference.law import rotation
from tests.slaves import get, put

INERTIA = (("xx", "xy", "xz"), ("xy", "yy", "yz"), ("xz", "yz", "zz"))
COMMAND = {"thrust": 12.0, "torque.x": 1.0, "torque.y": -2.0, "torque.z": 3.0}
WIND = {"wind.amplitude.x": 0.5, "wind.amplitude.y": -0.2, "wind.amplitude.z": 0.1, "wind.frequency": 2.0}
PAYLOAD = {"payload.mass": 0.2, "payload.drop_time": 0.5}


@dataclass(frozen=True, kw_only=True)
class Seen:
    """The vehicle of BODY under COMMAND and WIND, without lag, and an external force of 0.4 N along its y axis in NED;
    a payload of 0.2 kg is dropped at 0.5 s.

    All in the axes of the flight, NED or ENU, so that a formula of these holds in both.
    """

    t: float
    position: Any
    velocity: Any
    R: Any
    """from inertial to body components"""
    spin: Any
    torque: Any
    """in body axes"""
    J: Any
    """in body axes"""
    down: Any
    """the unit vector, of the inertial axes where the vehicle is level"""
    amplitude: Any
    force: Any
    mass: float
    """all that is carried"""

    @property
    def wind(self) -> Any:
        return self.amplitude * math.cos(2.0 * self.t)


KNOWN: dict[str, tuple[str, Callable[[Seen], Any]]] = {
    "acceleration": ("m/s2", lambda at: (at.wind + at.force - 12.0 * at.down @ at.R) / at.mass + 9.7 * at.down),
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


@functools.cache
def flown(frame: Frame, steps: int) -> tuple[QuadrotorPlant, Seen]:
    """One flight, whatever the axes in which it is set and seen."""
    given = instance({**BODY, **MOVING, **WIND, **COMMAND, "external_force.y": 0.4, **PAYLOAD})
    of_master = (each.attribute for each in PlantInterface._declared if not each.set_by_slave and each.frame)
    slave = created(QuadrotorPlant, frame, {name: getattr(given, name) for name in of_master})
    put(slave, {name: get(given, name)[0] for name in ("mass", "gravity", "wind.frequency", "thrust", *PAYLOAD)})
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    run_steps(slave, 0.05, steps)

    def vector(name: str) -> Any:
        return np.array(get(slave, *(f"{name}.{axis}" for axis in AXES)))

    seen = Seen(
        t=0.05 * steps,
        position=vector("position"),
        velocity=vector("velocity"),
        R=rotation(np.array(get(slave, *QUATERNION))),
        spin=vector("angular_velocity"),
        torque=vector("torque"),
        J=np.array([get(slave, *(f"inertia.{axes}" for axes in row)) for row in INERTIA]),
        down=np.array([0.0, 0.0, 1.0 if frame == Frame.NED else -1.0]),
        amplitude=vector("wind.amplitude"),
        force=vector("external_force"),
        mass=1.5 if 0.05 * steps < 0.5 else 1.3,
    )
    return slave, seen


EXPECTED = {
    Frame.NED: "`observe` to set it as KNOWN has it",
    Frame.ENU: "`frame=` of its declaration to say in which axes it is: frames.inertial, frames.body or another of "
    "fmu_kit/frames.py, none if it is the same in all; and in KNOWN a formula of vectors of `at`, no numbers in NED",
}


@pytest.mark.parametrize("steps", [0, 20])
@pytest.mark.parametrize("frame", Frame)
@pytest.mark.parametrize("name", NAMES)
def test_what_is_observed_has_its_known_value_in_all_axes(name: str, frame: Frame, steps: int) -> None:
    slave, at = flown(frame, steps)
    _, value = known(name)
    assert get(slave, name) == [pytest.approx(float(value(at)), rel=1e-12, abs=1e-12)], (
        f"plant_fmu/observed.py: {name} in axes {frame.name}: expected {EXPECTED[frame]}"
    )
