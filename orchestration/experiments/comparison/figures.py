"""Figures of a comparison: basins, shares that survive and settle, limits, fronts."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from orchestration.experiments.comparison.cells import CellSummary, Median
from orchestration.experiments.comparison.fronts import Pair, Point
from orchestration.experiments.comparison.limits import GridLimit
from orchestration.experiments.studies.axes import Value
from orchestration.experiments.studies.cell_lines import HEIGHTS, draw_difference
from orchestration.experiments.studies.cell_texts import HALF, OF_ALL, letters_of, write_counts
from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.simulation.figures import cells
from orchestration.simulation.figures.lines import abreast, plain
from orchestration.simulation.figures.palette import BLACK, BLUE, CYCLE, DASHES, GREY, MARKS, ORANGE
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.results.quantities import Quantity

BINS = 8
"""Number of intervals of the size of the initial error"""
BESIDE_BAR = 0.85
"""Share of the width that panels have beside a colour bar"""

BySize: TypeAlias = tuple[Sequence[Any], Integers]
"""Values of an axis, and how many initial conditions have a fate, of how many, shape (`BINS` of the size of the error,
values, 2)"""


def basins(by_size: Mapping[str, BySize], axis: Quantity, fate: str, title: str, style: Style = SCREEN) -> Figure:
    """The share that survives, or settles, over size of the initial error and axis, a panel for each controller.

    Cells have these numbers where there is room. The line is where half of them do. Panels have one axis if all
    controllers have the same values.
    """
    is_one = len({tuple(values) for values, _ in by_size.values()}) == 1
    figure, panels = _panels(len(by_size), 22.0, style, sharex=is_one)
    columns = panels[0].get_gridspec().ncols
    starts = np.concatenate([counts[..., 1].ravel() for _, counts in by_size.values()])
    drawn = [
        _basin(panel, axis.of(values), counts, BESIDE_BAR * letters_of(style, columns))
        for panel, (values, counts) in zip(panels, by_size.values())
    ]
    for panel, name in zip(panels, by_size):
        panel.set_title(name)
    for panel in panels[-columns:]:
        panel.set_xlabel(axis.title)
    figure.colorbar(drawn[0][0], ax=panels.tolist(), label=f"share that {fate}s")
    figure.supylabel("size of the initial error")
    fewest, most = starts.min(), starts.max()
    style.set_title(
        figure, _joined(title, f"{fewest} to {most} starts a cell" if fewest < most else f"{most} starts a cell")
    )
    limit = Line2D([], [], color=cells.LIMIT["colors"], label=f"half of the starts {fate}")
    handles: list[Line2D | Patch] = [limit] if any(has_limit for _, has_limit in drawn) else []
    handles += [cells.hatched("no starts")] if not fewest else []
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _basin(panel: Axes, at: Floats, counts: Integers, letters: float) -> tuple[Any, bool]:
    """Cells at places of the axis, with room for so many letters abreast; the mesh, and whether there is a line."""
    x, sizes = cells.edges(at), np.linspace(0.0, 1.0, BINS + 1)
    has, of = counts[..., 0], counts[..., 1]
    known = of > 0
    share = np.where(known, has / np.maximum(of, 1), np.nan)
    mesh = cells.fill(panel, x, sizes, share, vmin=0.0, vmax=1.0)
    cells.hatch(panel, x, sizes, ~known)
    limit = cells.limit(panel, x, sizes, np.where(known, share >= HALF, np.nan))
    cells.name_cells(panel, at)
    longest = len(OF_ALL.format(of.max(), of.max())) + 1
    if longest <= letters * np.diff(x).min() / (x[-1] - x[0]):
        rows, columns = np.nonzero(known)
        middles = 0.5 * (sizes[:-1] + sizes[1:])
        write_counts(panel, at[columns], middles[rows], has[known], of[known], OF_ALL)
    return mesh, limit is not None


def shares(
    by_title: Mapping[str, Sequence[CellSummary]],
    axis: Quantity,
    colors: Mapping[str, str],
    style: Style = SCREEN,
    *,
    pairs: Sequence[Pair] = (),
) -> Figure:
    """The shares that survive and settle, with Wilson intervals, two lines for each controller.

    Controllers differ by colour, dashes, marks and widths: of lines that coincide the lower ones are wider. In a single
    panel their names stand on the lines.

    `by_title` has the cells of each panel; `colors` are those of the controllers. The `pairs` of two controllers have
    a panel below, with their differences.
    """
    several = len(by_title) > 1
    if pairs:
        figure = style.figure(46.0)
        panels = figure.subplots(2, sharex=True, height_ratios=HEIGHTS)
        _differences(panels[1], axis, pairs)
    else:
        figure, panels = _panels(len(by_title), 20.0 if several else 30.0, style)
    shown = {cell.controller for group in by_title.values() for cell in group}
    names = [name for name in colors if name in shown]
    widths = np.linspace(1.8, 1.0, len(names)) * style.line
    looks: dict[str, dict[str, Any]] = {
        name: {"color": colors[name], "linestyle": dashes, "marker": mark, "linewidth": width}
        for name, dashes, mark, width in zip(names, itertools.cycle(DASHES), itertools.cycle(MARKS), widths)
    }
    for panel, (title, group) in zip(panels, by_title.items()):
        curves = {name: [cell for cell in group if cell.controller == name] for name in names}
        for name, those in curves.items():
            _shares_of(panel, axis, those, looks[name])
        runs = max((cell.count for cell in group), default=0)
        if several:
            panel.set_title(title)
        else:
            figure.set_label(_joined(title, f"{runs} starts, 95 % intervals"))
            panel.set_title(str(figure.get_label()) if style.has_titles else "")
        panel.set_ylim(-0.02, 1.02)
        if not several:
            _name_curves(panel, axis, curves, colors, style)
    handles = [Line2D([], [], label=name, **{**looks[name], "markersize": _SIZE}) for name in names if several]
    handles += [Line2D([], [], color=GREY, marker="o", label=fate, **how) for fate, how in _LINES.items()]
    if several:
        (figure.axes[len(by_title)] if len(figure.axes) > len(by_title) else figure).legend(
            handles=handles, loc="center" if len(figure.axes) > len(by_title) else "outside right center"
        )
        figure.supxlabel(axis.title)
        figure.supylabel("share of the starts")
    else:
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        panels[0].set_ylabel("share of the starts")
        panels[-1].set_xlabel(axis.title)
    return figure


def _differences(panel: Axes, axis: Quantity, pairs: Sequence[Pair]) -> None:
    """The shares of one controller minus those of another, with Newcombe's intervals."""
    at = axis.of([pair.value for pair in pairs])
    for (fate, look), color in zip(_LINES.items(), (BLACK, GREY)):
        found = [pair.shares[fate] for pair in pairs]
        middle, low, high = (np.array([getattr(one, key) for one in found]) for key in ("value", "low", "high"))
        draw_difference(panel, at, middle, (low, high), **look, color=color)
    panel.set_ylabel("difference")
    panel.set_title(f"{pairs[0].controller} minus {pairs[0].against}, from the same starts", fontsize="small")


