"""The table of a study, its shares, and which runs are chosen for their flights."""

import dataclasses
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from orchestration.experiments.report.blobs import Blobs
from orchestration.experiments.report.of_study import Stored, _difference, is_by_chance, is_sample
from orchestration.experiments.report.reruns import Rerun
from orchestration.experiments.report.subset import MAX_POINTS, MIN_POINTS, evenly, points_for, select
from orchestration.experiments.report.tables import ColumnAxis, report_table, share_of, shares_along
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.statistics import wilson
from orchestration.simulation.results.quantities import quantity
from tests.orchestration.experiments.report.test_blobs import read
from tests.orchestration.experiments.studies.common import axis, study


def row(index: int, good: bool, **settings: Any) -> dict[str, Any]:
    outcome = "settled" if good else "diverged"
    return {
        "design_index": index, "settings": settings, "status": "done", "message": None, "outcome": outcome,
        "good": float(good), "diverged": float(not good), "error": 0.1 if good else None, "steps": 3.0,
    }  # fmt: skip


ROWS = [row(i, i < 6, period=0.01 * (i % 4), law="ab"[i % 2]) for i in range(8)]


def column_axis(name: str, unit: str | None = None) -> ColumnAxis:
    return ColumnAxis(name=name, quantity=quantity(name, unit, [each["settings"].get(name) for each in ROWS]))


def test_a_table_has_axes_words_and_the_metrics_that_some_run_has() -> None:
    blobs = Blobs()
    made = report_table(
        [{**each, "never": None} for each in ROWS], [column_axis("period", "s"), column_axis("law")],
        ["good", "error", "never", "steps"], {"error": "N.m"}, blobs, tracks={5: 0}, messages={7: "fell"}, is_grid=True,
    )  # fmt: skip
    columns = {column.name: column for column in made.columns}
    assert list(columns) == ["design_index", "period", "law", "outcome", "error", "steps"]
    assert columns["error"].unit == "N·m"
    assert (columns["period"].label, columns["period"].unit) == ("period", "ms")
    assert read(blobs.blobs[columns["period"].values]).tolist() == pytest.approx([0.0, 10.0, 20.0, 30.0] * 2)
    assert columns["law"].words == ("a", "b")
    assert read(blobs.blobs[columns["law"].values]).tolist() == [0.0, 1.0] * 4
    assert made.tracks == {"5": 0}
    assert made.messages == {"7": "fell"}


def test_a_share_has_wilsons_interval_only_where_runs_are_drawn_by_chance() -> None:
    drawn, listed = (share_of("all", None, ROWS, by_chance=chance) for chance in (True, False))
    assert (drawn.good, drawn.runs) == (6, 8)
    assert (drawn.low, drawn.high) == wilson(6, 8)
    assert (listed.low, listed.high) == (None, None)


def rerun_with(error: float) -> Rerun:
    again: Any = SimpleNamespace(metrics={"outcome": "settled", "error": error})
    return again


@pytest.mark.parametrize(("apart", "agrees"), [(0.0, True), (0.9e-6, True), (-0.9e-6, True), (1.1e-6, False)])
def test_a_rerun_is_the_run_in_the_store_up_to_a_millionth(apart: float, agrees: bool) -> None:
    note = _difference(rerun_with(0.1 * (1.0 + apart)), ROWS[0], "error")
    assert (note is None) is agrees
    assert agrees or "in the rerun error is 0.1" in str(note)


SEEDS, PERIODS = axis("seed", 1, 2), axis("timing.period", 0.01, 0.02)
DRAWN = Axis(name="mass", targets=("plant.mass",), low=1.0, high=2.0)


@pytest.mark.parametrize(
    ("chosen", "by_chance"),
    [
        (study(PERIODS), False),
        (study(PERIODS, SEEDS), True),
        (study(PERIODS, Axis(name="luck", targets=("seed",), values=(1, 2))), True),
        (study(PERIODS, vary_seed=True), True),
        (study(PERIODS, DRAWN, method="random", samples=2), True),
    ],
    ids=["a grid", "an axis of seeds", "by another name", "a seed for each", "a sampled axis"],
)
def test_runs_are_a_sample_where_axes_or_seeds_are_drawn(chosen: Study, by_chance: bool) -> None:
    stored = Stored(rows=[], metrics=[], units={}, about={})
    assert is_sample(stored, chosen) is by_chance


def test_a_share_over_chosen_values_has_no_interval_though_others_of_the_study_have() -> None:
    chosen, stored = study(PERIODS, DRAWN, method="random", samples=2), Stored(rows=[], metrics=[], units={}, about={})
    assert is_by_chance(stored, chosen, "timing.period")
    assert not is_by_chance(stored, chosen, "mass")
    assert not is_by_chance(stored, chosen)


def test_shares_are_by_value_or_by_part_of_the_range() -> None:
    by_value = shares_along(ROWS, column_axis("period"), by_chance=True)
    assert by_value is not None
    assert [share.runs for share in by_value.shares] == [2, 2, 2, 2]
    many = [row(i, i % 2 == 0, period=10.0 ** (i / 100)) for i in range(100)]
    by_part = shares_along(many, dataclasses.replace(column_axis("period"), logarithmic=True), by_chance=True)
    assert by_part is not None
    assert sorted(share.runs for share in by_part.shares) == [12, 12, 12, 12, 13, 13, 13, 13]
    assert shares_along([ROWS[0], ROWS[4]], column_axis("period"), by_chance=True) is None


@pytest.mark.parametrize(("count", "wanted"), [(10, 3), (10, 10), (3, 10), (10_000, 1000)])
def test_places_are_spread_evenly_and_each_is_taken_once(count: int, wanted: int) -> None:
    places = sorted(evenly(count, wanted))
    assert len(set(places)) == len(places) == min(count, wanted)
    gaps = [b - a for a, b in pairwise(places)]
    assert max(gaps) <= max(1, 3 * count / wanted)
    assert {place % 100 for place in places} == set(range(100)) or wanted < 1000


def test_more_places_leave_those_that_are() -> None:
    assert set(evenly(500, 20)) < set(evenly(500, 60))


def test_runs_that_are_asked_for_are_chosen_first() -> None:
    assert select(range(100), [17, 3], 2) == [3, 17]
    found = select(range(100), [17], 10)
    assert 17 in found
    assert len(found) == 10


def test_more_runs_have_fewer_points_each() -> None:
    assert points_for(1, 20) == MAX_POINTS
    assert points_for(1000, 20) == 150
    assert points_for(100_000, 20) == MIN_POINTS
