"""Cells of a study: shares of good runs with their intervals, laws side by side, their difference."""

import itertools
import math
import os
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

import quadcosim
from orchestration.command import study_table
from orchestration.command.printed_tables import MAX_ROWS, PrintedTable, decimals_of, lines, to_digits, with_interval
from orchestration.experiments.studies import cell_texts, drawing
from orchestration.experiments.studies.cell_lines import cell_lines
from orchestration.experiments.studies.cell_maps import cell_maps
from orchestration.experiments.studies.shares import (
    PAIR,
    REMARKS,
    TwoLaws,
    averages_of,
    differences_in,
    differences_of,
    differences_of_averages,
    expect_mean,
    interval_of_difference,
    judged_by,
    shares_of,
    with_chance,
)
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.table import frame
from orchestration.foundation.basics.statistics import pair_correlation, wilson
from orchestration.quadrotor.scenarios.vehicle import load_vehicle
from orchestration.simulation.figures.names import COLUMNS
from orchestration.simulation.figures.style import INCH, PAGE, STYLES
from orchestration.theory.exact.mean_square import NO_EXPECTATION
from quadcosim import Scenario, UsageError
from tests.commands import Main
from tests.orchestration.experiments.studies.common import STORE, axis, study

LAWS = axis("controller", "UnifiedController", "CascadedController")
PERIODS, LOSSES = axis("timing.period", 0.01, 0.02), axis("timing.loss", 0.0, 0.1, 0.2)
SEEDS = 8
WORDS = ("settled", "bounded")


def runs() -> pd.DataFrame:
    """All runs of the first law are good; of the second as many as its cell has in its index, none at 20 ms."""
    rows: list[dict[str, Any]] = [
        {
            "controller": law, "timing.period": period, "timing.loss": loss, "seed": seed, "status": "done",
            "random": True, REMARKS: {}, PAIR: seed, "diverged": False,
            "good": first or (period < 0.02 and seed < 3 * k),
            "position_rmse": 1.0 + seed,
        }
        for law, first in zip(LAWS.values or (), (True, False))
        for period in (0.01, 0.02)
        for k, loss in enumerate((0.0, 0.1, 0.2))
        for seed in range(SEEDS)
    ]  # fmt: skip
    return pd.DataFrame(rows).astype({"good": "boolean"})


def test_a_cell_is_the_share_of_its_good_runs_with_wilsons_interval() -> None:
    cells = shares_of(runs(), ["controller", "timing.period", "timing.loss"])
    assert cells["count"].eq(SEEDS).all()
    cell = cells.query("controller == 'CascadedController' and `timing.period` == 0.01 and `timing.loss` == 0.1").iloc[
        0
    ]
    assert (cell["good"], cell["share"]) == (3, 3 / 8)
    assert (cell["low"], cell["high"]) == wilson(3, 8)


def test_a_metric_that_is_true_or_false_has_its_share_of_all_runs() -> None:
    diverged = judged_by(runs().assign(diverged=lambda table: ~table["good"]), "diverged")
    cells = shares_of(diverged, ["controller", "timing.period"]).set_index(["controller", "timing.period"])
    assert cells["share"].tolist() == [0.0, 0.0, 15 / 24, 1.0]


def test_a_metric_of_a_cell_is_its_median_over_the_good_runs_and_failed_runs_do_not_count() -> None:
    table = runs()
    table.loc[0, ["status", "good"]] = ["failed", pd.NA]
    cells = averages_of(table, ["controller", "timing.period", "timing.loss"], "position_rmse").set_index(
        ["controller", "timing.period", "timing.loss"]
    )
    assert cells.loc[("CascadedController", 0.01, 0.1), "median"] == 2.0
    assert np.isnan(cells.loc[("CascadedController", 0.02, 0.1), "median"])
    assert cells.loc[("UnifiedController", 0.01, 0.0), "good"] == SEEDS - 1


def test_good_runs_without_the_metric_are_left_out_and_counted_as_such_in_map_line_and_table() -> None:
    names = ["controller", "timing.period", "timing.loss"]
    table = runs().query("controller == 'CascadedController'")
    lacks = (table["timing.loss"] == 0.1) | ((table["timing.loss"] == 0.2) & (table["seed"] == 5))
    table = table.assign(position_rmse=table["position_rmse"].mask(lacks))
    medians = averages_of(table, names, "position_rmse")
    assert medians[["good", "with_value"]].to_numpy().tolist() == [[0, 0], [3, 0], [6, 5], [0, 0], [0, 0], [0, 0]]
    texts = study_table._averages(medians, "median", "with_value")
    assert texts[:3] == ["- (0 of 8)", "- (0 of 8)", "3.00 (5 of 8)"]
    one_law = axis("controller", "CascadedController")
    figure = cell_maps(table, (PERIODS, LOSSES), one_law, "position_rmse", WORDS, units={})
    assert [text.get_text() for text in figure.axes[0].texts] == ["5/8"]
    assert figure.get_suptitle() == "8 runs a cell; 43 of 48 runs left out (not settled, or without a value)"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["half of the runs settled", "none settled, or no value"]
    figure = cell_lines(table, LOSSES, one_law, "position_rmse", WORDS, units={})
    assert [text.get_text() for text in figure.axes[0].texts] == ["5/16"]
    assert "; 43 of 48 runs left out (not" in figure.get_suptitle()
    assert crosses_of(figure) == [0.0, 0.1]
    assert figure.get_suptitle().replace("\n", " ").endswith("with a value by CascadedController at 0, 0.1")


