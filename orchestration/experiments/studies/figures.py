"""Figures of a study: a metric over one or two axes, its map, sensitivity bars."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from orchestration.experiments.studies.axes import SCALES, Axis, edges, quantity_of
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.statistics import wilson
from orchestration.foundation.basics.unit_algebra import after
from orchestration.simulation.figures import cells
from orchestration.simulation.figures.lines import plain
from orchestration.simulation.figures.palette import BLUE, GREY, NOT_GOOD, ORANGE, RED, SHADES
from orchestration.simulation.figures.palette import DIVERGED as DARK
from orchestration.simulation.figures.shades import is_wide
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.figures.style import save as write
from orchestration.simulation.results import display_names as labels
from orchestration.systems.system.model import DIVERGED, TERMINATED

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.experiments.studies.sensitivity import Index


def lines(
    table: "pd.DataFrame",
    axes: tuple[Axis, ...],
    metric: str,
    words: tuple[str, str],
    edge: float | None = None,
    *,
    units: Mapping[str, str],
    style: Style = SCREEN,
) -> Figure:
    """A metric against the first axis, one line for each value of the second; runs that are not good are crosses.

    Diverged runs have no metric and are marked along the upper edge, in a row for each line. `units` are those of
    metrics and axes.
    """
    figure = style.figure(35.0)
    panel = figure.add_subplot()
    x = axes[0]
    across, second = quantity_of(x, units), quantity_of(axes[-1], units)
    groups = [(None, table)] if len(axes) == 1 else list(table.groupby(axes[1].name, sort=True))
    colors = matplotlib.colormaps[SHADES](np.linspace(0.0, 0.9, len(groups)))
    diverged: dict[str | tuple[float, ...], Floats] = {}
    for (value, group), color in zip(groups, [BLUE] if len(groups) == 1 else colors, strict=True):
        ordered = group.sort_values(x.name)
        not_good = ~good_runs(ordered)
        at, y = across.of(ordered[x.name]), ordered[metric].to_numpy(float)
        named = None if value is None else f"{float(second.of(value)):g}"
        panel.plot(at, np.where(not_good, np.nan, y), ".-", color=color, label=named)
        panel.plot(at[not_good], y[not_good], "x", color=color, markersize=5)
        diverged[color if len(groups) == 1 else tuple(color)] = at[(ordered["outcome"] == DIVERGED).to_numpy()]
    outcomes = {*table["outcome"].dropna()}
    for word, mark in ((words[0], ".-"), (words[1], "x"), (TERMINATED, "x"), (DIVERGED, "^")):
        if word in outcomes:
            color = BLUE if len(groups) == 1 and word == words[0] else GREY
            panel.plot([], [], mark, color=color, markersize=4 if mark == "^" else None, label=word)
    panel.set(
        xlabel=across.title, ylabel=labels.metric_with_unit(metric, units.get(metric)), yscale=_scale(table[metric])
    )
    panel.set_xscale(SCALES[x.scale])
    if edge is not None:
        panel.axhline(
            edge, color=RED, linewidth=0.8, linestyle="--", label=f"{words[0]} up to {edge:g}{after(units.get(metric))}"
        )
    if places := {color: at for color, at in diverged.items() if len(at)}:
        mark_edge(panel, places, marker="^")
    plain(panel.xaxis)
    plain(panel.yaxis)
    handles, names = panel.get_legend_handles_labels()
    figure.legend(handles, names, title=None if len(axes) == 1 else second.title, loc="outside right upper")
    return figure


def mark_edge(
    panel: Axes,
    places: Mapping[str | tuple[float, ...], Floats],
    *,
    low: bool = False,
    beside: float = 0.0,
    **look: Any,
) -> None:
    """Marks along the upper edge, or the lower, in a row for each colour, beyond all other marks.

    They leave a share of the height `beside` the edge to what stands there.
    """
    look = {"markersize": 4.0, **look}
    step = min(0.0055 * look["markersize"], 0.25 / len(places))
    make_room(panel, step * (len(places) + 1), low=low)
    for row, (color, at) in enumerate(places.items(), start=1):
        height = beside + row * step
        across = panel.get_xaxis_transform()
        where = np.full(len(at), height if low else 1.0 - height)
        panel.plot(at, where, linestyle="", color=color, transform=across, **look)


def make_room(panel: Axes, share: float, *, low: bool = False) -> None:
    """Extend the axis up, or down, so that this share of its height is free."""
    scale = panel.yaxis.get_transform()
    bottom, top = (scale.transform(end) for end in panel.get_ylim())
    more = (top - bottom) * share / (1.0 - share)
    end = float(np.asarray(scale.inverted().transform(bottom - more if low else top + more)))
    panel.set_ylim(end if low else None, None if low else end)


def scatter(
    table: "pd.DataFrame",
    axes: tuple[Axis, ...],
    metric: str,
    words: tuple[str, str],
    *,
    units: Mapping[str, str],
    style: Style = SCREEN,
) -> Figure:
    """A metric against each of many axes; crosses for runs that are not good, marks at the upper edge for diverged."""
    figure = style.figure(17.0 * math.ceil(len(axes) / 2))
    panels = figure.subplots(math.ceil(len(axes) / 2), 2, squeeze=False, sharey=True).ravel()
    not_good = ~good_runs(table)
    for panel, axis in zip(panels, axes, strict=False):
        across = quantity_of(axis, units)
        for chosen, marker, color in ((table[~not_good], ".", BLUE), (table[not_good], "x", RED)):
            panel.plot(across.of(chosen[axis.name]), chosen[metric], marker, color=color, markersize=4, alpha=0.7)
        down = across.of(table.loc[table["outcome"] == "diverged", axis.name])
        panel.plot(down, np.full(len(down), 0.98), "^", color=RED, markersize=3, transform=panel.get_xaxis_transform())
        panel.set(xlabel=across.title, yscale=_scale(table[metric]))
        panel.set_xscale(SCALES[axis.scale])
        plain(panel.xaxis)
        plain(panel.yaxis)
    for panel in panels[len(axes) :]:
        panel.set_visible(False)
    figure.supylabel(labels.metric_with_unit(metric, units.get(metric)))
    kinds = zip((*words, TERMINATED, DIVERGED), ("dots", "crosses", "crosses", "above"), strict=True)
    counted = [(int((table["outcome"] == kind).sum()), kind, mark) for kind, mark in kinds]
    counts = [f"{count} {kind} ({mark})" for count, kind, mark in counted if count]
    low, high = wilson(int((~not_good).sum()), len(table))
    figure.suptitle(
        f"{len(table)} runs: {', '.join(counts)}{by_horizon(table)}\n"
        f"share that is {words[0]} {(~not_good).mean():.0%}, 95 % interval {low:.0%} to {high:.0%}",
    )
    return figure


def sensitivity_bars(indices: "list[Index]", metric: str, style: Style = SCREEN) -> Figure:
    """Bars with confidence intervals, one group for each kind of index."""
    kinds = list(dict.fromkeys(index.kind for index in indices))
    axes = list(dict.fromkeys(index.axis for index in indices))
    figure = style.figure(4.3 * len(axes) + 13.0)
    panel = figure.add_subplot()
    height = 0.8 / len(kinds)
    for i, (kind, color) in enumerate(zip(kinds, (BLUE, ORANGE), strict=False)):
        chosen = {index.axis: index for index in indices if index.kind == kind}
        panel.barh(
            np.arange(len(axes)) + i * height,
            [chosen[axis].value for axis in axes],
            height,
            xerr=[chosen[axis].confidence for axis in axes],
            color=color,
            label=_KINDS.get(kind, kind),
            capsize=2,
        )
    panel.set(
        yticks=np.arange(len(axes)) + height * (len(kinds) - 1) / 2,
        yticklabels=[labels.setting(axis) for axis in axes],
        xlabel=f"index of sensitivity: {_OF.get(metric, labels.metric(metric))}",
    )
    panel.invert_yaxis()
    figure.legend(loc="outside right upper")
    return figure


def good_runs(table: "pd.DataFrame") -> "pd.Series":
    """Whether each run meets the criterion."""
    return table["good"].eq(1).fillna(False).astype(bool)


def add_note(figure: Figure, note: str, style: Style) -> None:
    """Write a note above a figure, below its title; a paper has its caption for both."""
    figure.set_label("; ".join(filter(None, (str(figure.get_label()), note))))
    if note and style.has_titles:
        figure.suptitle("\n".join(filter(None, (figure.get_suptitle(), style.in_lines(note)))), size="medium")


def save(make: Callable[[Style], Figure], path: Path, style: Style = SCREEN) -> list[Path]:
    """Make a figure in a style, and write it as `path` with the suffix of each format; the paths."""
    with style.applied():
        figure = make(style)
    return write({path.name: figure}, path.parent, style)


def by_horizon(table: "pd.DataFrame") -> str:
    """The stop time as text, if all runs have the same."""
    horizons = set(table["horizon"].dropna()) if "horizon" in table else set()
    return f", by {horizons.pop():g} s" if len(horizons) == 1 else ""


SPIKE = 10.0
"""Ratio of the largest of positive values to their median above which their axis is logarithmic: it flattens them"""


def _scale(values: "pd.Series") -> str:
    known = values.to_numpy(float, na_value=np.nan)
    known = known[np.isfinite(known)]
    spikes = len(known) > 0 and known.min() > 0.0 and known.max() > SPIKE * float(np.median(known))
    return "log" if spikes or is_wide(known) else "linear"


_KINDS = {
    "mu_star": "mean size of the effect μ*", "sigma": "its spread σ", "first": "first order", "total": "total",
}  # fmt: skip
_OF = {"outcome": "whether a run is good"}


def heat_map(
    table: "pd.DataFrame",
    axes: tuple[Axis, ...],
    metric: str,
    words: tuple[str, str],
    *,
    units: Mapping[str, str],
    style: Style = SCREEN,
) -> Figure:
    """A metric where runs are good, the outcome elsewhere, and the limit between the two; missing runs are hatched.

    If none is good, it is the metric of those that have not diverged.

    The legend lists the outcomes that occur.
    """
    kinds = {words[0]: 0, words[1]: 1, TERMINATED: 1, DIVERGED: 2}
    coded = table.assign(good_run=good_runs(table).astype(float), kind=table["outcome"].map(kinds).astype(float))
    coded.loc[table["outcome"].isna(), "good_run"] = np.nan
    values, good, kind = (_grid(coded, axes, name) for name in (metric, "good_run", "kind"))
    across, up = (quantity_of(axis, units) for axis in axes[:2])
    x, y = (edges(axis, each.of(coded[axis.name])) for axis, each in zip(axes, (across, up)))
    figure = style.figure(36.0)
    panel = figure.add_subplot()
    cells.fill_kinds(panel, x, y, np.where(kind > 0.0, kind - 1.0, np.nan), (NOT_GOOD, DARK))
    valued = 0 if (good > 0.5).any() else 1
    shown = np.where(kind == valued, values, np.nan)
    mesh = cells.fill(panel, x, y, shown)
    cells.hatch(panel, x, y, np.isnan(kind))
    has_limit = cells.limit(panel, x, y, good) is not None
    panel.set(xlabel=across.title, ylabel=up.title, xscale=SCALES[axes[0].scale], yscale=SCALES[axes[1].scale])
    cells.name_cells(panel, *(each.of(np.unique(coded[axis.name])) for axis, each in zip(axes, (across, up))))
    named = labels.metric_with_unit(metric, units.get(metric))
    cells.color_bar([panel], mesh, shown, f"{named}, where {words[valued]}")
    outcomes = {*table["outcome"].dropna()}
    bad = " or ".join(word for word in (words[1], TERMINATED) if word in outcomes)
    shade = matplotlib.colormaps[SHADES](0.5)
    handles: list[Patch | Line2D] = [
        Patch(color=color, label=word)
        for word, color in (
            (words[0], shade),
            (bad, shade if valued and np.isfinite(shown).any() else NOT_GOOD),
            (DIVERGED, DARK),
        )
        if word and (word == bad or word in outcomes)
    ]
    handles += [cells.hatched()] if np.isnan(kind).any() else []
    handles += [Line2D([], [], color=RED, label=f"limit of what is {words[0]}{by_horizon(table)}")] if has_limit else []
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles) if style.is_wide else 2)
    return figure


def _grid(table: "pd.DataFrame", axes: tuple[Axis, ...], name: str) -> Floats:
    """Values by cell, shape (values of the second axis, values of the first); nan where there is no run."""
    grid: Floats = table.pivot_table(index=axes[1].name, columns=axes[0].name, values=name, dropna=False).to_numpy(
        float
    )
    return grid