@dataclass(frozen=True, kw_only=True)
class Reach:
    """The limits of one controller, and the last value of its axis."""

    name: str
    limits: Sequence[GridLimit]
    last: float


def limits_of(reaches: Sequence[Reach], axis: Quantity, in_seconds: bool, style: Style = SCREEN) -> Figure:
    """The limits up to which half and nine in ten survive, and settle, with intervals; arrows reach beyond the axis.

    A limit before its first value is not a mark but "below".

    If the axis is `in_seconds`, a third panel has the limits of settling times the bandwidth.
    """
    count = 3 if in_seconds else 2
    rows, columns = (1, count) if style.is_wide else (count, 1)
    figure = style.figure((2.5 * len(reaches) + (12.0 if style.is_wide else 6.0)) * rows)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for row, reach in enumerate(reaches):
        for limit in reach.limits:
            color, shift = (BLUE, -0.15) if limit.share == "half" else (ORANGE, 0.15)
            survives = limit.fate == "survive"
            label = f"{limit.share} of the starts" if row == 0 and survives else None
            _bar(panels[0 if survives else 1], limit, reach.last, axis.factor, row + shift, color, label)
            if in_seconds and limit.bandwidth is not None and not survives:
                _bar(panels[2], limit, reach.last, limit.bandwidth, row + shift, color, None)
    names = [reach.name for reach in reaches]
    panels[0].set(yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.5, -0.5))
    titles = [f"survive up to\n{axis.title}", f"settle up to\n{axis.title}"]
    titles += [f"settle: {axis.name} · bandwidth\nof the attitude loop [rad]"] if in_seconds else []
    for panel, title in zip(panels, titles):  # with room for arrows, and "below"
        panel.margins(x=0.15 if all(limit.value for reach in reaches for limit in reach.limits) else 0.3)
        panel.set_xlabel(title)
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def fronts_of(
    points: Sequence[Point],
    values: Sequence[Value],
    axis: Quantity,
    metrics: Sequence[str],
    colors: Mapping[str, str],
    title: str,
    style: Style = SCREEN,
) -> Figure:
    """Error against effort at values of the axis; the line joins the Pareto front.

    Each panel has its own axes. Points far from the median are counted and told in words; controllers that survive too
    few of the starts at one of the values are counted in its title.

    `metrics` are the labels of effort and error, `colors` those of the controllers.
    """
    figure, panels = _panels(len(values), 22.0, style, sharex=False, sharey=False)
    marks = dict(zip(colors, itertools.cycle(MARKS)))
    shown = {point.controller for point in points}
    for panel, value in zip(panels, values):
        here = [point for point in points if point.value == value]
        near = _near(here)
        for point in near:
            effort, error = _sides(point.effort), _sides(point.error)
            panel.errorbar(
                *effort[0], *error[0], xerr=effort[1], yerr=error[1], fmt=marks[point.controller],
                mfc=colors[point.controller] if point.on_front else "none", color=colors[point.controller],
                markersize=5, elinewidth=0.8,
            )  # fmt: skip
        line = sorted((p.effort.value or 0.0, p.error.value or 0.0) for p in near if p.on_front)
        panel.plot(*np.transpose(line), color=GREY, linewidth=0.8, zorder=0)
        left_out = f" of {len(shown)}" if len(here) < len(shown) else ""
        panel.set_title(f"{axis.text_of(float(value))}, {here[0].starts} starts,\n{len(here)}{left_out} controllers")
        panel.set(xscale="log", yscale="log")
        beyond = [point for point in here if point not in near]
        if beyond:
            places = [f"{p.controller},\nat {_digits(p.effort.value)}, {_digits(p.error.value)}" for p in beyond]
            _tell(panel, "\n".join([f"{len(beyond)} of {len(here)} beyond these axes:", *places]))
        plain(panel.xaxis)
        plain(panel.yaxis)
    handles = [Line2D([], [], linestyle="", marker=marks[n], color=c, label=n) for n, c in colors.items() if n in shown]
    if style.is_wide:
        figure.legend(handles=handles, loc="outside right center")
    else:
        figure.legend(handles=handles, loc="outside lower center", ncols=abreast([*colors], style))
    if style.is_wide:
        figure.supxlabel(metrics[0])
    else:  # that of the figure would lie on the legend
        panels[-1].set_xlabel(metrics[0])
    figure.supylabel(metrics[1])
    count = len({point.value for point in points})
    some = f"{len(values)} of {count} values; " if len(values) < count else ""
    text = _joined(title, f"{some}medians over the starts that all survive; filled: on the front")
    style.set_title(figure, text)
    return figure


