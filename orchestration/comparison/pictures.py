"""Pictures of a comparison: basins, shares and limits with intervals, fronts; of who survives and who settles."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from orchestration.basics.simulator import Floats
from orchestration.comparison.cells import CellSummary, Median, sizes
from orchestration.comparison.design import CONDITION, CONTROLLER, VEHICLE, Comparison
from orchestration.comparison.fates import FATES
from orchestration.comparison.fronts import Point
from orchestration.comparison.limits import Limit
from orchestration.comparison.outcome import Outcome
from orchestration.figures import cells
from orchestration.figures.palette import BLUE, CYCLE, GREY, ORANGE
from orchestration.figures.style import SCREEN, Style
from orchestration.results import display_names as labels
from orchestration.results.quantities import Quantity, is_in_seconds
from orchestration.studies.axis_labels import quantity_of
from orchestration.studies.figures import save

if TYPE_CHECKING:
    import pandas as pd

BINS = 8
"""of the size of the initial error"""
MOST_PANELS = 6


def draw(
    comparison: Comparison,
    outcome: Outcome,
    table: "pd.DataFrame",
    folder: Path,
    style: Style = SCREEN,
    *,
    units: Mapping[str, str],
) -> list[Path]:
    """Draw all pictures into a folder; the paths. `units` are what the store says, by name of axis and metric."""
    axis = quantity_of(comparison.axis, units)
    done = table[table["status"] == "done"]
    written = [
        path
        for (vehicle, condition), rows in done.groupby([VEHICLE, CONDITION], sort=False)
        for path in _of_one(comparison, units, outcome, rows, (vehicle, condition), folder, style)
    ]
    if outcome.limits:
        written += save(lambda how: limits_of(comparison, axis, outcome.limits, how), folder / "limits", style)
    return written


def _of_one(
    comparison: Comparison,
    units: Mapping[str, str],
    outcome: Outcome,
    rows: "pd.DataFrame",
    of: tuple[str, str],
    folder: Path,
    style: Style,
) -> Iterator[Path]:
    """The pictures of one vehicle under one condition."""
    axis = quantity_of(comparison.axis, units)
    found = [cell for cell in outcome.cells if (cell.vehicle, cell.condition) == of]
    fronts = [point for point in outcome.fronts if (point.vehicle, point.condition) == of and _is_known(point)]
    title, end = ", ".join(of), "_".join(re.sub(r"[^\w.-]+", "_", name) for name in of)
    for fate in FATES:
        yield from save(partial(basins, comparison, axis, rows, title, fate), folder / f"basin_{fate}_{end}", style)
    yield from save(lambda how: shares(comparison, axis, found, title, how), folder / f"shares_{end}", style)
    if fronts:
        yield from save(lambda how: fronts_of(comparison, units, fronts, title, how), folder / f"front_{end}", style)


def basins(
    comparison: Comparison, axis: Quantity, rows: "pd.DataFrame", title: str, fate: str, style: Style = SCREEN
) -> Figure:
    """The share that survives, or settles, over size of the initial error and axis, a panel for each controller.

    The white line is where half of them do.
    """
    names = [one.name for one in comparison.controllers if (rows[CONTROLLER] == one.name).any()]
    figure, panels = _panels(len(names), 22.0, style)
    bins = np.linspace(0.0, 1.0, BINS + 1)
    x = cells.edges(axis.of(comparison.values))
    for panel, name in zip(panels, names):
        share = _by_size(comparison, rows[rows[CONTROLLER] == name], bins, fate)
        mesh = cells.fill(panel, x, bins, share, vmin=0.0, vmax=1.0)
        cells.hatch(panel, x, bins, np.isnan(share))
        cells.limit(panel, x, bins, np.where(np.isnan(share), np.nan, share >= 0.5), colors="white")
        panel.set_title(name)
    figure.colorbar(mesh, ax=panels.tolist(), label=f"share that {fate}s [1]")
    figure.supxlabel(axis.title)
    figure.supylabel("size of the initial error [1]")
    figure.suptitle(f"{title}; above the white line less than half of the starts {fate}")
    return figure


def shares(
    comparison: Comparison, axis: Quantity, found: Sequence[CellSummary], title: str, style: Style = SCREEN
) -> Figure:
    """The shares of all starts that survive and settle, with Wilson intervals, two lines for each controller."""
    figure = style.figure(32.0)
    panel = figure.add_subplot()
    for color, name in _colored(comparison):
        group = [cell for cell in found if cell.controller == name]
        at = axis.of([cell.value for cell in group])
        for line, those in ((".-", [cell.survives for cell in group]), (".:", [cell.settles for cell in group])):
            panel.plot(at, [share.value for share in those], line, color=color, label=name if line == ".-" else None)
            panel.fill_between(
                at, [share.low for share in those], [share.high for share in those], color=color, alpha=0.1,
                linewidth=0.0,
            )  # fmt: skip
    runs = max((cell.count for cell in found), default=0)
    panel.plot([], [], ".-", color=GREY, label="survive")
    panel.plot([], [], ".:", color=GREY, label="settle")
    panel.set(xlabel=axis.title, ylabel="share of the starts [1]", ylim=(-0.02, 1.02))
    panel.set_title(f"{title}; {runs} starts, 95 % intervals")
    panel.legend()
    return figure


def limits_of(comparison: Comparison, axis: Quantity, limits: Sequence[Limit], style: Style = SCREEN) -> Figure:
    """Up to where half and nine in ten of the starts survive, and settle, an arrow for those that go beyond the axis.

    With intervals; beside it, of those that settle, the same times the bandwidth.
    """
    last = float(comparison.values[-1])
    groups = [
        (key, [*group]) for key, group in groupby(limits, lambda one: (one.vehicle, one.condition, one.controller))
    ]
    in_seconds = _in_seconds(comparison)
    figure = style.figure(2.5 * len(groups) + 12.0)
    panels = figure.subplots(1, 3 if in_seconds else 2, sharey=True, squeeze=False).ravel()
    for row, (_, group) in enumerate(groups):
        for limit in group:
            color, shift = (BLUE, -0.15) if limit.share == "half" else (ORANGE, 0.15)
            survives = limit.fate == "survive"
            label = f"{limit.share} of the starts" if row == 0 and survives else None
            _bar(panels[0 if survives else 1], limit, last, axis.factor, row + shift, color, label)
            if in_seconds and limit.bandwidth is not None and not survives:
                _bar(panels[2], limit, last, limit.bandwidth, row + shift, color, None)
    several = len(comparison.vehicles) * len(comparison.conditions) > 1
    names = [", ".join((key[2], *key[:2])) if several else key[2] for key, _ in groups]
    panels[0].set(yticks=range(len(names)), yticklabels=names, xlabel=f"survive up to {axis.title}")
    panels[1].set(xlabel=f"settle up to {axis.title}")
    panels[0].invert_yaxis()
    if in_seconds:
        panels[2].set(xlabel=f"settle: {axis.name} · bandwidth of the attitude loop [rad]")
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def fronts_of(
    comparison: Comparison, units: Mapping[str, str], points: Sequence[Point], title: str, style: Style = SCREEN
) -> Figure:
    """Error against effort at values of the axis; the line joins what nothing beats."""
    values = [*dict.fromkeys(point.value for point in points)]
    chosen = [values[round(i)] for i in np.linspace(0, len(values) - 1, min(len(values), MOST_PANELS))]
    figure, panels = _panels(len(chosen), 20.0, style)
    axis = quantity_of(comparison.axis, units)
    colors = {name: color for color, name in _colored(comparison)}
    for panel, value in zip(panels, chosen):
        here = [point for point in points if point.value == value]
        for point in here:
            effort, error = _sides(point.effort), _sides(point.error)
            panel.errorbar(
                *effort[0], *error[0], xerr=effort[1], yerr=error[1], fmt="o",
                mfc=colors[point.controller] if point.on_front else "none", color=colors[point.controller],
                markersize=5, elinewidth=0.8,
            )  # fmt: skip
        line = sorted((p.effort.value or 0.0, p.error.value or 0.0) for p in here if p.on_front)
        panel.plot(*np.transpose(line), color=GREY, linewidth=0.8, zorder=0)
        starts = here[0].starts
        panel.set_title(f"{axis.said(float(value))}, {starts} starts")
        panel.set(xscale="log", yscale="log")
        for ticks in (panel.xaxis, panel.yaxis):
            ticks.set_major_locator(LogLocator(subs=(1.0, 3.0)))
            ticks.set_major_formatter("{x:g}")
            ticks.set_minor_formatter(NullFormatter())
    for name, color in colors.items():
        if any(point.controller == name for point in points):
            panels[0].plot([], [], "o", color=color, label=name)
    figure.legend(loc="outside right center")
    figure.supxlabel(labels.metric_with_unit(comparison.front.effort, units.get(comparison.front.effort)))
    figure.supylabel(labels.metric_with_unit(comparison.front.error, units.get(comparison.front.error)))
    figure.suptitle(f"{title}: medians over the starts that all survive; filled: on the front")
    return figure


def _by_size(comparison: Comparison, rows: "pd.DataFrame", edges: Floats, fate: str) -> Floats:
    """The share that survives, or settles, by bin of the size and value of the axis."""
    bins = np.clip(np.digitize(sizes(comparison, rows).to_numpy(float), edges) - 1, 0, BINS - 1)
    counted = rows.assign(bin=bins, has=FATES[fate](rows).astype(float))
    found = counted.pivot_table(index="bin", columns=comparison.axis.name, values="has")
    share: Floats = found.reindex(index=range(BINS), columns=[*comparison.values]).to_numpy(float)
    return share


def _bar(panel: Axes, limit: Limit, last: float, factor: float, at: float, color: str, label: str | None) -> None:
    high = last if limit.high is None else limit.high
    ends = [[factor * (limit.value - limit.low)], [factor * (high - limit.value)]]
    panel.errorbar(factor * limit.value, at, xerr=ends, fmt="o", color=color, markersize=5, capsize=2, label=label)
    if limit.high is None:
        panel.plot(factor * high, at, ">", color=color, markersize=6)


def _sides(median: Median) -> tuple[list[float], list[list[float]]]:
    """A median and how far its interval reaches to both sides; not at all where it is not known."""
    value = median.value or 0.0
    low = value if median.low is None else median.low
    high = value if median.high is None else median.high
    return [value], [[value - low], [high - value]]


def _is_known(point: Point) -> bool:
    return point.error.value is not None and point.effort.value is not None


def _panels(count: int, height: float, style: Style) -> tuple[Figure, "np.ndarray[tuple[int], np.dtype[np.object_]]"]:
    """A figure with so many panels, each so many lines high, at most three in a row, that share their axes."""
    columns = min(3 if style.is_wide else 1, count)
    rows = math.ceil(count / columns)
    figure = style.figure(height * rows + 6.0)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for panel in panels[count:]:
        panel.set_visible(False)
    return figure, panels[:count]


def _colored(comparison: Comparison) -> Iterator[tuple[str, str]]:
    """The colour and the name of each controller."""
    names = [one.name for one in comparison.controllers]
    if len(names) <= len(CYCLE):
        yield from zip(CYCLE, names)
        return
    for color, name in zip(matplotlib.colormaps["turbo"](np.linspace(0.05, 0.95, len(names))), names):
        yield matplotlib.colors.to_hex(color), name


def _in_seconds(comparison: Comparison) -> bool:
    axis = comparison.axis
    return not axis.multiplies and bool(axis.targets) and all(map(is_in_seconds, axis.targets))