def test_a_mean_is_over_all_runs_with_a_value_and_marks_where_some_are_left_out() -> None:
    names, laws = ["controller", "timing.loss"], TwoLaws("controller", *map(str, LAWS.values or ()))
    table = runs().query("`timing.period` == 0.02 and seed < 4").assign(good=False)  # 1, 2, 3, 4
    table["diverged"] = (table["timing.loss"] == 0.1) & (table["seed"] == 3)
    table["position_rmse"] = (table["position_rmse"] * (1 + (table["controller"] == laws.second))).mask(
        table["diverged"]
    )
    means = averages_of(table, names, "position_rmse", "mean").set_index(names)
    assert means.loc[laws.first, 0.0][["count", "diverged", "with_value", "mean"]].tolist() == [4, 0, 4, 2.5]
    half = 3.182446305284263 * math.sqrt(
        5.0 / 3.0 / 4.0
    )  # the 97.5 % quantile of Student's t with 3 degrees of freedom
    assert means.loc[laws.first, 0.0][["low", "high"]].tolist() == pytest.approx([2.5 - half, 2.5 + half])
    assert means.loc[laws.first, 0.1][["count", "diverged", "with_value", "mean"]].tolist() == [4, 1, 3, 2.0]
    pairs = differences_in(table, names, laws, "position_rmse", "mean").set_index("timing.loss")
    numbers = ["pairs", "difference", "low", "high"]
    assert pairs.loc[0.0, numbers].tolist() == pytest.approx([4, 2.5, 2.5 - half, 2.5 + half])
    assert pairs.loc[0.1, ["pairs", "difference"]].tolist() == [3, 2.0]
    alone = differences_in(table, names[:1], laws, "position_rmse", "mean")  # PAIR: seeds of all losses
    assert alone.columns.tolist() == [*numbers, "remark"]
    figure = cell_lines(table, LOSSES, LAWS, "position_rmse", WORDS, units={}, average="mean")
    assert "; 2 of 24 runs left out (without a value), all of them diverged" in figure.get_suptitle().replace("\n", " ")
    hollow = [line for line in figure.axes[0].get_lines() if line.get_markerfacecolor() == "white"]
    assert [np.asarray(line.get_xdata()).tolist() for line in hollow] == [[0.1], [0.1], []]
    assert [text.get_text() for text in figure.axes[0].texts] == ["4", "3/4", "4"] * 2
    figure = cell_maps(table, (PERIODS, LOSSES), LAWS, "position_rmse", WORDS, units={}, average="mean")
    assert [text.get_text() for text in figure.axes[0].texts] == ["4", "3/4", "4"]
    with pytest.raises(UsageError, match="mean: expected a metric that is a number"):
        expect_mean("good", "seed")


def test_a_mean_without_a_finite_expectation_has_no_interval_no_dot_and_no_colour() -> None:
    names, laws = ["controller", "timing.period", "timing.loss"], TwoLaws("controller", *map(str, LAWS.values or ()))
    table, metric = runs(), "position_rmse"
    is_second = table["controller"] == laws.second
    at = is_second & (table["timing.loss"] == 0.2)
    table[REMARKS] = pd.Series([{metric: NO_EXPECTATION} if each else {} for each in at], index=table.index)
    table[metric] += 10.0 * is_second + 1e6 * at
    means = averages_of(table, names, metric, "mean").set_index(names)
    infinite = means["remark"] == "no finite expectation"
    assert means.index[infinite].tolist() == [(laws.second, period, 0.2) for period in (0.01, 0.02)]
    assert (means[["low", "high"]].isna().all(axis=1) == infinite).all()
    assert averages_of(table, names, metric)["low"].notna().any(), "a median always has an interval"
    found = differences_in(table, names, laws, metric, "mean").set_index("timing.loss")
    assert found["low"].isna().tolist() == (found["remark"] != "").tolist() == [False, False, True] * 2
    figure = cell_maps(table, (PERIODS, LOSSES), LAWS, metric, WORDS, units={}, average="mean")
    bar = next(each for each in figure.axes if "2 cells without a finite expectation left out" in each.get_xlabel())
    assert bar.get_xlim()[1] < 20.0, "the others have all of its colours"
    dots = [line for line in figure.axes[2].get_lines() if line.get_marker() == "o"]
    assert [sorted({*np.asarray(line.get_ydata()).tolist()}) for line in dots] == [[0.0, 0.1]]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["no finite expectation"]
    figure = cell_lines(table.query("`timing.period` == 0.01"), LOSSES, LAWS, metric, WORDS, units={}, average="mean")
    panel = figure.axes[0]
    marks = [line for line in panel.get_lines() if line.get_marker() == "$\\infty$"]
    assert [np.asarray(line.get_xdata()).tolist() for line in marks] == [[0.2], []]
    assert panel.get_ylim()[1] < 30.0
    assert "no finite expectation" in [text.get_text() for text in figure.legends[0].get_texts()]


