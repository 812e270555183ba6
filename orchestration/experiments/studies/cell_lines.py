"""Lines over one axis of cells: shares of good runs, medians or means, with their intervals."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.experiments.studies.axes import SCALES, Axis, name_of, names_of, quantity_of
from orchestration.experiments.studies.cell_texts import (
    groups_along,
    letters_of,
    names_in,
    numbers_averaged,
    repetitions,
    title_of,
    two_laws,
)
from orchestration.experiments.studies.figures import make_room, mark_edge
from orchestration.experiments.studies.shares import (
    GOOD,
    INTERVALS,
    MEAN,
    MEDIAN,
    REMARK,
    WITH_VALUE,
    averages_of,
    differences_in,
    is_unknown,
    judged_by,
    left_out,
    remarked,
    shares_of,
)
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures.lines import abreast
from orchestration.simulation.figures.palette import BLACK, BLUE, CYCLE, DASHES, MARKS
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.results import display_names as labels
from orchestration.theory.exact.mean_square import NO_EXPECTATION

if TYPE_CHECKING:
    import pandas as pd

HEIGHTS = (3.0, 1.0)
"""Heights of the panel of the lines and of that of their difference, relative"""
ROW = 0.05
"""Share of the height of a panel that a row of numbers takes"""
_NO_VALUE, _SOME, _UNKNOWN = "no value", "some runs left out", "not examined"
INFINITY: Any = {"marker": r"$\infty$", "markersize": 7.0, "markeredgewidth": 0.0}
"""Mark of a mean without a finite expectation"""
QUESTION: Any = {"marker": "$?$", "markersize": 6.0, "markeredgewidth": 0.0}
"""Mark of a mean whose expectation is not known to be finite, in the legend"""
HOLLOW: Any = {"markersize": 3.5, "markerfacecolor": "white", "zorder": 3}


def cell_lines(
    table: "pd.DataFrame",
    axis: Axis,
    laws: Axis | None,
    metric: str,
    words: tuple[str, str],
    *,
    units: Mapping[str, str],
    average: str = MEDIAN,
    style: Style = SCREEN,
) -> Figure:
    """The share of good runs, or the median or mean of a metric, with its interval at 95 %, over one axis.

    `laws` is an axis of names, such as controllers: a line for each. A mark is hollow where some runs are left out;
    crosses at the lower edge are values without an average, and signs of infinity at the upper one means without a
    finite expectation, which are not drawn. A question mark is beside one that may have none. The numbers of runs
    averaged stand at the upper edge, in a row for each line, where there is room. Of two laws a panel below has their
    difference, of shares, or of a metric in the pairs of runs that are both averaged.
    """
    across = quantity_of(axis, units)
    both = two_laws(laws)
    figure, rows = style.figure(32.0 if both is None else 42.0), 1 if both is None else 2
    panels = figure.subplots(rows, sharex=True, squeeze=False, height_ratios=HEIGHTS[:rows])
    panel = panels[0, 0]
    names = names_in(axis, laws)
    found = shares_of(table if average == MEDIAN else judged_by(table, metric), names)
    shown = found if metric == GOOD else averages_of(table, names, metric, average)
    column = "share" if metric == GOOD else average
    groups = groups_along(shown, laws, units)
    lacking: dict[str | tuple[float, ...], Floats] = {}
    without: dict[str | tuple[float, ...], Floats] = {}
    lacks, numbers, hollow, unknown = [], {}, False, False
    for i, (law, group) in enumerate(groups):
        how: dict[str, Any] = {"color": CYCLE[i % len(CYCLE)] if law else BLUE, "linestyle": DASHES[i % len(DASHES)]}
        at = across.of(group[axis.name])
        if REMARK in group and (infinite := group[REMARK] == NO_EXPECTATION).any():
            without[how["color"]] = at[infinite]
            group = group.assign(**{column: group[column].mask(infinite)})
        if REMARK in group and (doubtful := group[is_unknown(group[REMARK])])[column].notna().any():
            unknown = True
            for place in zip(across.of(doubtful[axis.name]), doubtful[column]):
                panel.annotate("?", place, (4.0, 3.0), textcoords="offset points", color=how["color"])
        panel.plot(at, group[column], marker=MARKS[i % len(MARKS)], markersize=3.5, label=law, **how)
        if metric != GOOD:  # too few runs have no interval, and a band of one place would not be seen
            ends = np.abs(group[["low", "high"]].to_numpy().T - group[column].to_numpy())
            panel.errorbar(at, group[column], ends, fmt="none", ecolor=how["color"], elinewidth=0.8, capsize=2.5)
            some = group[group[WITH_VALUE].between(1, group["count"] - 1)]
            hollow |= len(some) > 0
            panel.plot(across.of(some[axis.name]), some[column], MARKS[i % len(MARKS)], color=how["color"], **HOLLOW)
            valued = group[group[WITH_VALUE] > 0]
            numbers[how["color"]] = [*zip(across.of(valued[axis.name]), numbers_averaged(valued, valued["count"]))]
            if len(valueless := group.loc[group[WITH_VALUE] == 0, axis.name]):
                lacking[how["color"]] = across.of(valueless)
                lacks.append(f"{f'by {law} ' if law else ''}at {', '.join(map(across.text_of, valueless))}")
        else:
            panel.fill_between(at, group["low"], group["high"], color=how["color"], alpha=0.15, linewidth=0.0)
    most = max((len(count) for row in numbers.values() for _, count in row), default=0)
    numbered = bool(most) and (most + 1) * found[axis.name].nunique() <= letters_of(style, 1)
    panels[-1, 0].set_xlabel(across.title)
    panel.set(
        ylabel=title_of(metric, words, units, average, numbered=numbered, repeats=True),
        xscale=SCALES[axis.scale],
    )
    if metric == GOOD:
        panel.set_ylim(-0.02, 1.02)
    taken = _write_rows(panel, numbers) if numbered else 0.0
    if without:
        mark_edge(panel, without, beside=taken, **INFINITY)
        panel.plot([], [], linestyle="", **INFINITY, color=BLACK if laws else BLUE, label=NO_EXPECTATION)
    if unknown:
        panel.plot([], [], linestyle="", **QUESTION, color=BLACK if laws else BLUE, label=_UNKNOWN)
    if lacking:
        mark_edge(panel, lacking, marker="x", low=True)
        panel.plot([], [], "x", color=BLACK if laws else BLUE, markersize=4, label=_NO_VALUE)
    if hollow:
        panel.plot([], [], "o", color=BLACK if laws else BLUE, label=_SOME, **HOLLOW)
    if laws is not None or without or unknown or lacking or hollow:
        shown_as = [law for law, _ in groups]
        there = {NO_EXPECTATION: without, _UNKNOWN: unknown, _NO_VALUE: lacking, _SOME: hollow}
        shown_as += [name for name, some in there.items() if some]
        title = None if laws is None else name_of(laws)
        figure.legend(loc="outside lower center", title=title, ncols=abreast(shown_as, style))
    said = [repetitions(found, metric)]
    if metric != GOOD:
        said += [f"bars: 95 % intervals {INTERVALS[average]}, where runs suffice"] if said[0] else []
        said += [left_out(shown, words[0]), remarked(shown)]
    if both is not None:
        found = differences_in(table, names, both, metric, average)
        _draw_differences(panels[1, 0], across.of(found[axis.name]), found)
        unit = None if metric == GOOD else units.get(metric)
        panels[1, 0].set_ylabel(labels.metric_with_unit("difference", unit))
        minus, kind = names_of(both[1:]), "by Newcombe for pairs" if metric == GOOD else INTERVALS[average]
        of = "shares" if metric == GOOD else f"the {average} of pairs"
        panels[1, 0].set_title(f"{minus[both.second]} minus {minus[both.first]}", fontsize="small")
        said.append(f"below: difference of {of}, 95 % intervals {kind}")
    good = "" if average == MEAN else f"{words[0]} "
    said += [f"crosses: no {good}run with a value {' and '.join(lacks)}"] if lacks else []
    style.set_title(figure, "; ".join(filter(None, said)))
    return figure


def _draw_differences(panel: Axes, at: Floats, found: "pd.DataFrame") -> None:
    """The differences of two laws with their intervals; those without a finite expectation are at the upper edge."""
    infinite = found[REMARK].eq(NO_EXPECTATION) if REMARK in found else found["difference"].isna() & False
    middle = found["difference"].mask(infinite).to_numpy()
    draw_difference(panel, at, middle, (found["low"].to_numpy(), found["high"].to_numpy()))
    if infinite.any():
        mark_edge(panel, {BLACK: at[infinite]}, **INFINITY)


def draw_difference(panel: Axes, at: Floats, middle: Floats, ends: tuple[Floats, Floats], **look: Any) -> None:
    """A line of differences with the ends of their intervals, and one at 0."""
    panel.axhline(0.0, color=BLACK, linewidth=0.6)
    look = {"color": BLACK, "marker": "o", "markersize": 3.0, "linewidth": 0.8, **look}
    panel.errorbar(at, middle, np.abs(np.subtract(ends, middle)), capsize=2.5, **look)


def _write_rows(panel: Axes, numbers: Mapping[str, Sequence[tuple[float, str]]]) -> float:
    """Write numbers at their places along the upper edge, a row for each colour, above all marks.

    Returns the share of the height that they take.
    """
    step = min(ROW, 0.4 / len(numbers))
    taken = step * (len(numbers) + 0.5)
    make_room(panel, taken)
    for row, (color, counts) in enumerate(numbers.items()):
        for at, count in counts:
            panel.text(
                at, 1.0 - (row + 0.5) * step, count, color=color, ha="center", va="center", fontsize="x-small",
                transform=panel.get_xaxis_transform(),
            )  # fmt: skip
    return taken
