"""Figures of studies: written, not empty, and showing the runs."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import matplotlib.figure
import numpy as np
import pandas as pd
import pytest
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from orchestration.components.fmi.foreign_calls import LostError
from orchestration.experiments.limits import figure as limit_figure
from orchestration.experiments.limits.evaluation import Evaluation
from orchestration.experiments.limits.figure import draw_limit, spectral_radius
from orchestration.experiments.limits.limit_result import Limit
from orchestration.experiments.report.of_study import axes_of, read
from orchestration.experiments.studies import figures
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.drawing import draw_study, study_figures
from orchestration.experiments.studies.figures import heat_map
from orchestration.experiments.studies.sensitivity import Index
from orchestration.experiments.studies.store import open_for_writing, store_path
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.registry import Registry
from orchestration.foundation.basics.statistics import wilson
from orchestration.simulation.figures import cells
from orchestration.simulation.figures.style import SCREEN
from quadcosim import UsageError
from tests.orchestration.experiments.studies.common import OBJECTIVES, add, axis, row, short, study, sweep
from tests.pictures import expect_picture

PERIODS = axis("timing.period", 0.01, 0.02, 0.03, 0.04)
WORDS = ("settled", "bounded")
PNG = dataclasses.replace(SCREEN, formats=("png",), dpi=80.0)
DELAYS = axis("timing.delay", 0.0, 0.005, 0.01)


def invented(folder: Path, chosen: Study) -> Study:
    """Fills a store with runs that are good below an edge, fail at one point and diverge elsewhere."""
    names = [each.name for each in chosen.axes]
    rows = []
    for index, point in enumerate(chosen.points):
        size = sum(float(value) for value in point.values() if isinstance(value, (int, float)))
        outcome = "diverged" if size > 0.2 else "settled" if 0.5 * size < 0.05 else "bounded"
        metrics = {
            "outcome": outcome,
            "good": outcome == "settled",
            "ultimate_bound": 0.5 * size,
            "position_rmse": 0.1 + size,
        }
        failed = index == 2
        rows.append(row(index, settings=point, metrics=None if failed else metrics, message="no" if failed else None))
    with open_for_writing(store_path(chosen.name, folder), OBJECTIVES) as store:
        about: dict[str, Any] = {"axes": names, "grid": None, "guids": {}, "versions": {}}
        store.describe({name: json.dumps(value) for name, value in about.items()})
        add(store, rows)
    return chosen


def table(number: int = 5) -> pd.DataFrame:
    """A study of one axis whose last run is not good."""
    bounds = [0.01 * (i + 1) for i in range(number)]
    return pd.DataFrame(
        {
            "timing.period": [0.01 * (i + 1) for i in reversed(range(number))],
            "status": "done",
            "outcome": ["settled" if bound < 0.05 else "bounded" for bound in bounds[::-1]],
            "ultimate_bound": bounds[::-1],
        }
    )


def judged(runs: pd.DataFrame) -> pd.DataFrame:
    """Adds the metrics that follow from the outcome."""
    return runs.assign(good=(runs["outcome"] == "settled").astype("boolean").where(runs["outcome"].notna()))


def lines_of(figure: matplotlib.figure.Figure) -> list[Any]:
    return list(figure.axes[0].get_lines())


# -- of a store -------------------------------------------------------------------------------------------


def test_one_axis_is_drawn_as_a_line(tmp_path: Path) -> None:
    (picture,) = draw_study(invented(tmp_path, study(PERIODS)), tmp_path, "ultimate_bound", PNG)
    assert picture == tmp_path / "ultimate_bound.png"
    expect_picture(picture)


def test_two_axes_are_drawn_as_lines_and_as_a_map(tmp_path: Path) -> None:
    wide = axis("timing.period", 0.01, 0.05, 0.1, 0.2)  # has runs that fly and runs that do not
    pictures = draw_study(invented(tmp_path, study(wide, DELAYS)), tmp_path, "position_rmse", PNG)
    assert [picture.name for picture in pictures] == ["position_rmse.png", "position_rmse_map.png"]
    for picture in pictures:
        expect_picture(picture)


def test_sampled_axes_are_drawn_without_a_map(tmp_path: Path) -> None:
    sampled = Axis(name="mass", targets=("plant.mass",), low=0.01, high=0.05)
    chosen = invented(tmp_path, study(sampled, method="random", samples=6))
    (picture,) = draw_study(chosen, tmp_path, "ultimate_bound", PNG)
    expect_picture(picture)


def test_more_axes_are_drawn_as_dots_over_each_and_three_of_a_grid_as_a_map_for_each_value_of_the_last(
    tmp_path: Path,
) -> None:
    masses = axis("plant.mass", 0.02, 0.01, 0.05, 0.07)
    chosen = invented(tmp_path, study(PERIODS, DELAYS, masses))
    drawn, _ = study_figures(chosen, store_path(chosen.name, tmp_path), "ultimate_bound")
    assert [*drawn] == ["ultimate_bound", "ultimate_bound_map"]
    panels = drawn["ultimate_bound_map"].axes
    assert [panel.get_title() for panel in panels[:4]] == [f"mass {mass} kg" for mass in (0.01, 0.02, 0.05, 0.07)]
    assert panels[4].get_xlabel().endswith(",\nwhere settled"), "no median of one run"
    heaviest = panels[3].collections[0].get_array()  # a row for each delay
    assert heaviest is not None
    assert np.ma.compressed(heaviest).tolist() == pytest.approx([0.04, 0.045, 0.0425, 0.0475, 0.045])
    (only,) = study_figures(chosen, store_path(chosen.name, tmp_path), "good")[0]
    assert only == "good_map"
    many = invented(tmp_path, study(PERIODS, DELAYS, axis("plant.mass", *np.arange(1.0, 11.0))))
    assert [*study_figures(many, store_path(many.name, tmp_path), "ultimate_bound")[0]] == ["ultimate_bound"]
    with pytest.raises(UsageError, match="a third of numbers \\(up to 9, a map for each: it is the one listed last"):
        study_figures(many, store_path(many.name, tmp_path), "good")
    names = [path.name for path in draw_study(many, tmp_path, "good", PNG, at=["plant.mass=2"])]
    assert names == ["good_map_plant.mass=2.png"]
    figure = study_figures(many, store_path(many.name, tmp_path), "good", at={"plant.mass": 2.0})[0]["good_map"]
    assert figure.get_suptitle().endswith("mass 2 kg")
    assert len(figure.axes) == 2, "one map and its bar"
    for wrong, expected in (("mass=1", "NAME=VALUE, once for each NAME of "), ("plant.mass=2.5", r"one of 1\.0, 2\.0")):
        with pytest.raises(UsageError, match=f"{wrong}: expected {expected}"):
            draw_study(many, tmp_path, "good", PNG, at=[wrong])


def test_an_unknown_metric_is_reported_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="metric beauty: expected one of good, horizon, position_rmse"):
        draw_study(invented(tmp_path, study(PERIODS)), tmp_path, "beauty")


@pytest.mark.parametrize(
    "axes",
    [(axis("timing.order", "jacobi", "gauss-seidel", "jacobi"),),
     (PERIODS, axis("timing.order", "jacobi", "gauss-seidel"), axis("controller.use_reference_inputs", True, False))],
)  # fmt: skip
def test_axes_without_a_figure_are_refused(tmp_path: Path, axes: tuple[Axis, ...]) -> None:
    with pytest.raises(
        UsageError, match="study: expected one or two axes of numbers with values, at most one of names"
    ):
        draw_study(invented(tmp_path, study(*axes)), tmp_path, "ultimate_bound")


def test_a_study_that_was_never_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="there is no such file"):
        draw_study(study(PERIODS), tmp_path, "ultimate_bound")


# -- what is drawn ----------------------------------------------------------------------------------------


def test_good_runs_have_settled() -> None:
    runs = table(4)
    runs["outcome"] = ["settled", "bounded", "diverged", None]  # the last of a run that failed
    assert figures.good_runs(judged(runs)).tolist() == [True, False, False, False]


def test_a_line_connects_the_good_runs_in_order_and_the_others_are_crosses() -> None:
    line, crosses, *_ = lines_of(
        figures.lines(judged(table()), (axis("timing.period", 0.01),), "ultimate_bound", WORDS, units={})
    )
    assert line.get_xdata().tolist() == pytest.approx([10.0, 20.0, 30.0, 40.0, 50.0])
    assert np.isnan(line.get_ydata()).tolist() == [False] * 4 + [True]
    assert crosses.get_xdata().tolist() == pytest.approx([50.0])
    assert crosses.get_marker() == "x"


def test_there_is_a_line_for_each_value_of_the_second_axis() -> None:
    runs = pd.concat([table().assign(delay=delay) for delay in (0.0, 0.01, 0.02)])
    second = axis("timing.delay", 0.0, 0.01, 0.02)
    runs = runs.rename(columns={"delay": "timing.delay"})
    figure = figures.lines(judged(runs), (axis("timing.period", 0.01), second), "ultimate_bound", WORDS, units={})
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][:3] == ["0", "10", "20"]
    assert legend.get_title().get_text() == "delay [ms]"


def test_axes_have_display_names_and_units() -> None:
    for target, label in (("timing.period", "period [ms]"), ("plant.mass", "mass [kg]"),
                          ("timing.measurement_loss", "loss of measurements")):  # fmt: skip
        runs = table().rename(columns={"timing.period": target})
        figure = figures.lines(judged(runs), (axis(target, 0.01),), "ultimate_bound", WORDS, units={})
        assert figure.axes[0].get_xlabel() == label


def test_a_metric_has_its_unit_wherever_it_is_drawn() -> None:
    runs = judged(pd.concat([table().assign(**{"timing.delay": delay}) for delay in (0.0, 0.01)]))
    axes = (axis("timing.period", 0.01), axis("timing.delay", 0.01))
    drawn = figures.lines(runs, axes[:1], "ultimate_bound", WORDS, units={"ultimate_bound": "m"})
    assert drawn.axes[0].get_ylabel() == "largest position error, last third [m]"
    assert heat_map(runs, axes, "ultimate_bound", WORDS, units={"ultimate_bound": "m"}).axes[1].get_ylabel() == (
        f"largest position error, last third [m], where {WORDS[0]}"
    )
    scattered = figures.scatter(runs, axes, "ultimate_bound", WORDS, units={"ultimate_bound": "m"})
    assert scattered.get_supylabel() == "largest position error, last third [m]"


def test_diverged_runs_are_marked_in_a_row_for_each_line_above_all_values() -> None:
    runs = pd.concat([table().assign(**{"timing.delay": delay}) for delay in (0.0, 0.01)])
    runs.loc[runs["timing.period"] > 0.03, ["outcome", "ultimate_bound"]] = ["diverged", np.nan]
    axes = (axis("timing.period", 0.01), axis("timing.delay", 0.01))
    figure = figures.lines(judged(runs), axes, "ultimate_bound", WORDS, units={})
    panel = figure.axes[0]
    rows = [line for line in lines_of(figure) if line.get_marker() == "^" and len(line.get_xdata())]
    heights = [
        set(panel.transAxes.inverted().transform(line.get_path().transformed(line.get_transform()).vertices)[:, 1])
        for line in rows
    ]
    highest = panel.transAxes.inverted().transform(panel.transData.transform((30.0, 0.03)))[1]
    assert [len(one) for one in heights] == [1, 1]
    assert highest < min(heights[1]) < min(heights[0]) < 1.0


def test_without_a_metric_the_first_objective_that_varies_is_drawn(tmp_path: Path) -> None:
    (picture,) = draw_study(invented(tmp_path, study(PERIODS)), tmp_path, style=PNG)
    assert picture.name == "position_rmse.png"


def test_a_map_has_a_cell_for_each_run_and_the_boundary_of_good_runs() -> None:
    runs = pd.concat([table().assign(**{"timing.delay": delay}) for delay in (0.0, 0.01, 0.02)])
    figure = heat_map(
        judged(runs), (axis("timing.period", 0.01), axis("timing.delay", 0.01)), "ultimate_bound", WORDS, units={}
    )
    _, mesh, boundary = figure.axes[0].collections
    values: Any = np.ma.filled(np.ma.asarray(mesh.get_array()), np.nan).reshape(3, 5)
    assert np.isnan(values).tolist() == [[False] * 4 + [True]] * 3
    assert values[0, :4] == pytest.approx([0.01, 0.02, 0.03, 0.04])
    crossings = np.concatenate([path.vertices for path in boundary.get_paths()])
    assert crossings[:, 0] == pytest.approx(45.0)
    assert [*figure.axes[0].get_yticks()] == [0.0, 10.0, 20.0]  # none below zero, at the edge of the lowest cells


def test_cells_of_a_map_have_their_edges_half_way_between_values_in_the_scale_of_the_axis() -> None:
    assert cells.edges([1.0, 2.0, 4.0]).tolist() == [0.5, 1.5, 3.0, 5.0]
    assert cells.edges([1.0, 10.0, 100.0], logarithmic=True) == pytest.approx([10**-0.5, 10**0.5, 10**1.5, 10**2.5])
    assert cells.edges([3.0]).tolist() == [2.5, 3.5]


def test_the_limit_of_a_map_runs_along_edges_of_cells_and_not_beside_missing_ones() -> None:
    panel = matplotlib.figure.Figure().add_subplot()
    good = np.array([[1.0, 1.0, 0.0], [1.0, np.nan, 0.0]])
    drawn = cells.limit(panel, np.arange(4.0), np.arange(3.0), good)
    assert drawn is not None
    assert [np.asarray(path.vertices).tolist() for path in drawn.get_paths()] == [[[2.0, 0.0], [2.0, 1.0]]]
    cells.hatch(panel, np.arange(4.0), np.arange(3.0), np.isnan(good))
    (missing,) = [one for one in panel.collections if one.get_hatch()]
    assert missing.get_paths()[0].get_extents().bounds == (1.0, 1.0, 1.0, 1.0)


def test_a_map_distinguishes_bounded_from_diverged_and_shows_the_horizon() -> None:
    runs = pd.concat([table().assign(**{"timing.delay": delay}) for delay in (0.0, 0.01)])
    runs["outcome"] = ["settled", "bounded", "diverged", None, "settled"] * 2  # periods from 0.05 down
    runs.loc[runs["outcome"] == "diverged", "ultimate_bound"] = np.nan
    runs["horizon"] = 30.0
    figure = heat_map(
        judged(runs), (axis("timing.period", 0.01), axis("timing.delay", 0.01)), "ultimate_bound", WORDS, units={}
    )
    fell = np.ma.filled(np.ma.asarray(figure.axes[0].collections[0].get_array()), np.nan).reshape(2, 5)[0]
    assert fell == pytest.approx([np.nan, np.nan, 1.0, 0.0, np.nan], nan_ok=True)
    assert told_of(figure) == ["settled", "bounded", "diverged", "missing", "limit of what is settled, by 30 s"]


def test_a_map_without_a_good_run_has_the_metric_of_those_that_have_not_diverged() -> None:
    runs = pd.concat([table().assign(**{"timing.delay": delay}) for delay in (0.0, 0.01)])
    runs["outcome"] = ["bounded", "bounded", "diverged", "bounded", "bounded"] * 2
    axes = (axis("timing.period", 0.01), axis("timing.delay", 0.01))
    figure = heat_map(judged(runs), axes, "ultimate_bound", WORDS, units={"ultimate_bound": "m"})
    assert figure.axes[1].get_ylabel() == "largest position error, last third [m], where bounded"
    assert told_of(figure) == ["bounded", "diverged"]


def told_of(figure: matplotlib.figure.Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_legend_lists_the_outcomes_that_occur() -> None:
    runs = judged(pd.concat([table(4).assign(**{"timing.delay": delay}) for delay in (0.0, 0.01)]))
    axes = (axis("timing.period", 0.01), axis("timing.delay", 0.01))
    assert told_of(heat_map(runs, axes, "ultimate_bound", WORDS, units={})) == ["settled"]
    assert told_of(figures.lines(runs, axes[:1], "ultimate_bound", WORDS, units={})) == ["settled"]
    fell = judged(runs.assign(outcome="diverged", ultimate_bound=np.nan))
    assert told_of(heat_map(fell, axes, "ultimate_bound", WORDS, units={})) == ["diverged"]
    assert "8 runs: 8 settled (dots)\n" in figures.scatter(runs, axes, "ultimate_bound", WORDS, units={}).get_suptitle()


def test_a_line_marks_diverged_runs_without_a_value() -> None:
    runs = table()
    runs["outcome"] = ["diverged", *runs["outcome"][1:]]
    runs.loc[runs["outcome"] == "diverged", "ultimate_bound"] = np.nan
    *_, down = lines_of(figures.lines(judged(runs), (axis("timing.period", 0.01),), "ultimate_bound", WORDS, units={}))
    assert (down.get_marker(), down.get_xdata().tolist()) == ("^", pytest.approx([50.0]))


def test_a_map_of_good_runs_has_no_boundary() -> None:
    runs = pd.concat([table(4).assign(**{"timing.delay": delay}) for delay in (0.0, 0.01)])
    figure = heat_map(
        judged(runs), (axis("timing.period", 0.01), axis("timing.delay", 0.01)), "ultimate_bound", WORDS, units={}
    )
    assert len(figure.axes[0].collections) == 2, "what fell, and what flies"


@pytest.mark.parametrize(("local", "large", "marks"), [(0.08, 0.05, 2), (None, 0.05, 1), (0.08, None, 1)])
def test_the_spectral_radius_is_drawn_with_the_known_limits(
    tmp_path: Path, local: float | None, large: float | None, marks: int
) -> None:
    periods = np.linspace(0.001, 0.1, 50)
    figure = spectral_radius(limit("period", local_limit=local, large_signal_limit=large), periods, 10.0 * periods)
    curve, unit, *limits = lines_of(figure)
    assert curve.get_xdata() == pytest.approx(periods * 1e3)
    assert unit.get_ydata() == [1.0, 1.0]
    assert [line.get_xdata()[0] for line in limits] == [1e3 * limit for limit in (local, large) if limit is not None]
    assert len(limits) == marks
    expect_picture(*figures.save(lambda _: figure, tmp_path / "new" / "radius", PNG))


def limit(of: str, **others: Any) -> Limit:
    tried = tuple(
        Evaluation(
            value=value, outcome="settled", divergence_time=None, flew=int(value < 0.06), runs=1, share=None,
            measured=value if value < 0.09 else None,
        )
        for value in (0.02, 0.04, 0.05, 0.06, 0.08, 0.1)
    )  # fmt: skip
    known = Limit(
        of=of, unit="s", judged="ultimate_bound", judged_unit="m", local_limit=0.08, local_limit_outside=0.08,
        large_signal_limit=0.05, refuted_limit=None, horizon=30.0, tolerance=0.001, scan=0.005, confidence=None,
        seeds=1, flies_above=(), continuous=None, tried=tried, notes=(),
    )  # fmt: skip
    return dataclasses.replace(known, **others)


@pytest.mark.parametrize("of", ["period", "delay"])
def test_a_limit_is_drawn_with_the_radius_that_crosses_one_there(tmp_path: Path, of: str) -> None:
    pictures = draw_limit(short(), limit(of), tmp_path, PNG)
    assert pictures == [tmp_path / f"limit_{of}.png", tmp_path / f"spectral_radius_{of}.png"]
    for picture in pictures:
        expect_picture(picture)


def test_a_limit_without_linear_theory_is_drawn_without_the_radius(tmp_path: Path) -> None:
    assert draw_limit(short(), limit("timing.loss"), tmp_path, PNG) == [tmp_path / "limit_timing_loss.png"]


def test_the_mean_square_limit_is_a_line_of_the_figure() -> None:
    (axes,) = limit_figure.limit_figure(limit("timing.loss", mean_square_limit=0.07)).axes
    (line,) = (line for line in axes.lines if str(line.get_label()).startswith("mean-square limit, by theory"))
    assert np.asarray(line.get_xdata()) == pytest.approx([70.0, 70.0])


def test_a_limit_that_is_scanned_by_equal_factors_has_a_logarithmic_axis() -> None:
    (axes,) = limit_figure.limit_figure(limit("timing.loss", geometric=True)).axes
    assert axes.get_xscale() == "log"
    assert [text.get_text() for text in axes.get_xticklabels()][1:-1] == ["20", "40", "60", "80", "100"]


def test_where_no_loop_is_known_no_process_is_started_for_its_radius(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limit_figure, "LOOPS", Registry[Any]())
    monkeypatch.setattr(limit_figure, "isolated_call", lambda *_: pytest.fail("it computes"))
    assert draw_limit(short(), limit("period"), tmp_path, PNG) == [tmp_path / "limit_period.png"]


def test_a_limit_whose_fmus_lose_their_process_is_drawn_without_the_radius(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lost(*_: Any) -> None:
        raise LostError("the process of the FMUs ended")

    monkeypatch.setattr(limit_figure, "isolated_call", lost)
    assert draw_limit(short(), limit("period"), tmp_path, PNG) == [tmp_path / "limit_period.png"]


def xs(line: Line2D) -> list[float]:
    return [float(x) for x in np.asarray(line.get_xdata())]


def ys(line: Line2D) -> list[float]:
    return [float(y) for y in np.asarray(line.get_ydata())]


def test_a_limit_shows_each_evaluated_value_with_its_measurement() -> None:
    figure = limit_figure.limit_figure(limit("components.pilot.sampling.period", judged_bound=0.06))
    (axes,) = figure.axes
    marks = {line.get_label(): line for line in axes.get_lines()}
    assert xs(marks["good"]) == pytest.approx([20.0, 40.0, 50.0])
    assert ys(marks["not good"]) == pytest.approx([0.06, 0.08])
    assert xs(marks["diverged"]) == pytest.approx([100.0])
    assert xs(marks["measured limit  50 ms"])[0] == pytest.approx(50.0)
    assert xs(marks["local limit, by theory  80 ms"])[0] == pytest.approx(80.0)
    assert ys(marks["the criterion's bound, 0.06 m"])[0] == 0.06
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("period of pilot [ms]", "largest position error, last third [m]")
    assert axes.get_title(loc="left") == "Good up to 50 ms: period of pilot, in runs of 30 s"


def test_a_limit_of_many_seeds_shows_their_share_with_its_interval() -> None:
    tried = tuple(
        Evaluation(value=v, outcome="settled", divergence_time=None, flew=n, runs=29, share=wilson(n, 29, 0.95))
        for v, n in ((0.1, 29), (0.2, 20))
    )
    stopped = Evaluation(value=0.15, outcome="bounded", divergence_time=None, flew=10, runs=11, share=None)
    tried = (tried[0], stopped, tried[1])
    figure = limit_figure.limit_figure(limit("loss", unit=None, confidence=0.95, seeds=29, tried=tried))
    (axes,) = figure.axes
    marks = {line.get_label(): line for line in axes.get_lines()}
    assert ys(marks["good"]) == [1.0]
    assert ys(marks["not good"]) == pytest.approx([20 / 29])
    assert axes.get_ylabel() == "share of 29 seeds that are good"


@pytest.mark.parametrize(("longest", "title"), [(0.9, "period [ms]"), (1.5, "period [s]")])
def test_a_limit_over_times_is_in_milliseconds_where_all_are_below_a_second(longest: float, title: str) -> None:
    tried = tuple(dataclasses.replace(one, value=longest * one.value / 0.1) for one in limit("period").tried)
    figure = limit_figure.limit_figure(limit("period", tried=tried))
    assert figure.axes[0].get_xlabel() == title
    assert xs(figure.axes[0].get_lines()[1])[-1] == pytest.approx(longest * 0.8 * (1e3 if "ms" in title else 1.0))


def test_the_axes_of_a_study_have_the_units_of_its_store(tmp_path: Path) -> None:
    inertia = Axis(name="inertia xx", targets=("plant.inertia.xx", "controller.inertia.xx"), values=(0.5, 1.0))
    chosen = study(inertia, axis("timing.period", 0.01, 0.02))
    sweep(chosen, out=tmp_path, progress=None, announce=None)
    made, _ = study_figures(chosen, store_path(chosen.name, tmp_path), "position_rmse")
    lines, cells_drawn = made["position_rmse"], made["position_rmse_map"]
    assert (lines.axes[0].get_xlabel(), lines.legends[0].get_title().get_text()) == (
        "inertia xx [kg·m²]", "period [ms]",
    )  # fmt: skip
    assert (cells_drawn.axes[0].get_xlabel(), cells_drawn.axes[0].get_ylabel()) == (
        "inertia xx [kg·m²]", "period [ms]",
    )  # fmt: skip
    for known in (chosen, None):
        found = {way.name: way.quantity for way in axes_of(read(store_path(chosen.name, tmp_path)), known)}
        assert found["inertia xx"].title == "inertia xx [kg·m²]"
        assert (found["timing.period"].unit, found["timing.period"].factor) == ("ms", 1e3)


def test_a_range_without_a_limit_is_stated_in_the_title() -> None:
    good = tuple(one for one in limit("delay").tried if one.flew)
    figure = limit_figure.limit_figure(limit("delay", tried=good, large_signal_limit=None))
    assert figure.axes[0].get_title(loc="left") == "delay: good throughout, in runs of 30 s"


def test_dots_of_many_axes_distinguish_good_runs() -> None:
    runs = table().assign(**{"plant.mass": 1.0, "timing.delay": 0.0})
    axes = (axis("timing.period", 0.01), axis("plant.mass", 1), axis("timing.delay", 0.01))
    figure = figures.scatter(judged(runs), axes, "ultimate_bound", WORDS, units={})
    for panel in figure.axes[:3]:
        dots, crosses, *_ = panel.get_lines()
        assert (np.size(dots.get_xdata()), np.size(crosses.get_xdata())) == (4, 1)
    assert not figure.axes[3].get_visible()
    assert "share that is settled 80%, 95 % interval 38% to 96%" in figure.get_suptitle()


def test_sensitivity_is_drawn_as_bars_with_their_confidence(tmp_path: Path) -> None:
    indices = [
        Index(axis=name, kind=kind, value=value, confidence=0.1)
        for kind, values in (("first", (0.3, 0.4)), ("total", (0.5, 0.6)))
        for name, value in zip(("a", "b"), values, strict=True)
    ]
    figure = figures.sensitivity_bars(indices, "position_rmse")
    panel = figure.axes[0]
    assert [bar.get_width() for bar in panel.patches if isinstance(bar, Rectangle)] == [0.3, 0.4, 0.5, 0.6]
    assert [label.get_text() for label in panel.get_yticklabels()] == ["a", "b"]
    expect_picture(*figures.save(lambda _: figure, tmp_path / "bars", PNG))


def test_figures_are_the_same_bytes_each_time(tmp_path: Path) -> None:
    chosen = invented(tmp_path, study(PERIODS))
    pictures = [draw_study(chosen, tmp_path, "ultimate_bound", PNG)[0].read_bytes() for _ in range(2)]
    assert pictures[0] == pictures[1]