def crosses_of(figure: Figure) -> list[float]:
    """The places of the crosses, which are at the lower edge of its panel."""
    drawn = [np.asarray(line.get_data()) for line in figure.axes[0].get_lines() if line.get_marker() == "x"]
    ((at, height),) = [data for data in drawn if data.size]
    assert max(height) < 0.05
    return [*at]


def test_runs_that_no_criterion_judges_have_no_share() -> None:
    with pytest.raises(UsageError, match=r"expected criterion\.good in the base"):
        shares_of(runs().assign(good=pd.NA), ["timing.period"])


def share_of(good: int, count: int) -> dict[str, float]:
    low, high = wilson(good, count)
    return {"share": good / count, "low": low, "high": high}


@pytest.mark.parametrize(
    ("one", "other", "interval"),
    [
        ((56, 70), (48, 80), (0.0524, 0.3339)), ((9, 10), (3, 10), (0.1705, 0.8090)),
        ((10, 10), (0, 20), (0.6791, 1.0)), ((5, 56), (0, 29), (-0.0381, 0.1926)),
    ],
)  # fmt: skip
def test_the_interval_of_a_difference_is_newcombes(
    one: tuple[int, int], other: tuple[int, int], interval: tuple[float, float]
) -> None:
    """Newcombe (1998), Statistics in Medicine 17, 873-890, table II."""
    assert interval_of_difference(share_of(*one), share_of(*other)) == pytest.approx(interval, abs=5e-5)


@pytest.mark.parametrize(("pairs", "interval"), [((36, 12, 2, 0), (0.0569, 0.3404)), ((1, 1, 7, 12), (-0.507, -0.026))])
def test_the_interval_of_a_difference_of_pairs_is_newcombes(
    pairs: tuple[int, int, int, int], interval: tuple[float, float]
) -> None:
    """Newcombe (1998), Statistics in Medicine 17, 2635-2650; Fagerland, Lydersen and Laake (2014), of Bentur's data."""
    both, only_one, only_other, _ = pairs
    shares = (share_of(both + only, sum(pairs)) for only in (only_one, only_other))
    found = interval_of_difference(*shares, correlation=pair_correlation(*pairs))
    assert found == pytest.approx(interval, abs=6e-5 if pairs[0] > 1 else 6e-4)


def test_few_pairs_without_a_difference_have_a_dot_by_chance_as_often_as_the_page_says() -> None:
    pairs, (both, only, neither) = 8, (0.0116, 0.4561, 0.0762)  # the worst probabilities of a pair for eight of them
    chance = 0.0
    for one, other, none in itertools.product(range(pairs + 1), repeat=3):
        counts = (pairs - one - other - none, one, other, none)
        if counts[0] >= 0:
            shares = (share_of(counts[0] + each, pairs) for each in (one, other))
            low, high = interval_of_difference(*shares, correlation=pair_correlation(*counts))
            ways = math.factorial(pairs) / math.prod(map(math.factorial, counts))
            chance += (low > 0.0 or high < 0.0) * ways * math.prod(map(pow, (both, only, only, neither), counts))
    assert chance == pytest.approx(0.0856, abs=5e-5)


def test_the_interval_of_a_difference_of_two_laws_is_newcombes_for_pairs() -> None:
    names, laws = ["controller", "timing.period", "timing.loss"], TwoLaws("controller", *map(str, LAWS.values or ()))
    place = ["timing.period", "timing.loss"]
    found = differences_of(runs(), names, laws).set_index(place)
    assert found.loc[(0.01, 0.1), "difference"] == 3 / 8 - 1.0
    expected = interval_of_difference(share_of(3, 8), share_of(8, 8))  # one of them never varies
    assert tuple(found.loc[(0.01, 0.1), ["low", "high"]]) == expected
    alike = runs().assign(good=lambda table: table["seed"] < 3 + (table["controller"] == LAWS.values[0]))  # type: ignore[index]
    found = differences_of(alike, names, laws).set_index(place)
    low, high = interval_of_difference(share_of(3, 8), share_of(4, 8))
    assert low < found.loc[(0.01, 0.1), "low"] < found.loc[(0.01, 0.1), "high"] < high
    pairless = differences_of(alike.assign(**{PAIR: range(len(alike))}), names, laws).set_index(place)
    assert tuple(pairless.loc[(0.01, 0.1), ["low", "high"]]) == (low, high)


