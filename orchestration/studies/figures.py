"""Figures of a study: a metric over one or two axes, the spectral radius, sensitivity bars."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from orchestration.metrics import SETTLED
from orchestration.plots import BLUE, GREY, ORANGE, RED, STYLE
from orchestration.simulator import Floats
from orchestration.studies.axes import Axis

if TYPE_CHECKING:
    import pandas as pd

    from orchestration.studies.sensitivity import Index


def lines(table: "pd.DataFrame", axes: tuple[Axis, ...], metric: str) -> Figure:
    """A metric against the first axis, one line for each value of the second; runs that do not fly are crossed."""
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
    panel.plot([], [], "x", color=GREY, label="does not fly")
    panel.set(xlabel=_label(x), ylabel=metric, yscale=_scale(table[metric]))
    panel.set_xscale("log" if x.scale == "logarithmic" else "linear")
    if metric == "ultimate_bound":
        panel.axhline(SETTLED, color=RED, linewidth=0.8, linestyle="--", label=f"{SETTLED:g} m: flies below")
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(
        handles, labels, title=None if len(axes) == 1 else axes[1].name, loc="outside right upper", fontsize=8
    )
    return figure


def scatter(table: "pd.DataFrame", axes: tuple[Axis, ...], metric: str) -> Figure:
    """A metric against each of many axes; runs that do not fly are crossed."""
    figure = Figure(figsize=(8.0, 2.4 * math.ceil(len(axes) / 2)))
    panels = figure.subplots(math.ceil(len(axes) / 2), 2, squeeze=False, sharey=True).ravel()
    fell = ~flew(table)
    for panel, axis in zip(panels, axes, strict=False):
        for chosen, marker, color in ((table[~fell], ".", BLUE), (table[fell], "x", RED)):
            panel.plot(chosen[axis.name], chosen[metric], marker, color=color, markersize=4, alpha=0.7)
        panel.set(xlabel=_label(axis), yscale=_scale(table[metric]))
        panel.set_xscale("log" if axis.scale == "logarithmic" else "linear")
    for panel in panels[len(axes) :]:
        panel.set_visible(False)
    figure.supylabel(metric)
    figure.suptitle(
        f"{len(table)} runs, {int((~fell).sum())} fly (dots), {int(fell.sum())} do not (crosses)", fontsize=10
    )
    return figure


def heat_map(table: "pd.DataFrame", axes: tuple[Axis, ...], metric: str) -> Figure:
    """A metric over two axes, with the boundary of what flies."""
    x, y = axes[0], axes[1]
    values = table.pivot_table(index=y.name, columns=x.name, values=metric, dropna=False)
    flying = table.assign(flew=flew(table).astype(float)).pivot_table(index=y.name, columns=x.name, values="flew")
    columns, index = values.columns.to_numpy(float), values.index.to_numpy(float)
    figure = Figure(figsize=(8.0, 5.0))
    panel = figure.add_subplot()
    shown = np.where(flying.to_numpy() > 0.5, values.to_numpy(float), np.nan)
    norm = LogNorm() if (shown > 0.0).any() else None
    mesh = panel.pcolormesh(columns, index, shown, norm=norm, cmap="viridis", shading="nearest")
    figure.colorbar(mesh, ax=panel, label=f"{metric}, where it flies")
    if 0.0 < float(np.nanmean(flying.to_numpy())) < 1.0:
        panel.contour(columns, index, flying.to_numpy(), levels=[0.5], colors=RED, linewidths=1.5)
    panel.set(xlabel=_label(x), ylabel=_label(y), title="red: boundary of what flies")
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
    panel.set(yticks=np.arange(len(axes)) + height * (len(kinds) - 1) / 2, yticklabels=axes, xlabel=f"of {metric}")
    panel.invert_yaxis()
    panel.legend()
    return figure


def flew(table: "pd.DataFrame") -> "pd.Series":
    """Which runs fly: those that settle by their horizon."""
    return table["outcome"] == "settled"


def save(make: Callable[[], Figure], path: Path) -> Path:
    """Make a figure in the project's style and write it as PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with matplotlib.rc_context(STYLE):
        make().savefig(path)
    return path


def _scale(values: "pd.Series") -> str:
    return "log" if (values.dropna().astype(float) > 0.0).any() else "linear"


def _label(axis: Axis) -> str:
    seconds = all(target in _SECONDS for target in axis.targets)
    return f"{axis.name} [s]" if seconds and not axis.multiplies else axis.name


_SECONDS = {f"timing.{key}" for key in ("period", "offset", "plant_interval", "delay", "delay_jitter", "jitter")}