def _joined(title: str, text: str) -> str:
    return f"{title}; {text}" if title else text


FENCE, ROOM = 6.0, 20.0
"""Distance from the median beyond which a point is outside: in medians of that distance, and at least as a ratio"""


def _near(points: Sequence[Point]) -> list[Point]:
    """The points that do not flatten the others: neither effort nor error is far from the median."""
    sides = np.log([[max(one.value or 0.0, 1e-300) for one in (p.effort, p.error)] for p in points])
    distance = np.abs(sides - np.median(sides, axis=0))
    inside = (distance <= np.maximum(FENCE * np.median(distance, axis=0), np.log(ROOM))).all(axis=1)
    return [point for point, is_inside in zip(points, inside) if is_inside]


def _digits(value: float | None) -> str:
    """Two digits, never as a power of ten."""
    rounded = float(f"{value or 0.0:.2g}")
    return f"{rounded:,.0f}" if abs(rounded) >= 10.0 else f"{rounded:g}"


def _tell(panel: Axes, text: str) -> None:
    """Lines of text in the upper right, above all points of logarithmic axes."""
    share = 0.06 * (text.count("\n") + 2)
    low, high = np.log(panel.get_ylim())
    panel.set_ylim(top=math.exp(low + (high - low) / (1.0 - share)))
    panel.text(0.98, 0.98, text, transform=panel.transAxes, ha="right", va="top", fontsize="small")


def colors_of(names: Sequence[str]) -> dict[str, str]:
    """A colour for each controller."""
    if len(names) <= len(CYCLE):
        return dict(zip(names, CYCLE))
    shades = matplotlib.colormaps["turbo"](np.linspace(0.05, 0.95, len(names)))
    return {name: matplotlib.colors.to_hex(shade) for name, shade in zip(names, shades)}


