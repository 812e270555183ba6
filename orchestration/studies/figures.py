"""Figures of a study: a metric over one or two axes, the spectral radius, sensitivity bars."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from orchestration.drawing.palette import BLUE, GREY, ORANGE, RED
from orchestration.drawing.style import SCREEN, Style
from orchestration.drawing.style import save as write
from orchestration.simulator import Floats
from orchestration.statistics import wilson
from orchestration.studies.axes import Axis
from orchestration.studies.ranges import is_in_seconds
from orchestration.units import in_brackets

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.studies.sensitivity import Index


def lines(
    table: "pd.DataFrame",
    axes: tuple[Axis, ...],
    metric: str,
    words: tuple[str, str],
    edge: float | None = None,
    *,
    unit: str | None = None,
) -> Figure:
    """A metric against the first axis, one line for each value of the second; what is not good is crossed.

    What diverged has no metric; it is marked along the lower edge. `unit` is the metric's.
    """
    figure = Figure(figsize=(8.0, 4.8))
    panel = figure.add_subplot()
    x = axes[0]
    groups = [(None, table)] if len(axes) == 1 else list(table.groupby(axes[1].name, sort=True))
    colors = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(groups)))
    for (value, group), color in zip(groups, colors, strict=True):
        ordered = group.sort_values(x.name)
        fell = ~flew(ordered)
        at, y = ordered[x.name].to_numpy(float), ordered[metric].to_numpy(float)
        panel.plot(at, np.where(fell, np.nan, y), ".-", color=color, label=None if value is None else f"{value:g}")
        panel.plot(at[fell], y[fell], "x", color=color, markersize=5)
        down = at[(ordered["outcome"] == "diverged").to_numpy()]
        panel.plot(
            down, np.full(len(down), 0.02), "v", color=color, markersize=4, transform=panel.get_xaxis_transform()
        )
    panel.plot([], [], "x", color=GREY, label=words[1])
    panel.plot([], [], "v", color=GREY, markersize=4, label="diverged")
    panel.set(xlabel=_label(x), ylabel=in_brackets(metric, unit), yscale=_scale(table[metric]))
    panel.set_xscale("log" if x.scale == "logarithmic" else "linear")
    if edge is not None:
        panel.axhline(edge, color=RED, linewidth=0.8, linestyle="--", label=f"{edge:g}: edge of {words[0]}")
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(
        handles, labels, title=None if len(axes) == 1 else axes[1].name, loc="outside right upper", fontsize=8
    )
    return figure


def scatter(
    table: "pd.DataFrame", axes: tuple[Axis, ...], metric: str, words: tuple[str, str], *, unit: str | None = None
) -> Figure:
    """A metric against each of many axes; what is not good is crossed, what diverged marked along the lower edge."""
    figure = Figure(figsize=(8.0, 2.4 * math.ceil(len(axes) / 2)))
    panels = figure.subplots(math.ceil(len(axes) / 2), 2, squeeze=False, sharey=True).ravel()
    fell = ~flew(table)
    for panel, axis in zip(panels, axes, strict=False):
        for chosen, marker, color in ((table[~fell], ".", BLUE), (table[fell], "x", RED)):
            panel.plot(chosen[axis.name], chosen[metric], marker, color=color, markersize=4, alpha=0.7)
        down = table.loc[table["outcome"] == "diverged", axis.name]
        panel.plot(down, np.full(len(down), 0.02), "v", color=RED, markersize=3, transform=panel.get_xaxis_transform())
        panel.set(xlabel=_label(axis), yscale=_scale(table[metric]))
        panel.set_xscale("log" if axis.scale == "logarithmic" else "linear")
    for panel in panels[len(axes) :]:
        panel.set_visible(False)
    figure.supylabel(in_brackets(metric, unit))
    kinds = zip((*words, DIVERGED), ("dots", "crosses", "below"), strict=True)
    counts = [f"{int((table['outcome'] == kind).sum())} {kind} ({mark})" for kind, mark in kinds]
    low, high = wilson(int((~fell).sum()), len(table))
    figure.suptitle(
        f"{len(table)} runs: {', '.join(counts)}{_by_horizon(table)}\n"
        f"share that is {words[0]} {(~fell).mean():.0%}, 95 % interval {low:.0%} to {high:.0%}",
        fontsize=10,
    )
    return figure


def heat_map(
    table: "pd.DataFrame", axes: tuple[Axis, ...], metric: str, words: tuple[str, str], *, unit: str | None = None
) -> Figure:
    """A metric over two axes where runs are good, the outcome where not, and the boundary between the two."""
    x, y = axes[0], axes[1]
    codes_of = {words[0]: 0, words[1]: 1, DIVERGED: 2}
    coded = table.assign(flew=flew(table).astype(float), code=table["outcome"].map(codes_of).astype(float))
    values, flying, codes = (
        coded.pivot_table(index=y.name, columns=x.name, values=name, dropna=False) for name in (metric, "flew", "code")
    )
    columns, index = values.columns.to_numpy(float), values.index.to_numpy(float)
    figure = Figure(figsize=(8.0, 5.0))
    panel = figure.add_subplot()
    shown = np.where(flying.to_numpy() > 0.5, values.to_numpy(float), np.nan)
    fell = np.where(codes.to_numpy() > 0.0, codes.to_numpy(), np.nan)
    panel.pcolormesh(columns, index, fell, cmap=ListedColormap(_FELL), vmin=0.5, vmax=2.5, shading="nearest")
    norm = LogNorm() if (shown > 0.0).any() else None
    mesh = panel.pcolormesh(columns, index, shown, norm=norm, cmap="viridis", shading="nearest")
    figure.colorbar(mesh, ax=panel, label=f"{in_brackets(metric, unit)}, where {words[0]}")
    if 0.0 < float(np.nanmean(flying.to_numpy())) < 1.0:
        panel.contour(columns, index, flying.to_numpy(), levels=[0.5], colors=RED, linewidths=1.5)
    panel.set(xlabel=_label(x), ylabel=_label(y), title=f"red: boundary of what is {words[0]}{_by_horizon(table)}")
    kinds = [Patch(color=color, label=kind) for kind, color in zip((words[1], DIVERGED), _FELL, strict=True)]
    figure.legend(handles=kinds, loc="outside lower center", ncols=len(kinds), fontsize=8)
    panel.grid(False)
    return figure


def spectral_radius(
    of: str, values: Floats, radii: Floats, *, local_limit: float | None, large_signal_limit: float | None
) -> Figure:
    """The spectral radius of the sampled loop about hover against the period or delay [s], with both limits."""
    figure = Figure(figsize=(8.0, 4.2))
    panel = figure.add_subplot()
    panel.plot(values * 1e3, radii, color=BLUE)
    panel.axhline(1.0, color=GREY, linewidth=0.8)
    for limit, color, name in ((local_limit, BLUE, "local"), (large_signal_limit, ORANGE, "large-signal")):
        if limit is not None:
            panel.axvline(limit * 1e3, color=color, linestyle="--", label=f"{name} limit {limit * 1e3:.1f} ms")
    panel.set(xlabel=f"{of} [ms]", ylabel="spectral radius about hover")
    panel.margins(x=0)
    if panel.get_legend_handles_labels()[0]:
        panel.legend()
    return figure


def sensitivity_bars(indices: "list[Index]", metric: str) -> Figure:
    """Bars with confidence, one group for each kind of index."""
    kinds = list(dict.fromkeys(index.kind for index in indices))
    axes = list(dict.fromkeys(index.axis for index in indices))
    figure = Figure(figsize=(8.0, 0.6 * len(axes) + 1.8))
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
            label=kind,
            capsize=2,
        )
    panel.set(
        yticks=np.arange(len(axes)) + height * (len(kinds) - 1) / 2,
        yticklabels=axes,
        xlabel=f"of {_OF.get(metric, metric)}",
    )
    panel.invert_yaxis()
    panel.legend()
    return figure


def flew(table: "pd.DataFrame") -> "pd.Series":
    """Which runs meet the criterion; of the quadrotor, fly: those that settle by their horizon."""
    return table["good"].eq(1).fillna(False).astype(bool)


def save(make: Callable[[], Figure], path: Path, style: Style = SCREEN) -> Path:
    """Make a figure in a style and write it; the path of the first format."""
    with style.applied():
        figure = make()
    return write({path.stem: figure}, path.parent, style)[0]


def _by_horizon(table: "pd.DataFrame") -> str:
    """The time by which the outcomes are judged, if it is one for all."""
    horizons = set(table["horizon"].dropna()) if "horizon" in table else set()
    return f", by {horizons.pop():g} s" if len(horizons) == 1 else ""


_FELL = ("#d9d9d9", "#6e6e6e")
"""Colours of what is not good, and of what diverged."""
DIVERGED = "diverged"


def _scale(values: "pd.Series") -> str:
    return "log" if (values.dropna().astype(float) > 0.0).any() else "linear"


def _label(axis: Axis) -> str:
    seconds = all(is_in_seconds(target) for target in axis.targets)
    return in_brackets(axis.name, "s" if seconds and not axis.multiplies else None)


_OF = {"outcome": "whether a run is good"}
