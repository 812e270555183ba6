"""Names for people: there for every metric, with the units that the FMUs give."""

import pytest

import quadcosim
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.units import ColumnInfo
from quadcosim import Scenario
from tests.places import ROOT

METRICS_PAGE = ROOT / "docs" / "metrics.md"


def test_every_metric_of_a_flight_has_a_name_and_its_unit_and_is_on_the_page() -> None:
    result = quadcosim.run(Scenario(stop_time=0.05))
    assert set(result.metrics) <= set(labels.METRICS)
    units = {name: labels.METRICS[name][1] for name in result.units}
    assert {name: unit for name, unit in units.items() if unit != result.units[name]} == {}
    page = METRICS_PAGE.read_text(encoding="utf-8")
    assert [name for name in result.metrics if f"`{name}`" not in page] == []


@pytest.mark.parametrize(
    ("unit", "expected"),
    [("N.m", "N·m"), ("m/s2", "m/s²"), ("N2.m2.s", "N²·m²·s"), ("kg.m2", "kg·m²"), ("1", None), (None, None),
     ("m.s-1", "m·s⁻¹")],
)  # fmt: skip
def test_units_are_written_as_people_write_them(unit: str | None, expected: str | None) -> None:
    assert labels.unit(unit) == expected


def test_a_signal_goes_by_its_own_name_or_by_what_its_fmu_says_of_it() -> None:
    about = {
        "tank.level": ColumnInfo(unit="m", text="level of the water"),
        "ball.h": ColumnInfo(unit="m", text="Height of the ball."),
        "car.x1": ColumnInfo(text="a description that is too long for any legend of a figure"),
    }
    assert labels.signal("plant.position.x", about) == "position x"
    assert labels.signal("tank.level", about) == "tank: level of the water"
    assert labels.signal("ball.h", about) == "ball: h, Height of the ball"
    assert labels.signal("car.x1", about) == "car: x1"


def test_an_objective_of_any_system_has_no_bound_of_the_quadrotor_in_its_name() -> None:
    assert not [name for name, (text, _) in labels.METRICS.items() if " cm" in text]
