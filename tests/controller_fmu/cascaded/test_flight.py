"""The cascade in flight: at PX4's rates, at one slow rate, and the same in C as in Python."""

from pathlib import Path

import pytest

import quadcosim
from fmu_kit.bundle import Target
from orchestration.components.building.models import MODELS
from orchestration.components.fmi.reuse import Instances
from orchestration.quadrotor.flight.hover import at_hover
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.systems.system.model import System
from orchestration.theory.stability.identification import SampledRest
from orchestration.theory.stability.lifted_component import LiftedTangent
from orchestration.theory.stability.linearised_component import Tangent
from orchestration.theory.stability.period_map import growth_of_loop
from quadcosim import Result, Scenario, Timing, UsageError
from tests.extent import in_test_all
from tests.native import assert_the_same, natives

NAME, PLANT = "CascadedController", "QuadrotorPlant"
ONE_RATE: dict[str, float] = {"controller.velocity_ratio": 1, "controller.attitude_ratio": 1}


def simulated(controller: Path | str, parameters: dict[str, float], timing: Timing, stop_time: float = 30.0) -> Result:
    scenario = Scenario(stop_time=stop_time, timing=timing).with_changes(parameters=parameters)
    return quadcosim.run(scenario.with_fmus(plant=f"native/{PLANT}", controller=controller))


def test_the_papers_flight_settles_at_the_rates_of_px4() -> None:
    metrics = simulated(f"native/{NAME}", {}, Timing(period=0.001)).metrics
    assert metrics["settling_time"] == pytest.approx(5.609, abs=0.01)
    assert metrics["ultimate_bound"] == pytest.approx(0.0177, abs=1e-4)


def test_with_all_loops_at_one_period_it_flies_at_85_ms_and_not_at_95() -> None:
    found = [simulated(f"native/{NAME}", ONE_RATE, Timing(period=period)).metrics["good"] for period in (0.085, 0.095)]
    assert found == [True, False]


def hovering(period: float, parameters: dict[str, float]) -> System:
    scenario = Scenario(timing=Timing(period=period)).with_changes(parameters=parameters)
    return at_hover(scenario.with_fmus(plant=f"native/{PLANT}", controller=f"native/{NAME}"))


def test_about_hover_it_is_stable_to_89_ms_where_all_loops_run_at_one_period() -> None:
    instances = Instances()
    growths = [growth_of_loop(hovering(period, ONE_RATE), instances) for period in (0.088, 0.09)]
    assert growths[0] < 0.0 < growths[1]
    instances.close()


@in_test_all
def test_about_hover_it_is_stable_where_outer_loops_run_at_100_and_250_hz(monkeypatch: pytest.MonkeyPatch) -> None:
    instances, measured, measure = Instances(), list[int](), SampledRest.tangent

    def counted(self: SampledRest) -> Tangent | LiftedTangent:
        measured.append(self.samples)
        return measure(self)

    monkeypatch.setattr(SampledRest, "tangent", counted)
    assert growth_of_loop(hovering(0.001, {}), instances) < 0.0
    assert measured == [20]
    instances.close()


def test_a_controller_that_remembers_has_no_loop_about_hover_of_the_vehicle_alone() -> None:
    scenario = Scenario().with_changes(parameters=ONE_RATE)
    with pytest.raises(UsageError, match="the controller's command depends on what it measured before"):
        HoverLoop.of(scenario.with_fmus(plant=f"native/{PLANT}", controller=f"native/{NAME}"))


@in_test_all
def test_in_c_it_flies_as_in_python_to_the_byte(built: dict[str, Path]) -> None:
    fmu = natives([Target.parse(MODELS[NAME])], "libm")[NAME]
    timing = Timing(period=0.004, jitter=0.001, measurement_loss=0.05)
    changed = {"controller.velocity_ratio": 5, "controller.attitude_ratio": 2, "controller.motor.arm.x": 0.5}
    assert_the_same(simulated(fmu, changed, timing, 1.0), simulated(built[NAME], changed, timing, 1.0))
