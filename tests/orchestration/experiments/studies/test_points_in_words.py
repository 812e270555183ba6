"""Points of a study that are named in words: those with overloads, and those whose means are in doubt."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
import pytest
from matplotlib.text import Annotation

from orchestration.command import study_table
from orchestration.experiments.studies import overloaded_points
from orchestration.experiments.studies.cell_lines import cell_lines
from orchestration.experiments.studies.cell_maps import cell_maps
from orchestration.experiments.studies.design_points import DesignPoints, Point
from orchestration.experiments.studies.infinite_means import BY_NONE, OTHERS, InfiniteMeans
from orchestration.experiments.studies.overloaded_points import overloads_in_words
from orchestration.experiments.studies.shares import PAIR, REMARKS, averages_of, remarked
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.theory.exact.mean_square import NO_EXPECTATION, NO_VARIANCE, VARIANCE
from tests.orchestration.experiments.studies.common import axis
from tests.orchestration.systems.schedule.test_overload import of

EXECUTION, PERIOD = (f"computers.cpu.tasks.other.{name}" for name in ("execution", "period"))


def tasks(executions: Sequence[float] = (0.001, 0.0025, 0.003), periods: Sequence[float] = (0.004, 0.008)) -> Study:
    axes = [
        {"name": "demand", "sets": [EXECUTION], "values": [*executions]},
        {"name": "period", "sets": [PERIOD], "values": [*periods]},
        {"name": "seed", "values": [1, 2]},
    ]
    return load_study({"name": "tasks", "base": of(2.0, 1.0), "axes": axes, "design": {"repeat": "seed"}})


@pytest.mark.parametrize(
    ("chosen", "text"),
    [
        ([(0.001, 0.004), (0.003, 0.008)], " at 2 of 6 points (demand 1 ms, period 4 ms; demand 3 ms, period 8 ms)"),
        ([(x, y) for x in (0.0025, 0.003) for y in (0.004, 0.008)], " at 4 of 6 points (demand from 2.5 ms on)"),
        ([(x, y) for x in (0.001, 0.0025) for y in (0.004, 0.008)], " at 4 of 6 points (demand up to 2.5 ms)"),
        (
            [(0.001, 0.004), (0.0025, 0.004), (0.003, 0.004)],
            " at 3 of 6 points (demand 1 ms, period 4 ms; demand 2.5 ms, period 4 ms; demand 3 ms, period 4 ms)",
        ),
        ([(x, y) for x in (0.001, 0.0025, 0.003) for y in (0.004, 0.008)], " at all 6 points"),
    ],
)
def test_points_are_named_by_the_value_from_which_on_it_is_so_or_one_by_one(chosen: list[Point], text: str) -> None:
    assert DesignPoints(tasks()).where(chosen, {"demand": "s", "period": "s"}) == text


def test_a_study_names_the_points_at_which_a_processor_is_overloaded(monkeypatch: pytest.MonkeyPatch) -> None:
    waits = "computers.cpu: overloaded, its tasks demand {} % of its time: jobs of other wait, ever more of them"
    answer = "what is computed is of the jobs that start"
    (text,) = overloads_in_words(tasks(periods=[0.004]), {}, {})
    assert text == f"at 2 of 3 points (demand from 2.5 ms on): {waits.format('up to 125')}; {answer}"
    (text,) = overloads_in_words(tasks(executions=[0.001, 0.003]), {}, {})
    assert text == f"at 1 of 4 points (demand 3 ms, period 4 ms): {waits.format('125')}; {answer}"
    assert overloads_in_words(tasks(executions=[0.001]), {}, {}) == []
    monkeypatch.setattr(overloaded_points, "MAX_POINTS", 4)
    (text,) = overloads_in_words(tasks(), {}, {})
    assert text.startswith("at least at 1 of 6 points (demand 2.5 ms, period 4 ms): ")


WHY = "not examined: plant is no linear system"


def known(remarks: Mapping[str, tuple[Point, ...]], others: str = OTHERS) -> InfiniteMeans:
    return InfiniteMeans(
        metrics=("cost", "error"), squares=("cost",), axes=("demand", "period"), remarks=remarks,
        radii={NO_EXPECTATION: 2.0, NO_VARIANCE: 1.5}, others=others,
    )  # fmt: skip


def test_each_reason_why_points_are_not_examined_has_a_line_and_points_named_nowhere_too() -> None:
    study, units = tasks(periods=[0.004]), {"demand": "s", "period": "s"}
    found = known({WHY: ((0.003, 0.004),), VARIANCE: ((0.0025, 0.004),)})
    assert [*found.notes(study, units)] == [
        "means of squares not examined at 1 of 3 points (demand 3 ms, period 4 ms): plant is no linear system",
        "variances of means not examined at 1 of 3 points (demand 2.5 ms, period 4 ms): too many fourth moments",
        "means of squares not examined at 1 of 3 points (demand 1 ms, period 4 ms): only the first 1000 points are",
    ]
    assert not [*found.warnings(study, units)]
    (wide,) = known({NO_VARIANCE: ((0.003, 0.004),)}).warnings(study, units)
    assert wide == (
        "cost: without a finite variance at 1 of 3 points (demand 3 ms, period 4 ms), so a mean over runs has no "
        "interval; the fourth-moment radius is 1.5 (quadcosim expect)"
    )
    assert InfiniteMeans.from_text(found.as_text()) == found
    assert not [*known({}, BY_NONE).notes(study, units)]


def runs() -> pd.DataFrame:
    """Eight runs at each of four loads, with a remark each."""
    remarks = {0.001: "", 0.002: NO_VARIANCE, 0.003: WHY, 0.004: NO_EXPECTATION}
    by_point = {remark: ((load, 0.004),) for load, remark in remarks.items()}
    rows: list[dict[str, Any]] = [
        {
            "demand": load, "period": 0.004, "seed": seed, PAIR: seed, "status": "done", "good": True,
            "diverged": False, "random": True, "cost": 1.0 + 0.1 * seed, "error": 1.0 + 0.1 * seed,
        }
        for load in remarks for seed in range(8)
    ]  # fmt: skip
    table = pd.DataFrame(rows).astype({"good": "boolean"})
    return table.assign(**{REMARKS: known(by_point).column(table)})


def test_a_mean_without_a_variance_has_no_interval_and_one_that_is_not_examined_has_it_with_a_sign() -> None:
    cells = averages_of(runs(), ["demand"], "cost", "mean")
    assert cells["remark"].tolist() == ["", NO_VARIANCE, WHY, NO_EXPECTATION]
    assert cells["low"].isna().tolist() == [False, True, False, True]
    texts = study_table._averages(cells, "mean", "with_value")
    assert [text.partition(" ")[2] for text in texts][::3] == ["[1.15, 1.55] (8)", "finite expectation (8)"]
    assert texts[2] == "1.35 [1.15, 1.55]? (8)"
    assert remarked(cells, "?: ") == f"1 cell without an interval: no finite variance; ?: {WHY}"
    of_roots = averages_of(runs(), ["demand"], "error", "mean")
    assert of_roots["remark"].tolist() == ["", "", WHY, NO_EXPECTATION]
    assert of_roots["low"].isna().tolist() == [False, False, False, True]


def test_what_is_not_examined_is_dotted_in_maps_and_has_a_question_mark_beside_a_line() -> None:
    look: dict[str, Any] = {"units": {}, "average": "mean"}
    demands, periods = axis("demand", 0.001, 0.002, 0.003, 0.004), axis("period", 0.004)
    figure = cell_maps(runs(), (demands, periods), None, "cost", ("good", "bad"), **look)
    hatches = {one.get_hatch(): len(one.get_paths()) for one in figure.axes[0].collections if one.get_hatch()}
    assert hatches == {"..": 1, r"\\\\": 1}
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["no finite expectation", "not examined"]
    panel = cell_lines(runs(), demands, None, "cost", ("good", "bad"), **look).axes[0]
    (mark,) = [text for text in panel.texts if isinstance(text, Annotation) and text.get_text() == "?"]
    assert math.isclose(mark.xy[0], 0.003)


def test_a_table_that_no_sweep_examined_says_so_at_all_points() -> None:
    table = runs().drop(columns=REMARKS)
    remarks = known({}, BY_NONE).column(table)
    assert {*remarks.map(lambda each: each["cost"])} == {"not examined: by no sweep yet"}
