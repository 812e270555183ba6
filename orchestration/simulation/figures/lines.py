"""Common parts of figures over time: lines of runs, legends, and peaks that do not fit the axis."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullFormatter, NullLocator

from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures.drawn_run import DrawnRun, Window, title
from orchestration.simulation.figures.palette import BLACK, GREY
from orchestration.simulation.figures.shades import CLIPPED, OUTSIDE
from orchestration.simulation.figures.style import Style
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.quantities import Quantity, quantity

Lines: TypeAlias = Sequence[tuple[Floats, Floats]]
"""Times [s] and values, shape (n,) each"""


def draw_line(axes: Axes, t: Floats, values: Floats, **how: Any) -> None:
    """Draw a line over time: of all rows that fall on one column of pixels the first, last, lowest and highest.

    The picture is that of all rows, and the line of a long run has a tenth of the points.
    """
    shown = visible_rows(t, values, round(float(axes.get_figure(root=True).bbox.width)))  # type: ignore[union-attr]
    axes.plot(t[shown], values[shown], **how)


def visible_rows(t: Floats, values: Floats, columns: int) -> npt.NDArray[np.int64]:
    """The rows of a line over increasing time [s] that can be seen where it is so many pixels wide."""
    if len(t) <= 4 * columns:
        return np.arange(len(t))
    place = ((t - t[0]) * (columns / (t[-1] - t[0]))).astype(np.int64)
    starts = np.flatnonzero(np.diff(place, prepend=-1))
    ends = np.append(starts[1:], len(t)) - 1
    column = np.repeat(np.arange(len(starts)), ends - starts + 1)
    gaps = np.flatnonzero(np.diff(np.isnan(values)))
    shown = [starts, ends, gaps, gaps + 1]
    for extreme in (np.fmin, np.fmax):
        rows = np.flatnonzero(values == extreme.reduceat(values, starts)[column])
        shown.append(rows[np.diff(column[rows], prepend=-1) > 0])
    return np.unique(np.concatenate(shown))


def positive(values: Floats) -> Floats:
    """The values that a logarithmic axis can show; nan for the rest."""
    return np.where(values > 0.0, values, np.nan)


def logarithmic(axes: Axes) -> None:
    """Make the vertical axis logarithmic if any value on it is positive."""
    values = [np.asarray(line.get_ydata(), float) for line in axes.get_lines()]
    if any((one > 0.0).any() for one in values):
        axes.set_yscale("log")


def set_time_axis(axes: Axes, runs: Sequence[DrawnRun]) -> None:
    """Set the limits of the time axis to the span of the runs, or to the window."""
    set_span(axes, (min(run.span[0] for run in runs), max(run.span[1] for run in runs)))


def set_span(axes: Axes, span: Window) -> None:
    """Set the limits of the time axis to a span, unless it is that of a run of one row."""
    if span[0] < span[1]:
        axes.set_xlim(span)


def label_time(axes: Axes, end: float | None = None) -> None:
    """Name the time axis, and give its numbers the prefix of a time, by default of the end of the axis [s]."""
    time = _time_on(axes, end)
    axes.set_xlabel(time.title)
    _prefix_times(axes, time)


def _time_on(axes: Axes, end: float | None = None) -> Quantity:
    return quantity("time", "s", (axes.get_xlim()[1] if end is None else end,))


def _prefix_times(axes: Axes, time: Quantity) -> None:
    if time.factor != 1.0:
        axes.xaxis.set_major_formatter(lambda t, _: f"{time.factor * t:g}")


def legend_of_runs(figure: Figure, runs: Sequence[DrawnRun], style: Style, of: str | None = None) -> None:
    """A legend of the runs above all panels, with a title of its own; none for one run."""
    if len(runs) > 1:
        handles = [Line2D([], [], color=run.color, linestyle=run.dashes, label=run.name) for run in runs]
        columns = abreast([run.name for run in runs], style)
        figure.legend(handles=handles, loc="outside upper center", ncols=columns, title=of)


def name_runs(figure: Figure, runs: Sequence[DrawnRun], style: Style) -> None:
    """Their common title above the figure, if the style has titles, and a legend of several runs."""
    common = title(runs) if style.has_titles else None
    if common and len(runs) == 1:
        figure.suptitle(common)
    legend_of_runs(figure, runs, style, common)  # a title above both would lie on the legend


def abreast(names: Sequence[str], style: Style, *, width: float = 1.0) -> int:
    """The number of columns of a legend that fit a figure; `width` is its share of the style's."""
    longest = max(map(len, names)) + 6
    return min(len(names), max(1, int(width * style.width / (0.5 * longest * style.font * 0.353))))


def wrapped(label: str, width: int = 24) -> str:
    """A label broken into lines of `width` characters, its unit never alone on a line."""
    return "\n".join(textwrap.wrap(label.replace(" [", "\u00a0["), width, break_long_words=False))