def test_averages_of_two_laws_differ_by_that_of_the_pairs_in_which_both_are_good() -> None:
    names, laws = ["controller", "timing.period", "timing.loss"], TwoLaws("controller", *map(str, LAWS.values or ()))
    table = runs().assign(position_rmse=lambda t: t["seed"] ** 2.0 * (t["controller"] == laws.second) + 5.0 * t["seed"])
    found = differences_of_averages(table, names, laws, "position_rmse").set_index(["timing.period", "timing.loss"])
    assert [*found.index] == [(0.01, 0.1), (0.01, 0.2)], "elsewhere none of the second law is good"
    assert found["pairs"].tolist() == [3, 6]
    assert found["difference"].tolist() == [1.0, 6.5], (
        "of seeds 0 to 2 and 0 to 5, whatever the others of the first law"
    )
    assert found["low"].isna().tolist() == [True, False], "three pairs do not bound a median"
    assert tuple(found.loc[(0.01, 0.2), ["low", "high"]]) == (0.0, 25.0)
    medians = averages_of(table, names, "position_rmse").set_index(names).sort_index().loc[laws.second, 0.01]
    assert medians["good"].tolist() == [0, 3, 6]
    assert medians["median"].tolist() == [pytest.approx(np.nan, nan_ok=True), 6.0, 19.0]
    assert medians.loc[0.2, ["low", "high"]].tolist() == [0.0, 50.0]
    assert medians.loc[0.1, ["low", "high"]].isna().all(), "three runs do not bound a median"
    exact = differences_of_averages(table.assign(random=False), names, laws, "position_rmse")
    assert exact["pairs"].tolist() == [1, 1]
    assert exact[["low", "high"]].isna().all(axis=None)
    figure = cell_maps(table.assign(position_rmse=table["position_rmse"] + 1.0 * (table["controller"] == laws.second)),
                       (PERIODS, LOSSES), LAWS, "position_rmse", WORDS, units={"position_rmse": "m"})  # fmt: skip
    assert [text.get_text() for text in figure.axes[1].texts] == ["3/8", "6/8"]
    assert [text.get_text() for text in figure.axes[2].texts] == ["+", "+", "3", "6"]
    assert [bar.get_xlabel() for bar in figure.axes[3:]][1] == "median difference [m],\nnumber of pairs"
    (marks,) = [line for line in figure.axes[2].get_lines() if line.get_marker() == "o"]
    assert np.asarray(marks.get_ydata()).tolist() == [0.2], "an interval that excludes 0"


def test_a_cell_in_which_nothing_is_random_has_no_interval_and_no_dot() -> None:
    table = runs().query("seed < 1 or `timing.loss` > 0.0")
    table = table.assign(random=table["timing.loss"] > 0.0)
    cells = shares_of(table, ["controller", "timing.period", "timing.loss"])
    assert cells["low"].isna().tolist() == cells["timing.loss"].eq(0.0).tolist()
    figure = cell_maps(table, (PERIODS, LOSSES), LAWS, "good", WORDS, units={})
    (marks,) = [line for line in figure.axes[2].get_lines() if line.get_marker() == "o"]
    assert 0.0 not in marks.get_ydata()
    assert [text.get_text() for text in figure.axes[0].texts] == ["1/1", "8/8", "8/8"] * 2
    assert "; one where nothing is random; " in figure.get_suptitle()
    exact, good = ({"share": 1.0, "low": low, "high": 1.0} for low in (np.nan, 0.7))
    assert interval_of_difference(good, exact) == pytest.approx((-0.3, 0.0))
    assert np.isnan(interval_of_difference(exact, {**exact, "share": 0.0})).all()


def test_only_cells_whose_system_depends_on_the_seed_are_random() -> None:
    def random(chosen: Study) -> list[bool]:
        indices = pd.DataFrame({"design_index": range(len(chosen.points))})
        table = indices.join(pd.DataFrame([chosen.points[i] for i in range(len(indices))]))
        return list(with_chance(table, chosen)["random"])

    seeds = axis("seed", 1, 2)
    assert random(study(axis("timing.loss", 0.0, 0.1), seeds, repeat="seed")) == [False, False, True, True]
    starts = axis("plant.initial.position.x", 1.0, 2.0)  # what is repeated may be taken as drawn
    assert random(study(axis("timing.loss", 0.0), starts, repeat=starts.name)) == [True, True]


