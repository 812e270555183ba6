"""The page on metrics has those that a flight has, each with its unit."""

import re

import pytest

from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.simulation.results import display_names
from quadcosim import Result, run
from tests.orchestration.quadrotor.scenarios.named_signals import beyond_exchanged
from tests.places import ROOT

PAGE = (ROOT / "docs" / "metrics.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in re.findall(r"^\| `.*\|$", PAGE, re.M)]
UNITS = str.maketrans({"·": ".", "²": "2"})


@pytest.fixture(scope="module")
def flight() -> Result:
    return run(Scenario(stop_time=0.05))


def test_the_page_has_every_metric_of_a_flight_and_no_other(flight: Result) -> None:
    on_page = {row[0].strip("`") for row in ROWS}
    assert on_page == {*flight.metrics}, (
        f"{on_page ^ {*flight.metrics}}: expected the same metrics in docs/metrics.md as under [objectives] of "
        f"orchestration/quadrotor/scenarios/system.toml"
    )


def test_the_page_has_the_units_that_follow_from_those_of_the_fmus(flight: Result) -> None:
    stated = {row[0].strip("`"): row[-2].translate(UNITS) for row in ROWS}
    for name, unit in flight.units.items():
        assert stated[name] == unit, f"{name}: expected {unit} in its row of docs/metrics.md"


def test_figures_and_tables_name_every_metric_of_a_flight_in_words(flight: Result) -> None:
    for name, unit in flight.units.items():
        assert display_names.METRICS.get(name, ("", None))[1] == unit, (
            f'{name}: expected a line {name} = ["WORDS", "{unit}"] under [metrics] of '
            f"orchestration/simulation/results/display_names.toml"
        )


@pytest.mark.parametrize("metric", quadrotor().objectives)
def test_a_metric_of_more_than_is_exchanged_is_one_that_other_plants_and_controllers_may_lack(metric: str) -> None:
    beyond = beyond_exchanged()[metric]
    assert not beyond or metric in quadrotor().optional, (
        f"{metric} needs {', '.join(sorted(beyond))}, which a third-party plant or controller may lack: expected it "
        f"among `optional` of orchestration/quadrotor/scenarios/system.toml"
    )
