"""The parts of a criterion that a run did not meet are reported with value and bound."""

from dataclasses import replace
from typing import Any

import pytest

from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.simulation.results.objectives import bound_of, criterion_in_words, undecided, unmet
from orchestration.systems.system.model import System


def with_good(good: str | None) -> System:
    system = quadrotor()
    return replace(system, criterion=replace(system.criterion, good=good))


def metrics(values: dict[str, Any], good: bool | None = False, outcome: str = "bounded") -> dict[str, Any]:
    return {"good": good, "outcome": outcome, **values}


UNITS = {"ultimate_bound": "m", "settling_time": "s"}


@pytest.mark.parametrize(
    ("good", "values", "text"),
    [
        ("ultimate_bound < 0.05", {"ultimate_bound": 0.0623}, "ultimate_bound = 0.0623 m, expected < 0.05 m"),
        ("ultimate_bound < 0.05", {"ultimate_bound": 0.05000004}, "ultimate_bound = 0.05000004 m, expected < 0.05 m"),
        ("ultimate_bound < 2.50003", {"ultimate_bound": 2.50004}, "ultimate_bound = 2.50004 m, expected < 2.50003 m"),
        ("ultimate_bound < 0.05", {"ultimate_bound": None}, "ultimate_bound has no value, expected < 0.05 m"),
        (
            "ultimate_bound < 0.05 and settling_time <= 5",
            {"ultimate_bound": 0.01, "settling_time": 7.0},
            "settling_time = 7 s, expected <= 5 s",
        ),
        (
            "ultimate_bound < 0.05 and settling_time <= 5",
            {"ultimate_bound": 0.1, "settling_time": 7.0},
            "ultimate_bound = 0.1 m, expected < 0.05 m; settling_time = 7 s, expected <= 5 s",
        ),
        ("ultimate_bound + settling_time < 1", {}, "ultimate_bound + settling_time < 1 does not hold"),
    ],
)
def test_the_part_that_failed_is_reported(good: str, values: dict[str, float | None], text: str) -> None:
    assert unmet(with_good(good), metrics(values), UNITS) == text


def test_of_a_run_that_is_good_or_diverged_nothing_is_reported() -> None:
    system = with_good("ultimate_bound < 0.05")
    assert unmet(system, metrics({"ultimate_bound": 0.01}, good=True), UNITS) is None
    assert unmet(system, metrics({"ultimate_bound": None}, outcome="diverged"), UNITS) is None
    assert unmet(with_good(None), metrics({}, good=None), UNITS) is None


def test_an_edge_is_the_bound_of_a_comparison_that_may_stand_beside_others_and_of_no_other_expression() -> None:
    assert bound_of(with_good("ultimate_bound < 0.05"), "ultimate_bound") == 0.05
    assert bound_of(with_good("ultimate_bound < 0.05 and settling_time < 5"), "settling_time") == 5.0


def test_a_criterion_is_said_with_the_names_and_units_of_its_objectives() -> None:
    system = with_good("ultimate_bound < 0.05 and (cost < 2 or settling_time + 1 < 3)")
    said = "largest position error, last third < 0.05 m and ((cost < 2) or ((settling_time + 1) < 3))"
    assert criterion_in_words(system, {}) == said


def test_that_most_runs_are_neither_good_nor_diverged_is_said_where_runs_can_diverge() -> None:
    said = "3 of 5 runs are bounded, neither settled nor diverged: a longer stop_time may tell"
    assert undecided(quadrotor(), {"bounded": 3, "settled": 1, "diverged": 1}) == said
    assert undecided(quadrotor(), {"bounded": 2, "settled": 2}) == ""
    system = replace(quadrotor(), criterion=replace(quadrotor().criterion, diverged=None))
    assert undecided(system, {"bounded": 5}) == ""
