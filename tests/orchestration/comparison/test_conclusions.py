"""What is concluded from runs, of tables made up so that the answers are known."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.stats import binomtest

from orchestration.comparison import equal_terms as slices
from orchestration.comparison import fronts
from orchestration.comparison.bandwidth import Bandwidths
from orchestration.comparison.cells import frame_of, results
from orchestration.comparison.design import Comparison, Condition, Controller, Craft
from orchestration.comparison.limits import first_ends, limits
from orchestration.comparison.outcome import as_json, concluded
from orchestration.comparison.pairs import pairs
from orchestration.quadrotor.initial_conditions import Starts
from orchestration.studies.axes import Axis
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
        vehicles=(Craft(name="v"),),
        conditions=(Condition(name="c"),),
        axis=Axis(name="period", targets=("timing.period",), values=PERIODS),
        starts=Starts(count=STARTS),
    )


BANDWIDTHS: Bandwidths = {(name, "v", period): value for name, value in SPEED.items() for period in PERIODS}


def flew(controller: str, period: float, start: int) -> bool:
    """Of 40 starts fewer at longer periods, and only by the phase."""
    return start < round(STARTS * (1.1 - SPEED[controller] * period))


@pytest.fixture(scope="module")
def table(comparison: Comparison) -> pd.DataFrame:
    rows = []
    for index, point in enumerate(comparison.study.points):
        controller, period, start = str(point["controller"]), float(point["period"]), int(point["start"])
        good = flew(controller, period, start)
        error = (2.0 if controller == "slow" else 1.0) * (1.0 + start)
        metrics = {
            "good": good,
            "outcome": "settled" if good else "diverged",
            "position_rmse": error if good else None,
            "torque_max": (1.0 if controller == "slow" else 3.0) + 0.01 * start if good else None,
            "total_variation.torque": 10.0 / error if good else None,
        }
        rows.append((index, metrics))
    return frame_of(comparison, rows)


def test_a_cell_counts_what_flies_and_has_medians_of_that_alone(comparison: Comparison, table: pd.DataFrame) -> None:
    cells = {(cell.controller, cell.value): cell for cell in results(comparison, table)}
    cell = cells["slow", 0.03]
    assert (cell.runs, cell.flown, cell.diverged, cell.share) == (40, 32, 8, 0.8)
    interval = binomtest(32, 40).proportion_ci(method="wilson")
    assert (cell.low, cell.high) == pytest.approx((interval.low, interval.high), rel=1e-12)
    assert cell.medians["position_rmse"].value == np.median([2.0 * (1.0 + k) for k in range(32)])
    assert cell.medians["position_rmse"].low == 2.0 * 10  # of 32 the 10th and the 23rd
    assert cell.medians["position_rmse"].high == 2.0 * 23


def test_a_limit_is_the_last_value_before_the_first_that_fails_with_the_grid_in_its_interval(
    comparison: Comparison, table: pd.DataFrame
) -> None:
    found = {(one.controller, one.share): one for one in limits(comparison, table, BANDWIDTHS)}
    half = found["fast", "half"]
    assert half.value == 0.03  # of 40 starts 36, 28, 20, 12 fly
    assert (half.low, half.high, half.bandwidth) == (0.02, 0.04, 20.0)  # the 14th and the 27th, and the next
    assert found["fast", "nine in ten"].value == 0.01
    assert found["slow", "half"].value == 0.04
    assert found["slow", "half"].high is None


def test_what_flies_again_further_up_has_its_limit_before(comparison: Comparison, table: pd.DataFrame) -> None:
    rows = table[table["controller"] == "slow"].copy()
    rows.loc[(rows["start"] == 0) & (rows["period"] == 0.02), "good"] = False
    rows.loc[(rows["start"] == 1) & (rows["period"] == 0.01), "good"] = False
    assert [*first_ends(comparison, rows)][:3] == [0.01, 0.0, 0.04]


def test_controllers_with_missing_runs_have_no_limit_yet(comparison: Comparison, table: pd.DataFrame) -> None:
    assert {one.controller for one in limits(comparison, table.iloc[:-1], BANDWIDTHS)} == {"slow"}


def test_at_equal_bandwidth_what_depends_on_that_alone_is_the_same(comparison: Comparison, table: pd.DataFrame) -> None:
    found = {
        (one.controller, one.phase): one for one in slices.at_equal_bandwidth(results(comparison, table), BANDWIDTHS)
    }
    assert found["slow", 0.2].share == found["fast", 0.2].share == pytest.approx(0.9)
    assert found["slow", 0.4].share == found["fast", 0.4].share == pytest.approx(0.7)
    assert ("slow", 0.6) not in found  # beyond its periods
    assert found["fast", 0.2].low < 0.9 < found["fast", 0.2].high


def test_within_a_peak_torque_only_what_needs_no_more_counts(comparison: Comparison, table: pd.DataFrame) -> None:
    found = [one for one in slices.at_equal_torque(comparison, table) if one.value == 0.02]
    assert {one.torque for one in found if one.controller == "slow"} == {one.torque for one in found}
    for one in found:
        count = sum(
            flew(one.controller, 0.02, k) and (1.0 if one.controller == "slow" else 3.0) + 0.01 * k <= one.torque
            for k in range(STARTS)
        )
        assert one.share == count / STARTS
    assert any(one.share > 0.5 for one in found if one.controller == "slow")
    assert any(one.share == 0.0 for one in found if one.controller == "fast")


def test_the_front_is_taken_on_the_starts_that_all_fly_and_leaves_out_what_hardly_flies(
    comparison: Comparison, table: pd.DataFrame
) -> None:
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


def test_pairs_are_counted_and_compared_start_by_start(comparison: Comparison, table: pd.DataFrame) -> None:
    (pair,) = (one for one in pairs(comparison, table) if one.value == 0.02)
    assert (pair.controller, pair.against) == ("fast", "slow")
    assert (pair.both, pair.only_it, pair.only_other, pair.neither) == (28, 0, 8, 4)
    assert (pair.error.value, pair.error.low, pair.error.high) == (0.5, 0.5, 0.5)
    assert pair.effort.value == pytest.approx(2.0)


def test_nothing_in_the_json_is_infinite(comparison: Comparison, table: pd.DataFrame) -> None:
    def numbers(value: object) -> list[float]:
        inner = [*value.values()] if isinstance(value, dict) else value if isinstance(value, list) else []
        return [x for one in inner for x in numbers(one)] + ([value] if isinstance(value, float) else [])

    content = as_json(comparison, concluded(comparison, table, BANDWIDTHS), BANDWIDTHS)
    found = numbers(content)
    assert len(found) > 100
    assert all(map(math.isfinite, found))