def clip_peaks(axes: Axes, lines: Lines, unit: str, style: Style, beside: Window | None = None) -> bool:
    """Clip short peaks that would hide the rest of the signals, with a note, and show them in an inset.

    There is no inset of peaks `beside` the axes, in the window of another panel. `lines` are those drawn on `axes`,
    with all rows; returns whether anything was clipped: not where peaks are spread over the run, as an inset of all of
    it would show no more than the axes.
    """
    inner = [_without_peaks(t, y) for t, y in lines if len(t) > 1 and np.isfinite(y).any()]
    if not inner:
        return False
    low, high = min(one[0] for one in inner), max(one[1] for one in inner)
    bottom, top = (f([f(y[np.isfinite(y)]) for _, y in lines if np.isfinite(y).any()]) for f in (min, max))
    if high <= low or top - bottom <= CLIPPED * (high - low):
        return False
    room = 0.25 * (high - low)
    outside = np.concatenate([t[(y < low - room) | (y > high + room)] for t, y in lines])
    if np.ptp(outside) > SPREAD * (axes.get_xlim()[1] - axes.get_xlim()[0]):
        return False
    seen = (max(bottom, low - room) if bottom >= low - room else low - room, min(top, high + room))
    is_beside = beside is not None and beside[0] <= outside.min() and outside.max() <= beside[1]
    over = 0.35 if is_beside else 1.3  # room for the note, or for the inset with its numbers
    axes.set_ylim(seen[0] - 0.05 * (seen[1] - seen[0]), seen[1] + over * (seen[1] - seen[0]))
    t, y = max(lines, key=lambda line: float(np.nanmax(np.abs(line[1]))))
    k = int(np.nanargmax(np.abs(y)))
    at = _time_on(axes).text_of(float(t[k]), 3)
    note = f"clipped: peak {labels.amount(float(y[k]), unit)} at {at}".replace("-", "−")
    if is_beside:
        how: Any = {"transform": axes.transAxes, "ha": "right", "va": "top"}
        axes.text(0.98, 0.96, note, fontsize=0.8 * style.font, color=BLACK, **how)
    else:
        _inset(axes, lines, outside, note, style)
    return True


SPREAD = 0.3
"""Share of the axis over which peaks are spread too far for an inset"""


def _without_peaks(t: Floats, values: Floats) -> tuple[float, float]:
    """The range of a signal without a small share of the time."""
    held = np.append(np.diff(t), 0.0)
    order = np.argsort(values)
    share = np.cumsum(held[order]) / max(float(held.sum()), 1e-300)
    low, high = np.searchsorted(share, (OUTSIDE, 1.0 - OUTSIDE))
    return float(values[order[min(low, len(order) - 1)]]), float(values[order[min(high, len(order) - 1)]])


def _inset(axes: Axes, lines: Lines, outside: Floats, note: str, style: Style) -> None:
    """The time span of the peaks, whose times are `outside`, in the upper right, with the note as its title."""
    span = axes.get_xlim()[1] - axes.get_xlim()[0]
    width = max(float(np.ptp(outside)), 0.01 * span)
    inset = axes.inset_axes((0.42, 0.5, 0.56, 0.48), label="peak")
    start, end = max(outside.min() - 0.15 * width, axes.get_xlim()[0]), outside.max() + 0.4 * width
    for drawn, (times, values) in zip(axes.get_lines(), lines, strict=True):
        first, last = np.searchsorted(times, (start, end))
        near = slice(max(int(first) - 1, 0), int(last) + 1)
        inset.plot(
            times[near], values[near], color=drawn.get_color(), linestyle=drawn.get_linestyle(),
            linewidth=0.8 * style.line, drawstyle=drawn.get_drawstyle(),
        )  # fmt: skip
    inset.set_xlim(start, end)
    _prefix_times(inset, _time_on(axes))
    inset.tick_params(labelsize=0.7 * style.font, length=0.2 * style.font, pad=0.15 * style.font)
    inset.locator_params(nbins=4)
    inset.set_in_layout(False)  # it lies inside
    inset.set_title(note, fontsize=0.8 * style.font, color=BLACK, pad=0.2 * style.font)
    for side in inset.spines.values():
        side.set(visible=True, color=GREY, linewidth=0.05 * style.font)


def plain(axis: Axis, at: Sequence[float] | None = None) -> None:
    """3, 4, 5 instead of 4·10⁰ where a logarithmic axis spans less than two decades, or at the values `at`."""
    if axis.get_scale() != "log":
        return
    low, high = sorted(axis.get_view_interval())
    decades = math.log10(high / low) if low > 0.0 else math.inf
    if at is not None:
        axis.set_major_locator(FixedLocator([*at]))
    elif decades < 0.8:
        axis.set_major_locator(MaxNLocator(5))
    elif decades < 2.0:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    else:
        return
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
