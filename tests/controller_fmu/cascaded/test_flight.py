"""The cascade in flight: at PX4's rates, at one slow rate, and the same in C as in Python."""

from pathlib import Path

import pytest

import orchestration
from fmu_kit.bundle import Target
from orchestration import Result, Scenario, Timing
from orchestration.quadrotor.wiring import MODELS
from tests.native import assert_the_same, natives

NAME, PLANT = "CascadedController", "QuadrotorPlant"


def flown(controller: Path | str, parameters: dict[str, float], timing: Timing, stop_time: float = 30.0) -> Result:
    scenario = Scenario(stop_time=stop_time, timing=timing).with_changes(parameters=parameters)
    return orchestration.run(scenario.with_fmus(plant=f"native/{PLANT}", controller=controller))


def test_the_papers_flight_settles_at_the_rates_of_px4() -> None:
    metrics = flown(f"native/{NAME}", {}, Timing(period=0.001)).metrics
    assert metrics["settling_time"] == pytest.approx(5.609, abs=0.01)
    assert metrics["ultimate_bound"] == pytest.approx(0.0177, abs=1e-4)


def test_with_all_loops_at_one_period_it_flies_at_85_ms_and_not_at_95() -> None:
    one_rate = {"controller.velocity_ratio": 1, "controller.attitude_ratio": 1}
    found = [flown(f"native/{NAME}", one_rate, Timing(period=period)).metrics["good"] for period in (0.085, 0.095)]
    assert found == [True, False]


def test_in_c_it_flies_as_in_python_to_the_byte(built: dict[str, Path], tmp_path: Path) -> None:
    fmu = natives([Target.parse(MODELS[NAME])], tmp_path, "libm")[NAME]
    timing = Timing(period=0.004, jitter=0.001, measurement_loss=0.05)
    changed = {"controller.velocity_ratio": 5, "controller.attitude_ratio": 2, "controller.motor.arm.x": 0.5}
    assert_the_same(flown(fmu, changed, timing, 3.0), flown(built[NAME], changed, timing, 3.0))
