"""Figures of the comparisons in `findings/`, from what `docs/data` keeps of them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from orchestration.basics.statistics import wilson
from orchestration.figures import cells as cells_of
from orchestration.figures.palette import BLUE, BROWN, GREEN, GREY, ORANGE, PURPLE, RED

Rows = Sequence[Mapping[str, Any]]

COLORS = {
    "unified": RED,
    "unified, no coupling": BLUE,
    "unified, mean": ORANGE,
    "no coupling, mean": "#5b3f8f",
    "geometric": GREEN,
    "geometric, published gains": "#8ecf9b",
    "geometric, mean": BROWN,
    "cascade, one rate": GREY,
    "cascade, no rate derivative": "#3a3a3a",
    "cascade, no velocity integral": "#b0b0b0",
    "unified, predictor": PURPLE,
    "no coupling, predictor": BROWN,
    "mean, predictor": GREEN,
    "unified, paper's gains": RED,
    "unified, tuned for 10 ms": ORANGE,
    "unified, tuned for its period": BLUE,
    "unified, mean, tuned for 10 ms": PURPLE,
    "unified, mean, tuned for its period": BROWN,
    "geometric, tuned for 10 ms": "#5b3f8f",
    "geometric, tuned for its period": GREEN,
    "cascade, one rate, tuned for 10 ms": "#b0b0b0",
    "cascade, one rate, tuned for its period": GREY,
}


def basins(cells: Rows, factors: Mapping[str, float]) -> Figure:
    """Share that survives over size of the initial error and period, a panel for each controller; white: half.

    `factors` are those on the periods, by controller: default: 1.
    """
    names = list(dict.fromkeys(cell["controller"] for cell in cells))
    columns = 4
    figure = Figure(figsize=(11.0, 2.9 * -(-len(names) // columns) + 0.6))
    panels = figure.subplots(-(-len(names) // columns), columns, sharey=True, squeeze=False).ravel()
    for panel in panels[len(names) :]:
        panel.set_visible(False)
    for panel, name in zip(panels, names):
        mine = [cell for cell in cells if cell["controller"] == name]
        at = 1e3 * factors.get(name, 1.0) * np.array([cell["value"] for cell in mine])
        share = np.array([[alive / count for alive, count in cell["by_size"]["survive"]] for cell in mine]).T
        x, sizes = cells_of.edges(at), np.linspace(0.0, 1.0, share.shape[0] + 1)
        mesh = cells_of.fill(panel, x, sizes, share, vmin=0.0, vmax=1.0)
        cells_of.limit(panel, x, sizes, (share >= 0.5).astype(float), colors="white")
        panel.set_title(name)
        panel.set_xlim(0.0, 300.0 * max(1.0, factors.get(name, 1.0) / 10.0))
    figure.colorbar(mesh, ax=panels.tolist(), label="share that survives [1]", shrink=0.8)
    figure.supxlabel("period [ms]")
    figure.supylabel("size of the initial error [1]")
    return figure


def limits(rows: Sequence[tuple[str, Mapping[str, Any], Mapping[str, Any], float]], last: float, label: str) -> Figure:
    """Up to which value half and nine in ten of the starts settle: (name, half, nine in ten, factor on the axis)."""
    figure = Figure(figsize=(8.0, 0.42 * len(rows) + 1.2))
    panel = figure.add_subplot()
    for i, (_, half, most, factor) in enumerate(reversed(rows)):
        for limit, shift, color in ((half, 0.13, BLUE), (most, -0.13, ORANGE)):
            value, low = 1e3 * factor * limit["value"], 1e3 * factor * limit["low"]
            high = last if limit["high"] is None else min(1e3 * factor * limit["high"], last)
            told = {BLUE: "half of the starts", ORANGE: "nine in ten"}[color] if i == 0 else None
            panel.errorbar(value, i + shift, xerr=[[value - low], [max(high - value, 0.0)]], fmt="o", color=color,
                           markersize=5, capsize=2, label=told)  # fmt: skip
    panel.set_yticks(range(len(rows)), [name for name, *_ in reversed(rows)])
    panel.set(xlabel=label, xlim=(0.0, last))
    panel.grid(visible=True, axis="x", alpha=0.3)
    panel.legend()
    return figure


def shares(panels_of: Mapping[str, Rows], label: str, factor: float = 1e3) -> Figure:
    """The shares that survive and settle, with Wilson intervals: a panel a title, a colour a controller."""
    columns = min(4, len(panels_of))
    rows = -(-len(panels_of) // columns)
    figure = Figure(figsize=(max(2.4 * columns, 4.0) + 3.0, 2.7 * rows + 0.7))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for panel in panels[len(panels_of) :]:
        panel.set_visible(False)
    for panel, (title, cells) in zip(panels, panels_of.items()):
        for name in dict.fromkeys(cell["controller"] for cell in cells):
            _line(panel, [cell for cell in cells if cell["controller"] == name], name, factor)
        panel.set_title(title)
        panel.set_ylim(-0.03, 1.03)
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside right center")
    figure.supxlabel(label)
    figure.supylabel("share of 200 starts: line survives, dots settle by 60 s [1]")
    return figure


def fronts(points: Rows, values: Sequence[float], colors: Mapping[str, str]) -> Figure:
    """Median error against median total variation of torque at some periods; filled: on the front."""
    figure = Figure(figsize=(2.4 * len(values) + 2.4, 3.4))
    panels = figure.subplots(1, len(values), sharex=True, sharey=True, squeeze=False).ravel()
    for panel, value in zip(panels, values):
        here = [point for point in points if point["value"] == value and point["error"][0] and point["effort"][0]]
        for point in here:
            error, effort = point["error"], point["effort"]
            panel.errorbar(
                effort[0], error[0], fmt="o", color=colors[point["controller"]], markersize=5, elinewidth=0.8,
                markerfacecolor=colors[point["controller"]] if point["on_front"] else "none",
                xerr=_sides(effort), yerr=_sides(error),
            )  # fmt: skip
        panel.set_title(f"{1e3 * value:g} ms, {here[0]['starts'] if here else 0} starts")
        panel.set(xscale="log")
        panel.xaxis.set_major_locator(LogLocator())
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter(NullFormatter())
    for name, color in colors.items():
        panels[0].plot([], [], "o", color=color, label=name)
    figure.legend(loc="outside right center")
    figure.supxlabel("total variation of the torque [N·m]")
    figure.supylabel("RMS position error [m]")
    return figure


def colored(names: Sequence[str]) -> dict[str, str]:
    """A colour for each controller, the same in every figure where there are few."""
    return {name: COLORS[name] for name in names}


def _line(panel: Axes, cells: Rows, name: str, factor: float) -> None:
    at = factor * np.array([cell["value"] for cell in cells])
    low, high = np.transpose([wilson(cell["survives"], cell["count"]) for cell in cells])
    color = colored([name])[name]
    panel.plot(at, [cell["survives"] / cell["count"] for cell in cells], "-", color=color, label=name, linewidth=1.2)
    panel.plot(at, [cell["settles"] / cell["count"] for cell in cells], ".", color=color, markersize=4)
    panel.fill_between(at, low, high, color=color, alpha=0.15, linewidth=0.0)


def _sides(median: Sequence[float | None]) -> list[list[float]]:
    value, low, high = median
    assert value is not None
    return [[value - (value if low is None else low)], [(value if high is None else high) - value]]
