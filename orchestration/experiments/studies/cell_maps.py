"""Maps over two axes of cells: shares of good runs, medians or means, and the difference between two laws."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from orchestration.experiments.studies.axes import SCALES, Axis, quantity_of
from orchestration.experiments.studies.cell_texts import (
    ALONE,
    HALF,
    MARKED,
    OF_ALL,
    groups_along,
    letters_of,
    names_in,
    numbers_averaged,
    repetitions,
    title_of,
    two_laws,
    write_counts,
)
from orchestration.experiments.studies.shares import (
    GOOD,
    MEAN,
    MEDIAN,
    REMARK,
    WITH_VALUE,
    averages_of,
    cells_in_words,
    differences_in,
    is_unknown,
    judged_by,
    left_out,
    remarked,
    shares_of,
)
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures import cells as mesh
from orchestration.simulation.figures.palette import BLACK, NOT_GOOD
from orchestration.simulation.figures.shades import inner
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.quantities import Quantity
from orchestration.theory.exact.mean_square import NO_EXPECTATION

if TYPE_CHECKING:
    import pandas as pd

MAX_TICKS = 12
"""Most ticks beside a panel"""
MAX_PANELS = 9
"""Most values of a third axis of numbers: a map for each, three in a row"""
BESIDE = 4.5
"""Distance [pt] of a number, and of a sign with one, from the middle of a cell with a dot"""


def cell_maps(
    table: "pd.DataFrame",
    axes: tuple[Axis, Axis],
    third: Axis | None,
    metric: str,
    words: tuple[str, str],
    *,
    units: Mapping[str, str],
    average: str = MEDIAN,
    style: Style = SCREEN,
) -> Figure:
    """The share of good runs, or the median or mean of a metric, over two axes; the line is where half are good.

    There is a panel for each value of the `third` axis, numbers or names, such as controllers; and for two names one of
    their difference, with dots where its interval at 95 % excludes 0: of shares, or of a metric in the pairs of runs
    that are both averaged. Of means half of the runs have a value at the line; those without a finite expectation are
    hatched, without a colour, and left out of the range of the others; those of which this is not known are dotted.
    """
    x, y = (_Cells(axis, quantity_of(axis, units)) for axis in axes)
    places = (x.edges, y.edges)
    names = names_in(*axes, third)
    found = shares_of(table if average == MEDIAN else judged_by(table, metric), names)
    found["value"], absent = found["share"], ""
    if metric != GOOD:
        averages = found[names].merge(averages_of(table, names, metric, average), on=names)
        found["value"], found[WITH_VALUE], found["of"] = averages[average], averages[WITH_VALUE], averages["count"]
        absent = "; ".join(filter(None, (left_out(averages, words[0]), remarked(averages))))
    found["without"] = averages[REMARK].eq(NO_EXPECTATION) if average == MEAN else False
    found["unknown"] = is_unknown(averages[REMARK]) if average == MEAN else False
    found["value"] = found["value"].mask(found["without"])
    groups = groups_along(found, third, units)
    both = two_laws(third)
    count = len(groups) + (both is not None)
    columns = min(count, 3 if style.is_wide else 1 if count <= 3 else 2)
    columns = 2 if count == 4 and columns == 3 else columns  # no row with a single panel
    rows = -(-count // columns)
    figure = style.figure(32.0 * rows + 6.0 if count == 1 else (24.0 if columns > 1 else 17.0) * rows + 6.0)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for panel in panels[count:]:
        panel.set_visible(False)
    grids = [
        {name: _grid(group, axes, name) for name in ("value", "share", "without", "unknown")} for _, group in groups
    ]
    everything = np.array([0.0, 1.0]) if metric == GOOD else np.stack([grid["value"] for grid in grids])
    letters = letters_of(style, columns)
    room, most = letters / (len(places[0]) - 1), found["count"].max()
    has_room = {form: len(form.format(most, most)) + 1 <= room for form in (OF_ALL, ALONE, MARKED)}
    writes, repeats = has_room[ALONE], most > 1
    for panel, (law, group), grid in zip(panels, groups, grids):
        filled = mesh.fill(panel, *places, grid["value"], of=everything)
        mesh.hatch(panel, *places, np.isnan(grid["share"]))
        mesh.hatch(panel, *places, grid["without"] > 0.0, mesh.NO_MEAN)
        mesh.hatch(panel, *places, grid["unknown"] > 0.0, mesh.UNKNOWN)
        _limit(panel, places, grid["share"])
        if metric == GOOD and writes:
            at, up = (quantity.of(group[axis.name]) for quantity, axis in zip((x, y), axes))
            write_counts(panel, at, up, group["good"], group["count"], OF_ALL if has_room[OF_ALL] else ALONE)
        elif writes and repeats:
            valued = group[group[WITH_VALUE] > 0].set_index(names_in(*axes))
            texts = numbers_averaged(valued, valued["of" if has_room[OF_ALL] else WITH_VALUE])
            _write_numbers(panel, (x, y), axes, texts, 0.0)
        panel.set_title(law or "")
    empty = [np.where(np.isnan(grid["value"]) & (grid["without"] == 0.0), 0.0, np.nan) for grid in grids]
    for panel, none_good in zip(panels, empty):
        mesh.fill_kinds(panel, *places, none_good, (NOT_GOOD,))
    numbered = writes and repeats and not (metric == GOOD and has_room[OF_ALL])
    title = title_of(metric, words, units, average, numbered=numbered, repeats=repeats)
    if found["without"].any():
        title += f",\n{cells_in_words(found['without'].sum())} without a finite expectation left out"
    mesh.color_bar(panels[: len(groups)].tolist(), filled, everything, title, location="bottom", aspect=40.0)
    if both is not None:
        of_pairs, of = differences_in(table, names, both, metric, average), "difference of the shares"
        if metric != GOOD:
            unit = units.get(metric) or labels.METRICS.get(metric, ("", None))[1]
            of = labels.metric_with_unit(f"{average} difference", unit)
            of += ",\nnumber of pairs" if has_room[MARKED] and repeats else ""
        unpaired = _difference(
            figure, panels[2], places, axes, (x, y), of_pairs, of, writes=has_room[MARKED] and repeats
        )
        panels[2].set_title(f"{groups[1][0]}\nminus {groups[0][0]}")
    for panel in panels[:count]:
        panel.set(xscale=x.scale, yscale=y.scale, xlabel=x.title)
        panel.xaxis.set_tick_params(labelbottom=True)
        mesh.name_cells(panel, *(each.shown if each.is_even else None for each in (x, y)))
        if not x.is_even:
            panel.set_xticks(*x.ticks(0.9 * letters / (x.longest + 1)))
        if not y.is_even:
            panel.set_yticks(*y.ticks(MAX_TICKS))
    for panel in panels[:count:columns]:
        panel.set_ylabel(y.title)
    excludes = "Newcombe's for pairs" if metric == GOOD else f"the 95 % interval of the {average} of pairs"
    said = [
        repetitions(found, metric),
        f"+ and −: sign of the difference; dots: {excludes} excludes 0" if both is not None else "",
        absent,
    ]
    style.set_title(figure, "; ".join(filter(None, said)) if said[0] or absent else "")
    word = words[0] if average == MEDIAN else "with a value"
    handles: list[Patch | Line2D] = []
    if any(_has_limit(grid["share"]) for grid in grids):
        label = f"{'half of the runs' if repeats else 'limit of what is'} {word}"
        handles.append(Line2D([], [], color=mesh.LIMIT["colors"], label=label))
    if np.isfinite(np.stack(empty)).any():
        label = f"{'none' if repeats else 'not'} {word}"
        handles.append(Patch(color=NOT_GOOD, label=f"{label}, or no value" if absent and average == MEDIAN else label))
    if any(np.isnan(grid["share"]).any() for grid in grids):
        handles.append(mesh.hatched())
    if found["without"].any():
        handles.append(mesh.hatched(NO_EXPECTATION, mesh.NO_MEAN))
    if found["unknown"].any():
        handles.append(mesh.hatched("not examined", mesh.UNKNOWN))
    if both is not None and unpaired:
        handles.append(mesh.hatched("no pairs", mesh.NO_PAIRS))
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


class _Cells:
    """The cells along an axis: as wide as its steps or, where these differ, equally wide, so that all have room."""

    def __init__(self, axis: Axis, quantity: Quantity) -> None:
        self._values, self._quantity, scale = np.array(sorted(axis.values or ()), float), quantity, SCALES[axis.scale]
        self.title, self.shown = quantity.title, quantity.of(self._values)
        steps = np.diff(np.log(self._values) if scale == "log" else self._values)
        self.is_even = len(steps) < 2 or bool(steps.max() < 1.02 * steps.min())
        self.scale = scale if self.is_even else "linear"
        self.edges = mesh.edges(self.of(self._values), logarithmic=self.scale == "log")
        self.longest = max(len(f"{value:g}") for value in self.shown)

    def of(self, values: Any) -> Floats:
        """The places of some of its values."""
        return self._quantity.of(values) if self.is_even else np.asarray(np.searchsorted(self._values, values), float)

    def ticks(self, most: float) -> tuple[list[int], list[str]]:
        """Places and texts of as many values as have room, for cells that are equally wide."""
        places = [*range(0, len(self.shown), math.ceil(len(self.shown) / max(1.0, math.floor(most))))]
        return places, [f"{self.shown[i]:g}" for i in places]


def _grid(table: "pd.DataFrame", axes: tuple[Axis, Axis], column: str) -> Floats:
    """A column by cell, shape (values of the second axis, values of the first); nan where there is no run."""
    shape = table.pivot(index=axes[1].name, columns=axes[0].name, values=column)
    whole = shape.reindex(index=sorted(axes[1].values or ()), columns=sorted(axes[0].values or ()))
    return np.asarray(whole.to_numpy(float))


def _limit(panel: Axes, places: tuple[Floats, Floats], share: Floats) -> None:
    mesh.limit(panel, *places, np.where(np.isnan(share), np.nan, share >= HALF))


def _has_limit(share: Floats) -> bool:
    known = share[~np.isnan(share)]
    return bool((known >= HALF).any() and (known < HALF).any())


def _write_numbers(
    panel: Axes, quantities: tuple["_Cells", "_Cells"], axes: tuple[Axis, Axis], numbers: "pd.Series", side: float
) -> None:
    """Write numbers into the cells with the values of their index, that many points to the left of the middle."""
    places = zip(*(quantity.of(numbers.index.get_level_values(a.name)) for quantity, a in zip(quantities, axes)))
    for place, number in zip(places, numbers):
        panel.annotate(
            f"{number}", place, (-side, 0.0), textcoords="offset points", ha="right" if side else "center", va="center",
            fontsize="x-small", path_effects=[withStroke(linewidth=1.5, foreground="white")],
        )  # fmt: skip


def _difference(
    figure: Figure,
    panel: Axes,
    places: tuple[Floats, Floats],
    axes: tuple[Axis, Axis],
    quantities: tuple["_Cells", "_Cells"],
    found: "pd.DataFrame",
    of: str,
    *,
    writes: bool,
) -> bool:
    """The second law minus the first, with dots where its interval excludes 0; of medians the numbers of pairs too.

    Returns whether some cells have no difference, which are hatched.
    """
    is_share = "pairs" not in found
    found = found.assign(without=found[REMARK].eq(NO_EXPECTATION) if REMARK in found else False)
    without = _grid(found, axes, "without") > 0.0
    mesh.hatch(panel, *places, without, mesh.NO_MEAN)
    if REMARK in found:
        found["unknown"] = is_unknown(found[REMARK])
        mesh.hatch(panel, *places, _grid(found, axes, "unknown") > 0.0, mesh.UNKNOWN)
    found["difference"] = found["difference"].mask(found["without"])
    difference = _grid(found, axes, "difference")
    known = np.sort(np.abs(difference[np.isfinite(difference)]))
    size = 1.0 if is_share or not known.max(initial=0.0) else float(known[inner(known)[1]]) or float(known[-1])
    filled = mesh.fill(panel, *places, difference, cmap="RdBu", norm=Normalize(-size, size), vmin=None)
    unknown = np.isnan(difference) & ~without
    mesh.hatch(panel, *places, unknown, mesh.NO_PAIRS)
    beyond = "both" if known.max(initial=0.0) > size else "neither"
    figure.colorbar(filled, ax=panel, label=of, location="bottom", aspect=20.0, shrink=0.85, extend=beyond)
    aside = BESIDE if not is_share and writes else 2.5
    marks = (found["low"] > 0.0) | (found["high"] < 0.0)
    for row, is_marked in zip(found.to_dict("records"), marks):  # the sign, which colours do not show in grey
        if row["difference"] and not row["without"]:
            is_alone = not is_marked and (is_share or not writes)
            x, y = (float(quantity.of(row[axis.name])) for axis, quantity in zip(axes, quantities))
            color = "white" if abs(row["difference"]) > HALF * size else BLACK
            panel.annotate(
                "+" if row["difference"] > 0.0 else "−", (x, y), (0.0 if is_alone else aside, 0.0),
                textcoords="offset points", color=color, ha="center" if is_alone else "left", va="center",
                fontsize="small",
            )  # fmt: skip
    if not is_share and writes:
        _write_numbers(panel, quantities, axes, found.set_index(names_in(*axes))["pairs"], BESIDE)
    marked = found[marks]
    if len(marked):
        places_of_dots = [quantity.of(marked[axis.name]) for quantity, axis in zip(quantities, axes)]
        panel.plot(*places_of_dots, "o", color=BLACK, markersize=3.5, markeredgecolor="white", markeredgewidth=0.6)
    return bool(unknown.any())
