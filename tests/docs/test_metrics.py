"""The page on metrics has those that a flight has, each with its unit."""

import re

import pytest

from orchestration.quadrotor.scenarios.scenario import Scenario
from quadcosim import Result, run
from tests.places import ROOT

PAGE = (ROOT / "docs" / "metrics.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in re.findall(r"^\| `.*\|$", PAGE, re.M)]
UNITS = str.maketrans({"·": ".", "²": "2"})


@pytest.fixture(scope="module")
def flight() -> Result:
    return run(Scenario(stop_time=0.05))


def test_the_page_has_every_metric_of_a_flight_and_no_other(flight: Result) -> None:
    assert sorted(row[0].strip("`") for row in ROWS) == sorted(flight.metrics)


def test_the_page_has_the_units_that_follow_from_those_of_the_fmus(flight: Result) -> None:
    stated = {row[0].strip("`"): row[-2].translate(UNITS) for row in ROWS}
    assert {name: stated[name] for name in flight.units} == dict(flight.units)
