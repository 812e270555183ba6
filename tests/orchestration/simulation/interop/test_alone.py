"""Why the plant that `simulate_fmu` flies alone is 1e-10 off: its steps, which are not h to the last bit."""

from collections.abc import Callable

import numpy as np
import pytest

from orchestration.components.building import fmus
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.quadrotor.scenarios.wiring import COMMAND, MEASUREMENT
from orchestration.simulation.interop.compare import TOLERANCE
from quadcosim import run
from tests.native import NATIVE

H, STEPS = 0.01, 3000
Point = Callable[[int], tuple[float, float]]


@pytest.fixture(scope="module")
def flight() -> tuple[Floats, Floats]:
    """States and commands of the paper's flight in this project's master, a row for each step's start."""
    signals = run(NATIVE.with_changes(timing={"plant_interval": H, "clock": "fmu"})).signals
    plant, command = (
        np.column_stack([signals[f"{side}.{name}"] for name in names])
        for side, names in (("plant", MEASUREMENT), ("controller", COMMAND))
    )
    return plant, command


def replayed(flight: tuple[Floats, Floats], point: Point) -> float:
    """How far the plant alone, with the flight's commands at the steps of `point`, is from the flight."""
    states, commands = flight
    command, found, farthest = np.zeros(len(COMMAND)), np.zeros(len(MEASUREMENT)), 0.0
    with Fmi2Instance(fmus.locate(NATIVE.plant.fmu), "plant") as plant:
        write, read = plant.writer(COMMAND, command), plant.reader(MEASUREMENT, found)
        plant.enter_initialization(0.0, H * STEPS)
        command[:] = commands[0]
        write()
        plant.exit_initialization()
        for k in range(STEPS):
            command[:] = commands[k]
            write()
            plant.step(*point(k))
            read()
            farthest = max(farthest, float(np.abs(found - states[k + 1]).max()))
    return farthest


def test_stepped_by_exactly_h_the_plant_alone_repeats_the_flight_to_the_last_bit(flight: tuple[Floats, Floats]) -> None:
    nanoseconds = round(H * NANOSECONDS)
    assert replayed(flight, lambda k: (k * nanoseconds / NANOSECONDS, H)) == 0.0


def test_stepped_by_differences_of_times_it_drifts_away_by_less_than_the_aim(flight: tuple[Floats, Floats]) -> None:
    assert 1e-12 < replayed(flight, lambda k: (k * H, (k + 1) * H - k * H)) < TOLERANCE
