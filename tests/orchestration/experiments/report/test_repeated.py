"""Maps of a study that repeats, in its report: they fold the seeds, and end with the difference of two laws."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from orchestration.experiments.report.model import CellMap, MapCell
from orchestration.experiments.report.repeated import RunsInCells, maps_of_both, repeated_maps, runs_in_cells
from orchestration.experiments.report.tables import ColumnAxis
from orchestration.experiments.studies.axes import quantity_of
from orchestration.experiments.studies.shares import interval_of_difference
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.statistics import wilson
from quadcosim import UsageError
from tests.orchestration.experiments.studies.common import axis, study

LAWS = axis("controller", "UnifiedController", "CascadedController")
PERIODS, LOSSES, SEEDS = axis("timing.period", 0.01, 0.02), axis("timing.loss", 0.0, 0.1), axis("seed", 1, 2, 3)


def maps_of(chosen: Study) -> tuple[CellMap, ...] | None:
    """The maps where the second law is good at 10 ms without loss alone, and the first everywhere."""
    found = repeated_maps(
        runs_with(
            chosen,
            lambda at: (
                at.get("controller") != "CascadedController" or (at["timing.period"], at["timing.loss"]) == (0.01, 0.0)
            ),
        )
    )
    return None if found is None else found.maps


def runs_with(chosen: Study, is_good: Callable[[dict[str, Any]], bool]) -> RunsInCells | None:
    rows: list[dict[str, Any]] = [
        {"design_index": i, "settings": point, "status": "done", "good": int(is_good(point))}
        for i, point in enumerate(chosen.points)
    ]
    axes = [ColumnAxis(name=each.name, quantity=quantity_of(each, {"timing.period": "s"})) for each in chosen.axes]
    return runs_in_cells(chosen, rows, axes)


def cell(of: CellMap, x: float, y: float) -> MapCell:
    (found,) = [one for one in of.cells if (one.x, one.y) == (x, y)]
    return found


def test_two_laws_have_a_map_each_and_one_of_their_difference() -> None:
    maps = maps_of(study(LAWS, PERIODS, LOSSES, SEEDS, repeat="seed"))
    assert maps is not None
    first, second, difference = maps
    assert difference.title == "difference, CascadedController minus UnifiedController"
    assert [one.is_difference for one in maps] == [False, False, True]
    lossy = cell(second, 20.0, 0.1)
    assert (lossy.text, lossy.value, (lossy.low, lossy.high)) == ("0/3", 0.0, wilson(0, 3))
    assert lossy.runs == (21, 22, 23)
    assert lossy.said == "0 of 3 settled: 0 %, 95 % interval 0 % to 56.1 %"
    exact = cell(first, 10.0, 0.0)
    assert (exact.text, exact.low, exact.said) == ("1/1", None, "1 of 1 settled: 100 %, nothing is random")
    apart, ends = cell(difference, 20.0, 0.1), (wilson(0, 3), wilson(3, 3))
    shares = [{"share": share, "low": low, "high": high} for share, (low, high) in zip((0.0, 1.0), ends)]
    assert (apart.low, apart.high) == interval_of_difference(*shares)
    assert apart.runs == (9, 10, 11, 21, 22, 23)


def test_two_studies_have_their_own_maps_and_the_difference_of_both_in_pairs_of_one_seed() -> None:
    chosen = study(PERIODS, LOSSES, SEEDS, repeat="seed")
    one = runs_with(chosen, lambda at: at["seed"] != 3)
    other = runs_with(chosen, lambda at: (at["timing.period"], at["timing.loss"]) != (0.02, 0.1) and at["seed"] != 3)
    found = maps_of_both(("a", one), ("b", other))
    assert found is not None
    _, second, difference = found.maps
    assert [one.title for one in found.maps] == ["a: share settled", "b: share settled", "difference, b minus a"]
    assert cell(second, 20.0, 0.1).text == "0/3"
    assert [(of.runs, of.others) for of in (cell(each, 20.0, 0.1) for each in found.maps)] == [
        ((9, 10, 11), ()), ((), (9, 10, 11)), ((9, 10, 11), (9, 10, 11)),
    ]  # fmt: skip
    apart, ends = cell(difference, 20.0, 0.1), (wilson(0, 3), wilson(2, 3))
    shares = [{"share": share, "low": low, "high": high} for share, (low, high) in zip((0.0, 2 / 3), ends)]
    assert (apart.low, apart.high) == interval_of_difference(*shares)
    assert (apart.value, apart.runs) == (-2 / 3, (9, 10, 11))
    alike, share = cell(difference, 10.0, 0.1), {"share": 2 / 3, "low": ends[1][0], "high": ends[1][1]}
    assert (alike.low, alike.high) == interval_of_difference(share, share, correlation=(2 - 1.5) / 2)
    assert cell(difference, 10.0, 0.0).said == "0 %, nothing is random"
    with pytest.raises(UsageError, match=r"b: expected the same design\.repeat and order of axes as a"):
        maps_of_both(("a", one), ("b", None))
    assert maps_of_both(("a", None), ("b", None)) is None


def test_a_study_over_axes_that_another_lacks_has_no_runs_in_its_cells() -> None:
    chosen = study(PERIODS, LOSSES, SEEDS, repeat="seed")
    other = [ColumnAxis(name=each.name, quantity=quantity_of(each, {})) for each in (PERIODS, SEEDS)]
    assert runs_in_cells(chosen, [], other) is None


def test_two_studies_of_two_laws_have_a_difference_of_each_and_unpaired_seeds_count_less() -> None:
    laws = replace(LAWS, name="law", targets=("controller",))
    first, second = (
        study(laws, PERIODS, LOSSES, axis("seed", *seeds), repeat="seed") for seeds in ((1, 2, 3, 4), (2, 3, 4, 5))
    )
    both = [(name, runs_with(each, lambda at: at["seed"] != 2)) for name, each in (("a", first), ("b", second))]
    found = maps_of_both(both[0], both[1])
    assert found is not None
    assert [one.title for one in found.maps[-2:]] == [
        "difference, b minus a, UnifiedController", "difference, b minus a, CascadedController",
    ]  # fmt: skip
    apart, (low, high) = cell(found.maps[-1], 20.0, 0.1), wilson(3, 4)
    share, of_pairs = {"share": 0.75, "low": low, "high": high}, (2 - 1.5) / 2
    assert (apart.low, apart.high) == interval_of_difference(share, share, correlation=of_pairs * 3 / 4)


def test_other_studies_keep_the_map_of_their_runs() -> None:
    assert maps_of(study(PERIODS, LOSSES, SEEDS)) is None
    assert maps_of(study(PERIODS, axis("timing.loss", 0.0), axis("timing.jitter", 0.0), SEEDS, repeat="seed")) is None