def test_a_map_of_two_laws_has_a_third_panel_with_their_difference() -> None:
    figure = cell_maps(runs(), (PERIODS, LOSSES), LAWS, "good", WORDS, units={})
    titles = [panel.get_title() for panel in figure.axes[:3]]
    assert titles == ["UnifiedController", "CascadedController", "CascadedController\nminus UnifiedController"]
    (marks,) = [line for line in figure.axes[2].get_lines() if line.get_marker() == "o"]
    shown = set(zip(*(map(float, np.round(data, 6)) for data in marks.get_data())))  # type: ignore[arg-type]
    assert shown == {(10.0, 0.0), (10.0, 0.1), (20.0, 0.0), (20.0, 0.1), (20.0, 0.2)}  # 8 and 6 of 8 may be alike
    assert [text.get_text() for text in figure.axes[1].texts] == ["0/8", "3/8", "6/8", "0/8", "0/8", "0/8"]
    assert [text.get_text() for text in figure.axes[2].texts] == ["−"] * 6, "the second law is worse everywhere"
    assert figure.get_label() == (
        "8 runs a cell; Wilson intervals at 95 % up to 0.56 wide; + and −: sign of the difference; "
        "dots: Newcombe's for pairs excludes 0"
    )


def test_cells_without_a_pair_of_good_runs_are_hatched_in_the_difference_of_medians() -> None:
    figure = cell_maps(runs(), (PERIODS, LOSSES), LAWS, "position_rmse", WORDS, units={})
    (hatched,) = [one for one in figure.axes[2].collections if one.get_hatch()]
    assert len(hatched.get_paths()) == 4, "without loss, and at 20 ms"
    assert figure.legends[0].get_texts()[-1].get_text() == "no pairs"
    assert figure.axes[3].get_xlabel().endswith("\nnumber of settled runs with a value")


def test_a_map_without_room_for_how_many_of_all_runs_are_good_has_the_good_ones_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cell_texts, "MAX_LETTERS", 2 * 2 * 3)
    figure = cell_maps(runs(), (PERIODS, LOSSES), LAWS, "good", WORDS, units={})
    assert [text.get_text() for text in figure.axes[1].texts] == ["0", "3", "6", "0", "0", "0"]
    assert figure.axes[3].get_xlabel() == "share of settled runs, and their number"


def test_cells_of_uneven_values_are_equally_wide_and_named_by_them() -> None:
    uneven = axis("timing.loss", 0.0, 0.1, 0.15)
    table = runs().assign(**{"timing.loss": lambda each: each["timing.loss"].replace(0.2, 0.15)})
    panel = cell_maps(table, (uneven, PERIODS), LAWS, "good", WORDS, units={}).axes[1]
    assert panel.get_xlim() == (-0.5, 2.5)
    assert [tick.get_text() for tick in panel.get_xticklabels()] == ["0", "0.1", "0.15"]
    assert {text.get_position() for text in panel.texts} == {(i, period) for i in range(3) for period in (10.0, 20.0)}


def test_the_numbers_of_two_colour_bars_side_by_side_do_not_touch() -> None:
    style = STYLES["paper"]
    with style.applied():
        figure = cell_maps(runs(), (PERIODS, LOSSES), LAWS, "good", WORDS, units={}, style=style)
        figure.draw_without_rendering()
        shares, difference = (bar.get_xticklabels() for bar in figure.axes[3:])
        assert shares[-1].get_window_extent().x1 + style.font < difference[0].get_window_extent().x0


def test_a_map_for_a_column_of_a_journal_leaves_room_on_a_page_and_no_text_is_wider_than_it() -> None:
    style = replace(STYLES["paper"], width=COLUMNS["single"])
    with style.applied():
        figure = cell_maps(runs(), (PERIODS, LOSSES), LAWS, "good", WORDS, units={}, style=style)
        figure.draw_without_rendering()
        wide, high = figure.bbox.size
        assert high < 0.75 * style.dpi * PAGE / INCH
        texts = [*figure.findobj(Text)]
        assert all(box.x0 >= 0.0 and box.x1 <= wide for box in (text.get_window_extent() for text in texts))
        assert [*figure.axes[0].get_yticks()] == [0.0, 0.1, 0.2]


def test_one_law_alone_has_one_map_and_no_word_of_a_difference() -> None:
    alone = runs().query("controller == 'CascadedController'")
    law = axis("controller", "CascadedController")
    figure = cell_maps(alone, (PERIODS, LOSSES), law, "good", WORDS, units={})
    assert figure.get_suptitle() == "8 runs a cell; Wilson intervals at 95 % up to 0.56 wide"


def test_shares_over_one_axis_are_a_line_with_a_band_for_each_law() -> None:
    figure = cell_lines(runs(), LOSSES, LAWS, "good", WORDS, units={})
    panel = figure.axes[0]
    assert [line.get_label() for line in panel.get_lines()] == list(LAWS.values or ())
    assert len(panel.collections) == 2
    assert panel.get_ylabel() == "share of settled runs"