_SIZE = 3.5
"""Size of the marks of shares [pt]"""
_LINES: Mapping[str, Mapping[str, Any]] = {
    "survive": {"markersize": _SIZE},
    "settle": {"markersize": _SIZE, "markerfacecolor": "white", "linewidth": 0.7},
}
"""The differences between the two lines of a controller"""


def _shares_of(panel: Axes, axis: Quantity, group: Sequence[CellSummary], look: Mapping[str, Any]) -> None:
    """The two lines of one controller."""
    at = axis.of([cell.value for cell in group])
    for fate, line in (("settle", [cell.settles for cell in group]), ("survive", [cell.survives for cell in group])):
        panel.plot(at, [share.value for share in line], **{**look, **_LINES[fate]})
        low, high = [share.low for share in line], [share.high for share in line]
        panel.fill_between(at, low, high, color=look["color"], alpha=0.08, linewidth=0.0)


STEP = 0.05
"""Height of a name on the axis of shares"""


def _name_curves(
    panel: Axes, axis: Quantity, curves: Mapping[str, Sequence[CellSummary]], colors: Mapping[str, str], style: Style
) -> None:
    """Names on the lines of survival at different heights: the earlier a line falls, the lower its name.

    Names of lines that do not fall stand at their ends; near 1, where lines coincide, one above the other.
    """
    known = {name: group for name, group in curves.items() if group}
    order = sorted(known, key=lambda name: sum(cell.survives.value for cell in known[name]))
    top = 1.0 + 0.7 * STEP
    for name, height in zip(order, np.linspace(0.1, 0.9, 2 * len(order) + 1)[1::2]):
        at, share = axis.of([cell.value for cell in known[name]]), [cell.survives.value for cell in known[name]]
        below = next((k for k in range(1, len(share)) if share[k] < height <= share[k - 1]), None)
        if below is not None:
            place = (float(np.interp(height, (share[below], share[below - 1]), (at[below], at[below - 1]))), height)
        elif share[-1] > 1.0 - 1.5 * STEP:
            place, top = (at[-1], top), top + STEP
        else:
            place = (at[-1], share[-1] + 0.7 * STEP)
        panel.annotate(
            name, place, color=colors[name], fontsize=0.85 * style.font, ha="center" if below else "right", va="center",
            path_effects=[withStroke(linewidth=0.35 * style.font, foreground="white")],
        )  # fmt: skip
    panel.set_ylim(top=max(1.02, top))
    panel.set_yticks(np.linspace(0.0, 1.0, 6))


def _bar(panel: Axes, limit: GridLimit, last: float, factor: float, at: float, color: str, label: str | None) -> None:
    high = last if limit.high is None else limit.high
    ends = [[factor * (limit.value - limit.low)], [factor * (high - limit.value)]]
    panel.errorbar(factor * limit.value, at, xerr=ends, fmt="o", color=color, markersize=5, capsize=2, label=label)
    if not limit.value:  # not at the first value of the axis: no limit is known, and none is at 0
        panel.get_lines()[-3].set_visible(False)
        panel.annotate(
            "below", (0.0, at), (-3, 0), textcoords="offset points", color=color, ha="right", va="center",
            fontsize="x-small",
        )  # fmt: skip
    if limit.high is None:  # beside the last value, whose own mark stays visible
        panel.annotate(
            "", (factor * high, at), (16, 0), textcoords="offset points",
            arrowprops={"arrowstyle": "<|-", "color": color},
        )  # fmt: skip


def _sides(median: Median) -> tuple[list[float], list[list[float]]]:
    """A median and the lengths of its error bars; zero where the interval is not known."""
    value = median.value or 0.0
    low = value if median.low is None else median.low
    high = value if median.high is None else median.high
    return [value], [[value - low], [high - value]]


def _panels(
    count: int, height: float, style: Style, *, sharex: bool = True, sharey: bool = True
) -> tuple[Figure, "np.ndarray[tuple[int], np.dtype[np.object_]]"]:
    """A figure with `count` panels, each `height` lines high, at most three in a row, with shared axes."""
    columns = min(3 if style.is_wide else 1, count)
    columns = 2 if count == 4 and columns == 3 else columns  # no row with a single panel
    rows = math.ceil(count / columns)
    figure = style.figure(height * rows + 6.0)
    panels = figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False).ravel()
    for panel in panels[count:]:
        panel.set_axis_off()  # a legend may stand there
    for panel in panels[max(count - columns, 0) : count]:
        panel.xaxis.set_tick_params(labelbottom=True)  # also without a panel below it
    return figure, panels[:count]
