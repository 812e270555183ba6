"""What is concluded from runs, of tables made up so that the answers are known."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from orchestration.experiments.comparison import fronts, outcome
from orchestration.experiments.comparison.bandwidth import Bandwidths
from orchestration.experiments.comparison.cells import cell_summaries, survived, table_of_runs
from orchestration.experiments.comparison.design import Comparison, Condition, Controller, VehicleEntry
from orchestration.experiments.comparison.fronts import pairs
from orchestration.experiments.comparison.limits import first_ends, limits
from orchestration.experiments.comparison.outcome import as_json, outcome_of
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.shares import interval_of_difference
from orchestration.foundation.basics.statistics import pair_correlation, wilson
from orchestration.systems.system.starts import Starts
from quadcosim import Scenario

PERIODS = (0.01, 0.02, 0.03, 0.04)
STARTS = 40
SPEED = {"slow": 10.0, "fast": 20.0}
"""Bandwidths [rad/s]; what flies depends on the period times these"""


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    return Comparison(
        name="made up",
        base=Scenario(),
        controllers=tuple(Controller(name=name, bandwidth=value) for name, value in SPEED.items()),
        vehicles=(VehicleEntry(name="v"),),
        conditions=(Condition(name="c"),),
        axis=Axis(name="period", targets=("timing.period",), values=PERIODS),
        starts=Starts(count=STARTS),
    )


BANDWIDTHS: Bandwidths = {(name, "v", period): value for name, value in SPEED.items() for period in PERIODS}


def flew(controller: str, period: float, start: int) -> bool:
    """Of 40 starts fewer at longer periods, and only by the phase."""
    return start < round(STARTS * (1.1 - SPEED[controller] * period))


def settles(start: int) -> bool:
    """Of those that survive, two in three, at any period."""
    return start % 3 != 0


@pytest.fixture(scope="module")
def table(comparison: Comparison) -> pd.DataFrame:
    rows = []
    for index, point in enumerate(comparison.study.points):
        controller, period, start = str(point["controller"]), float(point["period"]), int(point["start"])
        good = flew(controller, period, start)
        error = (2.0 if controller == "slow" else 1.0) * (1.0 + start)
        metrics = {
            "good": good,
            "outcome": ("settled" if settles(start) else "bounded") if good else "diverged",
            "horizon": 30.0 if good else 10.0 + start,
            "divergence_time": None if good else 10.0 + start,
            "settling_time": (1.0 + start if settles(start) else 29.0) if good else None,  # bounded: inside late
            "ultimate_bound": 0.01 * (1 + start) if good else None,
            "position_rmse": error if good else None,
            "torque_max": (1.0 if controller == "slow" else 3.0) + 0.01 * start if good else None,
            "total_variation.torque": 10.0 / error if good else None,
        }
        rows.append((index, metrics))
    return table_of_runs(comparison, rows)


def test_a_cell_tells_survival_settling_and_residual_apart(comparison: Comparison, table: pd.DataFrame) -> None:
    from scipy.stats import binomtest  # not before: each process that collects would load it

    cells = {(cell.controller, cell.value): cell for cell in cell_summaries(comparison, table)}
    cell = cells["slow", 0.03]
    assert (cell.count, cell.survives.count, cell.settles.count, cell.diverged) == (40, 32, 21, 8)
    assert cell.diverged_late == 8  # at 42 s and later, of a horizon of 30 s
    interval = binomtest(32, 40).proportion_ci(method="wilson")
    assert (cell.survives.low, cell.survives.high) == pytest.approx((interval.low, interval.high), rel=1e-12)
    interval = binomtest(21, 40).proportion_ci(method="wilson")
    assert (cell.settles.low, cell.settles.high) == pytest.approx((interval.low, interval.high), rel=1e-12)
    assert cell.medians["settling_time"].value == np.median([1.0 + k for k in range(32) if settles(k)])
    assert cell.medians["residual"].value == pytest.approx(np.median([0.01 * (1 + k) for k in range(32)]))
    assert cell.medians["position_rmse"].value == np.median([2.0 * (1.0 + k) for k in range(32)])
    assert cell.medians["position_rmse"].low == 2.0 * 10  # of 32 the 10th and the 23rd
    assert cell.medians["position_rmse"].high == 2.0 * 23


def test_a_limit_is_the_last_value_before_the_first_that_fails_with_the_grid_in_its_interval(
    comparison: Comparison, table: pd.DataFrame
) -> None:
    found = {(one.controller, one.share): one for one in limits(comparison, table, BANDWIDTHS) if one.fate == "survive"}
    half = found["fast", "half"]
    assert half.value == 0.03  # of 40 starts 36, 28, 20, 12 fly
    assert (half.low, half.high, half.bandwidth) == (0.02, 0.04, 20.0)  # the 14th and the 27th, and the next
    assert found["fast", "nine in ten"].value == 0.01
    assert found["slow", "half"].value == 0.04
    assert found["slow", "half"].high is None


def test_what_survives_farther_than_it_settles_has_two_limits(comparison: Comparison, table: pd.DataFrame) -> None:
    found = {
        (one.fate, one.share): one.value for one in limits(comparison, table, BANDWIDTHS) if one.controller == "slow"
    }
    assert found == {  # 40, 36, 32 and 28 survive; of these 26, 24, 21 and 18 settle
        ("survive", "half"): 0.04,
        ("survive", "nine in ten"): 0.02,
        ("settle", "half"): 0.03,
        ("settle", "nine in ten"): 0.0,
    }


def test_a_limit_lies_before_the_first_failure_even_if_later_values_are_good(
    comparison: Comparison, table: pd.DataFrame
) -> None:
    rows = table[table["controller"] == "slow"].copy()
    rows.loc[(rows["start"] == 0) & (rows["period"] == 0.02), "outcome"] = "diverged"
    rows.loc[(rows["start"] == 1) & (rows["period"] == 0.01), "outcome"] = "diverged"
    assert [*first_ends(comparison, rows, survived)][:3] == [0.01, 0.0, 0.04]


def test_controllers_with_missing_runs_have_no_limit_yet(comparison: Comparison, table: pd.DataFrame) -> None:
    assert {one.controller for one in limits(comparison, table.iloc[:-1], BANDWIDTHS)} == {"slow"}


def test_at_equal_bandwidth_what_depends_on_that_alone_is_the_same(comparison: Comparison, table: pd.DataFrame) -> None:
    found = {
        (one.controller, one.phase): one
        for one in outcome.at_equal_bandwidth(cell_summaries(comparison, table), BANDWIDTHS)
    }
    assert found["slow", 0.2].survives == found["fast", 0.2].survives == pytest.approx(0.9)
    assert found["slow", 0.4].survives == found["fast", 0.4].survives == pytest.approx(0.7)
    assert found["slow", 0.4].settles == found["fast", 0.4].settles == pytest.approx(18 / 40)
    assert ("slow", 0.6) not in found  # beyond its periods


def test_within_a_peak_torque_only_what_needs_no_more_counts(comparison: Comparison, table: pd.DataFrame) -> None:
    found = [one for one in outcome.at_equal_torque(comparison, table) if one.value == 0.02]
    assert {one.torque for one in found if one.controller == "slow"} == {one.torque for one in found}
    for one in found:
        count = sum(
            flew(one.controller, 0.02, k) and (1.0 if one.controller == "slow" else 3.0) + 0.01 * k <= one.torque
            for k in range(STARTS)
        )
        assert one.share == count / STARTS
    assert any(one.share > 0.5 for one in found if one.controller == "slow")
    assert any(one.share == 0.0 for one in found if one.controller == "fast")


def test_the_front_is_over_initial_conditions_that_all_survive_and_omits_controllers_that_survive_few(
    comparison: Comparison, table: pd.DataFrame
) -> None:
    """There is none where each survives from half of them, and no two from the same."""
    found = [*fronts.points(comparison, table)]
    at = {(one.controller, one.value): one for one in found}
    assert at["slow", 0.02].starts == at["fast", 0.02].starts == 28
    assert at["fast", 0.02].error.value == np.median([1.0 + k for k in range(28)])
    assert at["slow", 0.02].effort.value == np.median([5.0 / (1.0 + k) for k in range(28)])
    assert all(one.on_front for one in found)  # one has less error, the other less effort
    assert ("fast", 0.04) not in at  # 12 of 40
    worse = table.copy()
    worse.loc[worse["controller"] == "fast", "total_variation.torque"] /= 10.0
    assert {one.controller for one in fronts.points(comparison, worse) if one.on_front and one.value < 0.04} == {"fast"}
    lost = (table["start"] % 2 == 0) == (table["controller"] == "fast")
    assert not [*fronts.points(comparison, table.assign(outcome=lost.map({True: "diverged", False: "settled"})))]


def test_pairs_are_counted_and_compared_start_by_start(comparison: Comparison, table: pd.DataFrame) -> None:
    (pair,) = (one for one in pairs(comparison, table) if one.value == 0.02)
    assert (pair.controller, pair.against) == ("fast", "slow")
    assert (pair.both, pair.only_it, pair.only_other, pair.neither) == (28, 0, 8, 4)
    assert (pair.error.value, pair.error.low, pair.error.high) == (0.5, 0.5, 0.5)
    assert pair.effort.value == pytest.approx(2.0)
    assert pair.settles == sum(map(settles, range(28))) - sum(map(settles, range(36))) == -6  # all starts count
    low, high = interval_of_difference(
        {"share": 28 / 40, **ends_of(28, 40)}, {"share": 36 / 40, **ends_of(36, 40)},
        correlation=pair_correlation(28, 0, 8, 4),
    )  # fmt: skip
    assert vars(pair.shares["survive"]) == pytest.approx({"value": -0.2, "low": low, "high": high})
    assert pair.row()["settles.difference"] == pytest.approx(-6 / 40)
    assert "shares" not in pair.row()


def ends_of(count: int, runs: int) -> dict[str, float]:
    return dict(zip(("low", "high"), wilson(count, runs)))


def test_the_intervals_of_pairs_hold_for_all_of_them_together(comparison: Comparison, table: pd.DataFrame) -> None:
    """With as many conditions again there are twice as many comparisons, and no interval is narrower."""
    rng = np.random.default_rng(0)
    noisy = table.assign(position_rmse=table["position_rmse"].astype(float) * rng.uniform(0.5, 2.0, len(table)))
    (alone,) = (one for one in pairs(comparison, noisy) if one.value == 0.01)
    conditions = tuple(Condition(name=name) for name in ("c", *map(str, range(300))))
    (among,) = (one for one in pairs(replace(comparison, conditions=conditions), noisy) if one.value == 0.01)
    assert alone.error.value == among.error.value
    ends = [among.error.low, alone.error.low, alone.error.high, among.error.high]
    numbers = [end for end in ends if end is not None]
    assert ends == sorted({*numbers})


def test_nothing_in_the_json_is_infinite(comparison: Comparison, table: pd.DataFrame) -> None:
    def numbers(value: object) -> list[float]:
        inner = [*value.values()] if isinstance(value, dict) else value if isinstance(value, list) else []
        return [x for one in inner for x in numbers(one)] + ([value] if isinstance(value, float) else [])

    content = as_json(comparison, outcome_of(comparison, table, BANDWIDTHS), BANDWIDTHS)
    found = numbers(content)
    assert len(found) > 100
    assert all(map(math.isfinite, found))