def test_two_laws_over_one_axis_have_their_difference_below_with_the_intervals_of_the_table() -> None:
    laws = TwoLaws("controller", *map(str, LAWS.values or ()))
    table, names = runs(), ["controller", "timing.loss"]
    for metric, average in (("good", "median"), ("position_rmse", "mean")):
        figure = cell_lines(table, LOSSES, LAWS, metric, WORDS, units={}, average=average)
        below, found = figure.axes[1], differences_in(table, names, laws, metric, average)
        (drawn,) = below.containers
        assert np.asarray(drawn[0].get_ydata()).tolist() == found["difference"].tolist()
        (bars,) = drawn[2]
        ends = [[low for (_, low), _ in bars.get_segments()], [high for _, (_, high) in bars.get_segments()]]
        np.testing.assert_allclose(ends, found[["low", "high"]].to_numpy().T)
        assert below.get_title() == "CascadedController minus UnifiedController"
    assert len(cell_lines(table, LOSSES, None, "good", WORDS, units={}).axes) == 1


def test_medians_have_their_counts_and_a_paper_has_no_titles() -> None:
    figure = cell_lines(runs(), LOSSES, LAWS, "position_rmse", WORDS, units={}, style=STYLES["paper"])
    texts = figure.axes[0].texts
    assert [text.get_text() for text in texts] == ["16", "16", "16", "3/16", "6/16"]
    heights = [text.get_position()[1] for text in texts]
    assert heights[0] == heights[2] > heights[3] == heights[4] > 0.9, "a row for each law, at the upper edge"
    assert (
        figure.axes[0].get_ylim()[1]
        > 1.1 * averages_of(runs(), ["controller", "timing.loss"], "position_rmse")["high"].max()
    )
    many = runs().assign(**{"timing.loss": range(len(runs()))})
    crowded = cell_lines(many, axis("timing.loss", *range(len(runs()))), LAWS, "position_rmse", WORDS, units={})
    assert not crowded.axes[0].texts, "there is no room"
    assert crowded.axes[0].get_ylabel().endswith("\nof the settled runs with a value")
    assert figure.axes[0].get_ylabel().endswith("\nnumber of settled runs with a value")
    assert crosses_of(figure) == [0.0], "none of the second law is good there"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [*(LAWS.values or ()), "no value", "some runs left out"]
    told = "; crosses: no settled run with a value by CascadedController at 0"
    assert str(figure.get_label()).endswith(told)
    first = next(iter(figure.axes[0].collections)).get_segments()[0]  # type: ignore[attr-defined]
    low, high = averages_of(runs(), ["controller", "timing.loss"], "position_rmse").loc[0, ["low", "high"]]
    assert first[:, 1].tolist() == [low, high], "the interval of the first place"
    assert not figure.get_suptitle()
    figure = cell_maps(runs(), (PERIODS, LOSSES), LAWS, "good", WORDS, units={}, style=STYLES["paper"])
    assert not figure.get_suptitle()
    assert str(figure.get_label()).startswith("8 runs a cell; "), "its caption"


