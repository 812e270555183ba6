"""Lines of long runs have few points, and the picture of all rows."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orchestration.simulation.figures import lines
from orchestration.simulation.figures.lines import label_time, name_runs, set_span, visible_rows
from orchestration.simulation.figures.style import SCREEN

COLUMNS, ROWS = 100, 20_000


@pytest.mark.parametrize("holes", [False, True])
def test_a_column_of_pixels_has_the_first_last_lowest_and_highest_of_its_rows_and_each_gap(holes: bool) -> None:
    generator = np.random.default_rng(1)
    t, values = np.sort(generator.random(ROWS)), generator.standard_normal(ROWS).round(2)
    if holes:
        values[(t > 0.3) & (t < 0.36) | (t > 0.5005) & (t < 0.501)] = np.nan
    shown = visible_rows(t, values, COLUMNS)
    assert len(shown) < 5 * COLUMNS
    place = np.floor((t - t[0]) / (t[-1] - t[0]) * COLUMNS)
    for one in np.unique(place):
        rows, kept = np.flatnonzero(place == one), shown[place[shown] == one]
        assert (kept[0], kept[-1]) == (rows[0], rows[-1])
        of_all, of_kept = ([np.fmin.reduce(values[x]), np.fmax.reduce(values[x])] for x in (rows, kept))
        assert np.array_equal(of_all, of_kept, equal_nan=True)
    assert (np.isnan(values[shown]) != np.isnan(values[np.clip(shown - 1, 0, None)])).sum() == 4 * holes


def test_a_short_line_has_all_its_rows() -> None:
    assert visible_rows(np.arange(9.0), np.zeros(9), 3).tolist() == [*range(9)]


@pytest.mark.parametrize(
    ("last", "title", "numbers"),
    [(2.0, "time [s]", ["0", "2"]), (0.02, "time [ms]", ["0", "20"]), (5e-5, "time [µs]", ["0", "50"])],
)
def test_a_short_run_has_its_times_in_small_units(last: float, title: str, numbers: list[str]) -> None:
    axes = SCREEN.figure(20.0).add_subplot()
    set_span(axes, (0.0, last))
    label_time(axes)
    axes.set_xticks([0.0, last])
    assert axes.get_xlabel() == title
    assert [label.get_text() for label in axes.get_xticklabels()] == numbers


def test_the_title_of_several_runs_is_that_of_their_legend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lines, "title", lambda runs: "common")
    runs: list[Any] = [SimpleNamespace(name=name, color="k", dashes="-") for name in ("one", "two")]
    for shown, above, legends in ((runs[:1], "common", []), (runs, "", ["common"])):
        figure = SCREEN.figure(20.0)
        name_runs(figure, shown, SCREEN)
        assert figure.get_suptitle() == above
        assert [legend.get_title().get_text() for legend in figure.legends] == legends
