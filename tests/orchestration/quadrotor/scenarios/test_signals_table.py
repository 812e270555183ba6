"""The quadrotor's signals are those that it had before there were systems, to the bit; native FMUs have them too."""

import functools
import json
from collections.abc import Mapping
from pathlib import Path

import pytest

import quadcosim
from fmu_kit.bundle import Target
from orchestration.components.building.models import MODELS
from quadcosim import Result
from tests.extent import in_test_all, sample
from tests.fmus.making import PAIR
from tests.native import assert_near, assert_the_same, natives
from tests.orchestration.quadrotor.scenarios.signals_table import (
    TABLE,
    entry,
    fingerprint,
    flights,
    scenario_of,
    simulated,
)

SAME_MATHEMATICS = json.loads(TABLE.read_text(encoding="utf-8"))["fingerprint"] == fingerprint()
FLIGHTS = dict(flights())
LAWS = sample(["UnifiedController", "GeometricController"], 1)
REDESIGNS = {
    "mean, with prediction": {"discretisation": "mean", "prediction": 0.05, "hold_period": 0.04},
    "match": {"discretisation": "match", "stages": 2, "weight": 2.0},
}
SEMI_IMPLICIT = {"discretisation": "semi_implicit"}


@functools.cache
def in_python(name: str) -> Result:
    """The flight of a scenario of the table, by the slaves in Python."""
    return simulated(FLIGHTS[name]["scenario"])


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_is_that_of_the_table(name: str) -> None:
    expected = FLIGHTS[name]
    found = entry(in_python(name), expected["last"])
    assert found["columns"] == expected["columns"]
    if SAME_MATHEMATICS:
        assert found == {key: value for key, value in expected.items() if key != "scenario"}
    else:  # another libm, another last digit
        assert found["number_of_rows"] == expected["number_of_rows"]
        assert found["last"] == pytest.approx(expected["last"], rel=1e-9, abs=1e-9)


# -- the same slaves, written out as C -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def on_libm() -> dict[str, Path]:
    """The FMUs of the plant and of the laws by name, with the elementary functions that CPython takes."""
    targets = [Target.parse(MODELS[name]) for name in ("QuadrotorPlant", *LAWS)]
    return natives(targets, "libm")


def flown_by(fmus: Mapping[str, str | Path], name: str) -> Result:
    """The flight of a scenario of the table, by these FMUs."""
    scenario = scenario_of(FLIGHTS[name]["scenario"])
    return quadcosim.run(scenario.with_fmus(plant=fmus["QuadrotorPlant"], controller=fmus["UnifiedController"]))


@in_test_all
@pytest.mark.parametrize("name", FLIGHTS)
def test_a_native_flight_on_the_same_libm_is_that_of_the_slaves_in_python(name: str, on_libm: dict[str, Path]) -> None:
    assert_the_same(flown_by(on_libm, name), in_python(name))


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_native_flight_on_its_own_mathematics_is_near(name: str) -> None:
    assert_near(flown_by({model: f"native/{model}" for model in PAIR}, name), in_python(name), 1e-9)


def test_motors_written_out_as_c_are_those_in_python(on_libm: dict[str, Path]) -> None:
    motors = {"thrust_max": 20.0, "thrust_min": -20.0, "arm": {"x": 1.2, "y": 1.0}, "drag_to_thrust": 1.0}
    motors |= {"time_constant": {"up": 0.0125, "down": 0.025}}
    scenario = scenario_of({"stop_time": 1.0, "plant": {"motor": motors}})
    results = [
        quadcosim.run(scenario.with_fmus(plant=fmus["QuadrotorPlant"], controller=fmus["UnifiedController"]))
        for fmus in (on_libm, {model: model for model in PAIR})
    ]
    assert_the_same(*results)
    assert 0.01 < results[0].metrics["saturation_share"] < 0.9


@pytest.mark.parametrize("law", LAWS)
def test_a_flight_that_turns_in_other_axes_is_in_c_what_it_is_in_python(law: str, on_libm: dict[str, Path]) -> None:
    turning = {"frame": "enu", "discretisation": "mean", "trajectory": {"yaw": 0.3, "yaw_rate": 0.5}}
    tables = {"plant": {"frame": "enu"}, "controller": turning}
    scenario = scenario_of({"stop_time": 2.0, "timing": {"period": 0.04}, **tables})
    results = [
        quadcosim.run(scenario.with_fmus(plant=fmus["QuadrotorPlant"], controller=fmus[law]))
        for fmus in (on_libm, {"QuadrotorPlant": "QuadrotorPlant", law: law})
    ]
    assert_the_same(*results)
    assert results[0].divergence is None


@pytest.mark.parametrize(
    ("law", "redesign"),
    [*((law, redesign) for law in LAWS for redesign in REDESIGNS.values()), ("UnifiedController", SEMI_IMPLICIT)],
)
def test_redesigns_written_out_as_c_are_those_in_python(
    law: str, redesign: dict[str, str | float], on_libm: dict[str, Path]
) -> None:
    """With samples and commands that come late, and measurements that are lost."""
    timing = {"period": 0.04, "delay": 0.05, "jitter": 0.01, "measurement_loss": 0.05, "plant_interval": 0.005}
    scenario = scenario_of({"stop_time": 0.6, "timing": timing, "controller": redesign})
    results = [
        quadcosim.run(scenario.with_fmus(plant="native/QuadrotorPlant", controller=fmu)) for fmu in (on_libm[law], law)
    ]
    assert_the_same(*results)
    assert results[0].divergence is None
