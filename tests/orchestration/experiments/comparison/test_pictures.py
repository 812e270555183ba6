"""Pictures of a comparison, of cells made up."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from orchestration.experiments.comparison.cells import CellSummary, Median, Share
from orchestration.experiments.comparison.figures import BINS, Reach, basins, colors_of, fronts_of, limits_of, shares
from orchestration.experiments.comparison.fronts import Difference, Pair, Point
from orchestration.experiments.comparison.limits import GridLimit
from orchestration.simulation.figures.names import COLUMNS
from orchestration.simulation.figures.style import SCREEN, STYLES, Style
from orchestration.simulation.results.quantities import Quantity

SURVIVORS = {"soon": (20, 3, 0), "later": (20, 14, 0), "never": (20, 20, 20), "nor this": (20, 20, 20)}


def cells_of(controller: str, survivors: Sequence[int]) -> list[CellSummary]:
    return [
        CellSummary(
            cell=0, vehicle="v", condition="c", controller=controller, value=float(k), count=20,
            survives=Share.of(count, 20), settles=Share.of(count // 2, 20), diverged=20 - count, diverged_late=0,
            medians={},
        )
        for k, count in enumerate(survivors)
    ]  # fmt: skip


def drawn(*titles: str) -> Figure:
    found = [cell for name, survivors in SURVIVORS.items() for cell in cells_of(name, survivors)]
    return shares(dict.fromkeys(titles, found), Quantity(name="axis"), colors_of([*SURVIVORS]))


def test_controllers_differ_by_dashes_and_are_named_on_their_lines_the_earlier_they_fall_the_lower() -> None:
    (panel,) = drawn("one").axes
    assert len({line.get_linestyle() for line in panel.get_lines()}) == len(SURVIVORS)
    places = {text.get_text(): text.xy for text in panel.texts}  # type: ignore[attr-defined]
    assert list(places) == ["soon", "later", "never", "nor this"]
    assert 0.0 < places["soon"][1] < places["later"][1] < 1.0
    assert 0.0 < places["soon"][0] < 1.0 < places["later"][0] < 2.0
    assert (places["never"][0], places["nor this"][0]) == (2.0, 2.0)
    assert 1.0 < places["never"][1] < places["nor this"][1] < panel.get_ylim()[1], "lines that coincide have two names"


def test_two_controllers_have_the_differences_of_their_pairs_below_with_their_intervals() -> None:
    names, none = ["soon", "never"], Median.of([])
    cells = [cell for name in names for cell in cells_of(name, SURVIVORS[name])]
    differences = [
        {
            "survive": Difference(value=0.1 * k, low=0.1 * k - 0.2, high=0.5),
            "settle": Difference(value=0, low=0, high=0),
        }
        for k in range(3)
    ]
    pairs = [
        Pair(
            vehicle="v", condition="c", value=float(k), controller="never", against="soon", both=0, only_it=0,
            only_other=0, neither=0, settles=0, error=none, effort=none, shares=each,
        )
        for k, each in enumerate(differences)
    ]  # fmt: skip
    below = shares({"": cells}, Quantity(name="axis"), colors_of(names), pairs=pairs).axes[1]
    drawn, (bars,) = below.containers[0][0], below.containers[0][2]
    assert np.asarray(drawn.get_xydata()).tolist() == [[k, 0.1 * k] for k in range(3)]
    np.testing.assert_allclose([each[:, 1] for each in bars.get_segments()], [[0.1 * k - 0.2, 0.5] for k in range(3)])
    assert below.get_title() == "never minus soon, from the same starts"


def test_several_panels_have_their_controllers_in_one_legend() -> None:
    figure = drawn("one", "other")
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [*SURVIVORS, "survive", "settle"]
    assert not any(panel.texts for panel in figure.axes)


def test_cells_of_a_basin_have_their_numbers_of_starts_and_its_line_is_told() -> None:
    counts = np.array([[[2, 2], [2 * (size < 4), 2]] for size in range(BINS)])
    counts[0] = 0
    figure = basins({"one": ([0.01, 0.02], counts)}, Quantity(name="period", unit="ms", factor=1e3), "settle", "")
    panel = figure.axes[0]
    texts = {text.get_position(): text.get_text() for text in panel.texts}
    assert len(texts) == 2 * (BINS - 1)
    assert (texts[10.0, 0.9375], texts[20.0, 0.9375], texts[20.0, 0.1875]) == ("2/2", "0/2", "2/2")
    (line,) = [one for one in panel.collections if isinstance(one, LineCollection)]
    assert np.concatenate(line.get_segments())[:, 1].min() == 0.5
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["half of the starts settle", "no starts"]
    assert figure.get_suptitle() == "0 to 2 starts a cell"
    values = [*np.arange(1.0, 41.0)]
    many = basins({"one": (values, np.ones((BINS, 40, 2), int))}, Quantity(name="period"), "settle", "")
    assert not many.axes[0].texts, "there is no room"
    assert not many.legends


@pytest.mark.parametrize("style", [SCREEN, replace(STYLES["paper"], width=COLUMNS["single"])], ids=["screen", "single"])
def test_no_label_of_the_limits_is_cut_off_and_one_before_the_first_value_is_below(style: Style) -> None:
    fates = [
        GridLimit(vehicle="v", condition="c", controller="a", fate=fate, share=share, value=value, low=value, high=None,
                  bandwidth=20.0)
        for fate in ("survive", "settle") for share, value in (("half", 0.1), ("nine in ten", 0.0))
    ]  # fmt: skip
    reaches = [Reach(name="cascade, no rate derivative", limits=fates, last=0.8)]
    with style.applied():
        figure = limits_of(reaches, Quantity(name="period", unit="ms", factor=1e3), True, style)
        figure.draw_without_rendering()
    for panel in figure.axes:
        label = panel.xaxis.label.get_window_extent()
        assert (label.x0, label.x1) == (max(label.x0, 0.0), min(label.x1, figure.bbox.width)), panel.get_xlabel()
        arrows = [patch for text in panel.texts if (patch := getattr(text, "arrow_patch", None)) is not None]
        assert arrows
        assert all(arrow.get_window_extent().x1 < figure.bbox.width for arrow in arrows)
        (below,) = (text.get_window_extent() for text in panel.texts if text.get_text() == "below")
        bars = panel.transData.transform((0.0, 0.0))[0]
        assert panel.bbox.x0 < below.x0 < below.x1 < bars, "beside the bar of its interval"
        marks = [line for line in panel.get_lines() if line.get_marker() == "o" and line.get_visible()]
        assert [np.asarray(line.get_xdata()).tolist() == [0.0] for line in marks] == [False]


def test_a_point_far_beyond_the_others_is_told_in_words_and_those_left_out_are_counted() -> None:
    points = [
        Point(
            vehicle="v", condition="c", value=value, controller=name, starts=9, error=at(error), effort=at(effort),
            on_front=name == "good",
        )
        for value, name, effort, error in (
            (0.01, "good", 100.0, 0.1), (0.01, "fair", 200.0, 0.2), (0.01, "poor", 300.0, 0.2),
            (0.02, "good", 100.0, 0.1), (0.02, "fair", 200.0, 0.2), (0.02, "wild", 1.2e6, 5.7),
            (0.03, "good", 100.0, 0.1),
        )
    ]  # fmt: skip
    colors = colors_of(["good", "fair", "poor", "wild"])
    figure = fronts_of(points, (0.01, 0.02), Quantity(name="period", unit="s"), ("effort", "error"), colors, "body")
    calm, wild = figure.axes
    assert not calm.texts
    assert [text.get_text() for text in wild.texts] == ["1 of 3 beyond these axes:\nwild,\nat 1,200,000, 5.7"]
    assert max(wild.get_ylim()) < 1.0
    assert max(float(np.max(np.asarray(line.get_ydata()))) for line in wild.get_lines()) < 0.75 * max(
        wild.get_ylim()
    ), "room for the words"
    assert calm.get_title().endswith("9 starts,\n3 of 4 controllers")
    assert "2 of 3 values" in figure.get_suptitle()
    narrow = replace(STYLES["paper"], width=COLUMNS["single"])
    axis = Quantity(name="period", unit="s")
    figure = fronts_of(points, (0.01, 0.02), axis, ("effort", "error"), colors, "body", narrow)
    assert (figure.get_supxlabel(), figure.axes[-1].get_xlabel()) == ("", "effort"), "the legend is below it"


def at(value: float) -> Median:
    return Median(value=value, low=0.9 * value, high=1.1 * value)
