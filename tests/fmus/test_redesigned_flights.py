"""What the redesigns of the unified law fly, by their native FMUs: the paper's start and wind, plant steps of 5 ms."""

from pathlib import Path
from typing import Any

import pytest

import quadcosim
from orchestration.components.building import fmus
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.flight.hover import at_hover
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.quadrotor.scenarios.file import scenario_from_tables
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.theory.stability.period_map import growth_of_loop
from tests.extent import sample

MEAN = {"discretisation": "mean", "stages": 3}


def scenario(
    period: float, *, delay: float = 0.0, plant: dict[str, float] | None = None, **controller: Any
) -> Scenario:
    tables = {
        "controller": {"fmu": str(fmus.locate("native/UnifiedController")), **controller},
        "plant": {"fmu": str(fmus.locate("native/QuadrotorPlant")), **(plant or {})},
        "timing": {"period": period, "delay": delay, "plant_interval": 0.005},
    }
    return scenario_from_tables(tables, Path())


def flies(period: float, **given: Any) -> bool:
    metrics = quadcosim.run(scenario(period, **given)).metrics
    return not metrics["diverged"] and metrics["ultimate_bound"] < 0.05


@pytest.mark.parametrize("period", [0.1, 0.15, 0.2])
def test_the_mean_flies_where_the_explicit_law_does_not(period: float) -> None:
    assert flies(period, **MEAN)
    assert not flies(period)


def test_the_mean_does_not_fly_at_220_ms() -> None:
    assert not flies(0.22, **MEAN)


@pytest.mark.parametrize(
    ("kind", "there", "no_more"),
    [("semi_implicit", 0.072, 0.076), ("midpoint", 0.129, 0.135), ("match", 0.235, 0.255)],
)
def test_each_redesign_flies_up_to_its_first_limit(kind: str, there: float, no_more: float) -> None:
    assert flies(there, discretisation=kind)
    assert not flies(no_more, discretisation=kind)


def test_the_predictor_makes_up_for_a_delay_of_200_ms() -> None:
    assert flies(0.02, delay=0.2, prediction=0.2)
    assert not flies(0.02, delay=0.2)


def test_predictor_and_mean_fly_with_a_delay_of_a_period_of_100_ms() -> None:
    assert flies(0.1, delay=0.1, prediction=0.1, **MEAN)
    assert not flies(0.1, delay=0.1, prediction=0.1)


def test_with_twice_the_inertia_the_mean_loses_to_the_explicit_law() -> None:
    heavy = {f"inertia.{axis}": 2.0 for axis in ("xx", "yy", "zz")}
    assert flies(0.12, plant=heavy)
    assert not flies(0.12, plant=heavy, **MEAN)


@pytest.mark.parametrize(("kind", "limit"), sample([("explicit", 0.0801), ("midpoint", 0.1357), ("mean", 0.2054)], 1))
def test_about_hover_what_is_small_decays_up_to_the_limit(kind: str, limit: float) -> None:
    instances = Instances()
    below, above = (
        growth_of_loop(at_hover(scenario(period, discretisation=kind)), instances)
        for period in (round(0.99 * limit, 4), round(1.01 * limit, 4))
    )
    instances.close()
    assert below < 0.0 < above


@pytest.mark.parametrize(("name", "value"), [("discretisation", "mean"), ("prediction", 0.02)])
def test_the_loop_of_one_feedback_for_all_periods_is_not_for_redesigns(name: str, value: Any) -> None:
    with pytest.raises(UsageError, match=f"controllers with {name} = "):
        HoverLoop.of(scenario(0.02, **{name: value}))