@pytest.mark.usefixtures("blank_figures")
def test_a_repeated_study_is_drawn_as_shares_and_exported_with_them(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "study.toml"
    path.write_text(
        '[base]\nstop_time = 0.05\nvehicle = "crazyflie"\n[base.timing]\nplant_interval = 0.005\n'
        '[[axes]]\nname = "controller"\nvalues = ["UnifiedController", "CascadedController"]\n'
        '[[axes]]\nname = "timing.period"\nvalues = [0.01, 0.02]\n'
        '[[axes]]\nname = "seed"\nvalues = [1, 2]\n[design]\nrepeat = "seed"\n'
    )
    loaded = load_study(path)
    for index, law in ((0, "UnifiedController"), (4, "CascadedController")):
        alone = Scenario(vehicle=load_vehicle("crazyflie", tmp_path)).with_values({"controller.fmu": law}).as_system()
        in_study = loaded.system(index, {}).components
        for name in ("plant", "controller"):  # with the vehicle's parameters for that controller
            assert in_study[name].parameters == alone.components[name].parameters
            assert in_study[name].fmu == alone.components[name].fmu
    assert loaded.cell_names == ("controller", "timing.period")
    main("sweep", "study.toml", "--engine", "compiled")
    drawn = main("draw", "study.toml", "--out", "figures", "--format", "png").stdout.splitlines()
    assert drawn == ["figures/good.png"]
    of_store = ("--store", "results/study/study.sqlite")
    error = main("draw", "study.toml", *of_store, "--metric", "position_rmse", "--out", "medians", code=2).stderr
    assert "8 of 8 runs are bounded, neither settled nor diverged" in error
    assert "metric position_rmse: expected a settled run with a value of it" in error
    assert "8 bounded of 8 runs by 0.05 s: try the shares" in error
    assert not (tmp_path / "medians").exists(), "no empty picture"
    for command in ("export", "draw"):
        error = main(command, "study.toml", "--metric", "postion_rmse", code=2).stderr
        assert "did you mean position_rmse?" in error
    main("export", "study.toml", "--format", "csv", "--metric", "position_rmse")
    medians = pd.read_csv(tmp_path / "results/study/medians_position_rmse.csv")
    assert list(medians)[2:] == ["count", "diverged", "good", "with_value", "median", "low", "high", "unit"]
    assert set(medians["unit"]) == {"m"}
    of_medians = pd.read_csv(tmp_path / "results/study/differences_position_rmse.csv")
    assert list(of_medians)[3:] == ["pairs", "difference", "low", "high", "unit"]
    printed = main("export", "study.toml", "--format", "csv", "--metric", "diverged", "--table", "csv").stdout
    columns = "controller,timing.period,count,diverged,share,low,high"
    assert printed.splitlines()[0] == f"{columns},difference,difference_low,difference_high,minus"
    assert printed.splitlines()[-1] == "CascadedController,0.02,1,0,0.0,,,0.0,,,UnifiedController"
    of_diverged = pd.read_csv(tmp_path / "results/study/differences_diverged.csv")
    assert list(of_diverged)[3:] == ["difference", "low", "high"]
    swept = quadcosim.sweep("study.toml", engine="compiled")
    assert swept.differences("diverged")["difference"].tolist() == of_diverged["difference"].tolist()
    main("export", "study.toml", "--format", "csv", "--metric", "position_rmse", "--mean")
    means = pd.read_csv(tmp_path / "results/study/means_position_rmse.csv")
    assert swept.shares("position_rmse", mean=True)["mean"].tolist() == pytest.approx(means["mean"].tolist())
    assert means["with_value"].tolist() == means["count"].tolist(), "none is good, but all have a value"
    main("draw", "study.toml", *of_store, "--metric", "diverged", "--out", "figures", "--format", "png")
    runs = pd.read_csv(tmp_path / "results/study/runs.csv")
    guids = {
        law: {quadcosim.read_model(fmu).description.guid for fmu in (law, f"native/{law}")}
        for law in runs["controller"].unique()
    }
    assert len(guids) == runs["guid.controller"].nunique() == 2
    assert all(guid in guids[law] for law, guid in zip(runs["controller"], runs["guid.controller"]))
    shares = pd.read_csv(tmp_path / "results/study/shares.csv")
    assert list(shares) == ["controller", "timing.period", "count", "good", "share", "low", "high"]
    assert shares["count"].tolist() == [1, 1, 1, 1], "one flight, whatever its seeds"
    assert shares[["low", "high"]].isna().all(axis=None), "nothing of it is random"
    differences = pd.read_csv(tmp_path / "results/study/differences.csv")
    assert list(differences) == ["law", "minus", "timing.period", "difference", "low", "high"]
    assert differences["minus"].tolist() == ["UnifiedController"] * 2
    assert differences[["low", "high"]].isna().all(axis=None)
    old = tmp_path / "results/study/shares_diverged.csv"
    assert "older than the store" not in main("export", "study.toml", "--format", "csv").stderr
    os.utime(old, (0.0, 0.0))
    done = main("export", "study.toml", "--format", "csv", "--table", "latex")
    assert "\nshares_diverged.csv: older than the store, of fewer runs or an earlier design" in f"\n{done.stderr}"
    assert str(STORE.with_name("runs.csv")) in done.stderr
    table = done.stdout.splitlines()
    assert table[0] == r"\begin{table*}  % needs \usepackage{booktabs}"
    assert r"of 1 in each cell, with 95 \% Wilson intervals; difference: CascadedController minus" in table[2]
    assert "; settled by 0.05 s: largest position error, last third $<$ 0.05 m; " in table[2]
    assert table[5] == r"\shortstack[l]{{period} \\ {[ms]}} & UnifiedController & CascadedController & difference \\"
    assert table[7] == r"10 & 0.00 & 0.00 & 0.00 \\"
    with closing(sqlite3.connect(tmp_path / STORE)) as store, store:
        store.execute("DELETE FROM runs WHERE key = (SELECT key FROM design WHERE design_index = 7)")
    for command in ("draw", "export"):
        warned = main(command, "study.toml").stderr
        assert f"{STORE}: 7 of 8 runs; the others are missing, quadcosim sweep study.toml runs them" in warned
    assert (
        "7 of 8 runs, 0 failed, 1 missing; quadcosim sweep study.toml runs them" in main("status", "study.toml").stdout
    )
    monkeypatch.setattr(drawing, "frame", lambda store: frame(store).assign(status=None))
    assert "expected at least one finished run" in main("draw", "study.toml", code=2).stderr


def test_a_median_and_the_ends_of_its_interval_have_equal_decimals() -> None:
    assert to_digits(5.87, 5.83, 6.0, 3) == "5.87 [5.83, 6.00]"
    assert to_digits(5.0, 2.14, None, 3) == "5.00 [2.14, ?]"
    assert to_digits(0.0, -0.1, 0.25, 3) == "0.000 [-0.100, 0.250]"
    assert to_digits(2.5e7, 1e7, 3e7, 3) == "2.5e+07 [1e+07, 3e+07]"


def test_a_table_that_fits_into_a_column_of_two_is_as_wide_as_it() -> None:
    def begun(width: int) -> str:
        return next(lines(PrintedTable(caption="", heads=["a", "b"], rows=[["1", "2" * width]], numbers=[]), "latex"))

    assert begun(39).startswith(r"\begin{table} ")
    assert begun(40).startswith(r"\begin{table*} ")


def test_a_small_end_of_an_interval_keeps_its_sign() -> None:
    ends = pd.DataFrame({"share": [0.1, -1e-17], "low": [-0.0041, 0.0], "high": [0.256, 0.3]})
    assert study_table._texts(ends, "share", 2) == ["0.10 [-0.004, 0.26]", "0.00 [0.00, 0.30]"]
    assert with_interval(299 / 300, 0.98, 1.0, decimals_of(300)) == "0.997 [0.980, 1.000]"
    assert with_interval(1 / 8, -3 / 8, 5 / 8, 2) == "0.13 [-0.38, 0.63]", "halves away from 0, not to even digits"


def test_a_printed_table_has_nothing_that_tex_reads_otherwise() -> None:
    table = PrintedTable(
        caption="50 % of law_a", heads=["law_a & b", "share"], rows=[["#1", "-0.4 [-1, 2]"]], numbers=[]
    )
    text = "\n".join(lines(table, "latex"))
    assert r"\caption{50 \% of law\_a}" in text
    assert r"\shortstack[l]{{law\_a} \\ {\& b}} & share \\" in text
    assert r"\#1 & $-$0.4 [$-$1, 2] \\" in text
    assert [*lines(table, "markdown")][-2:] == ["", "50 % of law_a"]


def test_a_long_name_of_several_rows_stands_above_them_instead_of_in_a_column() -> None:
    rows = [[name, period, "0.50"] for name in ("unified law, tuned", "cascade") for period in ("10", "20")]
    text = [*lines(PrintedTable(caption="", heads=["law", "period", "share"], rows=rows, numbers=[]), "latex")]
    assert text[3:] == [
        r"\begin{tabular}{@{}ll@{}}", r"\toprule", r"period & share \\", r"\midrule",
        r"\multicolumn{2}{l}{unified law, tuned} \\", r"10 & 0.50 \\", r"20 & 0.50 \\", r"\midrule",
        r"\multicolumn{2}{l}{cascade} \\", r"10 & 0.50 \\", r"20 & 0.50 \\",
        r"\bottomrule", r"\end{tabular}", r"\end{table}",
    ]  # fmt: skip


def test_a_table_of_more_rows_than_a_page_has_is_several_with_one_number_and_its_blocks_have_all_long_names() -> None:
    rows = [["loss", law, str(i), "1.00"] for law in ("unified law, tuned", "cascade") for i in range(MAX_ROWS - 3)]
    table = PrintedTable(caption="Many", heads=["condition", "law", "run", "share"], rows=rows, numbers=[])
    text = [*lines(table, "latex")]
    assert text[1] == r"\centering\footnotesize\setlength{\tabcolsep}{4pt}", "seven columns fit on a page"
    assert [line for line in text if "caption" in line or "counter" in line or "multicolumn" in line] == [
        r"\caption{Many}", r"\multicolumn{2}{l}{loss, unified law, tuned} \\", r"\multicolumn{2}{l}{loss, cascade} \\",
        r"\addtocounter{table}{-1}", r"\caption{(continued)}", r"\multicolumn{2}{l}{loss, cascade} \\",
    ]  # fmt: skip
    assert text.count(r"run & share \\") == text.count(r"\end{table}") == 2


def test_a_study_that_cannot_be_drawn_as_cells_says_what_is_expected() -> None:
    with pytest.raises(UsageError, match=r"design.repeat = seeds: .*expected one of timing.period, seed"):
        study(PERIODS, axis("seed", 1, 2), repeat="seeds")
    with pytest.raises(UsageError, match=r"axis seed: expected each value once"):
        study(PERIODS, axis("seed", 1, 2, 1), repeat="seed")
    with pytest.raises(UsageError, match="axis controller: expected a base without a vehicle"):
        study(LAWS, base=Scenario(vehicle=load_vehicle("crazyflie", Path())))
