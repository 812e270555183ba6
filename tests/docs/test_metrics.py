"""The page on metrics has those that a flight has: each with its unit and, as the program has it, its expression."""

import re
from pathlib import Path

import pytest

from orchestration.foundation.basics.documents import read_toml
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.systems.system.request import system_of
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


def test_the_expressions_on_the_page_are_those_that_are_computed(tmp_path: Path) -> None:
    (shown,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    computed = {name: " ".join(each.split()) for name, each in system_of(Scenario()).objectives.items()}
    assert computed.pop("saturation_share")
    (tmp_path / "shown.toml").write_text(shown, encoding="utf-8")
    assert read_toml(tmp_path / "shown.toml", "block") == computed
