"""Flights of the geometric controller's FMU: the same written out as C, and with redesigns of its law."""

import quadcosim
from tests.extent import in_test_all
from tests.native import assert_near


@in_test_all
def test_the_flight_of_its_c_is_that_of_its_python() -> None:
    """To rounding, as their elementary functions are not the same."""
    values: dict[str, float | str] = {"controller.heading": 0.4, "controller.inertia.zz": 1.5}
    values["controller.gain_scaling"] = "inertia"
    timing = quadcosim.Timing(period=0.02, plant_interval=0.01)
    scenario = quadcosim.Scenario(stop_time=2.0, timing=timing).with_changes(parameters=values)
    one, other = (
        quadcosim.run(scenario.with_fmus(plant="native/QuadrotorPlant", controller=f"{folder}GeometricController"))
        for folder in ("", "native/")
    )
    assert_near(one, other, 1e-9)


def outcome(period: float, delay: float = 0.0, **redesign: float | str) -> str:
    """Of 12 s from the paper's start, each command held for `period` [s] and late by `delay` [s]."""
    timing = quadcosim.Timing(period=period, plant_interval=0.005, delay=delay)
    parameters = {f"controller.{name}": value for name, value in {"hold_period": period, **redesign}.items()}
    scenario = quadcosim.Scenario(stop_time=12.0, timing=timing).with_changes(parameters=parameters)
    result = quadcosim.run(scenario.with_fmus(plant="native/QuadrotorPlant", controller="native/GeometricController"))
    return str(result.metrics["outcome"])


def test_redesigned_it_flies_where_the_law_at_the_sample_does_not() -> None:
    assert outcome(0.06) == "settled"
    assert outcome(0.08) == "diverged"
    assert outcome(0.08, discretisation="midpoint") == "settled"
    assert outcome(0.15, discretisation="mean") == "settled"
    assert outcome(0.15, discretisation="match") == "settled"
    assert outcome(0.02, delay=0.06) == "diverged"
    assert outcome(0.02, delay=0.06, prediction=0.06) == "settled"
