"""The figure of a limit: the measurement at each value, the measured limit, and the limit by theory."""

import contextlib
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.components.fmi.foreign_calls import LostError, isolated_call
from orchestration.experiments.limits.evaluation import RELIABILITY, Evaluation
from orchestration.experiments.limits.limit_result import Limit
from orchestration.experiments.studies import figures
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import time_text
from orchestration.simulation.figures.lines import plain
from orchestration.simulation.figures.palette import BLUE, GREY, ORANGE, RED
from orchestration.simulation.figures.style import SCREEN, Style, named_by
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results import quantities
from orchestration.simulation.results.quantities import Quantity
from orchestration.systems.system.files import files_of
from orchestration.systems.system.request import Request, system_of
from orchestration.theory.stability.known_loops import LOOPS

DIGITS = 4
"""Digits of values in text"""


def limit_figure(result: Limit, style: Style = SCREEN) -> Figure:
    """The judged objective over the quantity, or the share of good seeds, with the limits."""
    across = quantities.setting(result.of, [one.value for one in result.tried], result.unit)
    figure = style.figure(38.0)
    axes = figure.add_subplot()
    if result.confidence is None:
        _draw_values(axes, result, across)
    else:
        _draw_shares(axes, result, across)
    tried = [one.value * across.factor for one in result.tried]
    if result.geometric and tried[0] > 0.0:
        axes.set_xscale("log")
        axes.set_xlim(*np.exp(_with_margin([math.log(value) for value in tried])))
        plain(axes.xaxis)
    else:
        axes.set_xlim(_with_margin(tried))
    _draw_limits(axes, result, across)
    axes.set_xlabel(across.title)
    if style.has_titles:
        axes.set_title(_title(result, across), loc="left")
    figure.legend(loc="outside lower center", ncols=3 if style.is_wide else 1)
    return figure


def _draw_values(axes: Axes, result: Limit, across: Quantity) -> None:
    """One run per value: the judged objective, or good and not good where it has no value."""
    known = [one for one in result.tried if one.measured is not None]
    if not known:
        _draw_marks(axes, result.tried, [float(one.is_good) for one in result.tried], across)
        axes.set(yticks=(0.0, 1.0), yticklabels=("not good", "good"), ylim=(-0.3, 1.3))
        return
    _draw_marks(axes, known, [one.measured or 0.0 for one in known], across, result.judged)
    down = [one.value * across.factor for one in result.tried if one.measured is None]
    axes.plot(
        down, np.full(len(down), 0.97), "^", color=RED, transform=axes.get_xaxis_transform(),
        label="diverged" if down else None,
    )  # fmt: skip
    bound = result.judged_bound
    if bound is not None:
        axes.axhline(
            bound,
            color=GREY,
            linewidth=1.0,
            linestyle=":",
            label=f"the criterion's bound, {Quantity(name='', unit=result.judged_unit).text_of(bound, DIGITS)}",
        )
    values = [one.measured or 0.0 for one in known]
    if min(values) > 0.0 and max(values) > 20.0 * min(values):
        axes.set_yscale("log")
        plain(axes.yaxis)
    axes.set_ylabel(labels.with_unit(labels.metric(result.judged or ""), result.judged_unit))


def _draw_shares(axes: Axes, result: Limit, across: Quantity) -> None:
    """Many runs per value: the share of good seeds with its interval, or the possible ones where not all were run."""
    known = [one for one in result.tried if one.share is not None]
    _draw_marks(axes, known, [one.flew / one.runs for one in known], across)
    stopped = [one for one in result.tried if one.share is None]
    axes.vlines(
        [one.value * across.factor for one in stopped],
        [one.flew / result.seeds for one in stopped],
        [1.0 - (one.runs - one.flew) / result.seeds for one in stopped],
        color=RED,
        linestyle=":",
        label="possible, not all seeds run" if stopped else "",
    )
    low, high = (np.array([one.share[side] for one in known if one.share is not None]) for side in (0, 1))
    middle = np.array([one.flew / one.runs for one in known])
    apart = np.maximum(np.array([middle - low, high - middle]), 0.0)
    axes.errorbar(
        [one.value * across.factor for one in known], middle, apart, fmt="none", ecolor=GREY, capsize=2,
        label=f"{result.confidence:.0%} interval",
    )  # fmt: skip
    axes.axhline(RELIABILITY, color=GREY, linewidth=1.0, linestyle=":", label=f"{RELIABILITY:.0%} of the seeds")
    axes.set(ylabel=f"share of {result.seeds} seeds that are good", ylim=(-0.05, 1.08))


def _draw_marks(
    axes: Axes, tried: Sequence[Evaluation], heights: list[float], across: Quantity, judged: str | None = None
) -> None:
    """One mark per value: dots where all runs were good, crosses elsewhere, thin where not for what is `judged`."""
    kinds = ("o", BLUE, "good"), ("X", RED, "not good"), ("x", RED, "not good for another objective")
    of_each = [0 if one.is_good else 1 if judged is None or judged in (one.unmet or judged) else 2 for one in tried]
    for kind, (mark, color, label) in enumerate(kinds):
        chosen = [i for i, each in enumerate(of_each) if each == kind]
        x, y = [tried[i].value * across.factor for i in chosen], [heights[i] for i in chosen]
        axes.plot(x, y, mark, color=color, markersize=6, label=label if chosen else None)


def _draw_limits(axes: Axes, result: Limit, across: Quantity) -> None:
    """The limits as lines, with the region beyond the measured one shaded."""
    named = (
        (result.large_signal_lower_limit, RED, "-", "measured lower limit"),
        (result.large_signal_limit, RED, "-", "measured limit"),
        (result.local_lower_limit, ORANGE, "--", "local lower limit, by theory"),
        (result.local_limit, ORANGE, "--", "local limit, by theory"),
        (result.mean_square_limit, ORANGE, ":", "mean-square limit, by theory"),
        (result.refuted_limit, GREY, "-.", f"{RELIABILITY:.0%} refuted"),
    )
    left, right = axes.get_xlim()
    for limit, color, style, name in named:
        at = None if limit is None else limit * across.factor
        if limit is not None and at is not None and left <= at <= right:
            axes.axvline(at, color=color, linestyle=style, label=f"{name}  {across.text_of(limit, DIGITS)}")
    if result.large_signal_limit is not None:
        axes.axvspan(result.large_signal_limit * across.factor, right, color=RED, alpha=0.06, linewidth=0.0)
    if result.large_signal_lower_limit is not None:
        axes.axvspan(left, result.large_signal_lower_limit * across.factor, color=RED, alpha=0.06, linewidth=0.0)


def _title(result: Limit, across: Quantity) -> str:
    what, until = across.name, f", in runs of {time_text(result.horizon)}"
    low, high = (
        None if limit is None else across.text_of(limit, DIGITS)
        for limit in (result.large_signal_lower_limit, result.large_signal_limit)
    )
    if low is not None or high is not None:
        between = (f"from {low}" if low else "", f"up to {high}" if high else "")
        return f"Good {' '.join(filter(None, between))}: {what}{until}"
    first = result.tried[0]
    if first.is_good:
        return f"{what}: good throughout{until}"
    return f"{what}: not good at {across.text_of(first.value, DIGITS)}, where the scan begins{until}"


def _with_margin(values: list[float]) -> tuple[float, float]:
    room = 0.03 * (max(values) - min(values)) or 1.0
    return min(values) - room, max(values) + room


def draw_limit(request: Request, result: Limit, folder: Path, style: Style = SCREEN) -> list[Path]:
    """Draw the measurements with both limits, and the spectral radius where a linear loop is known; the paths."""
    written = figures.save(lambda chosen: limit_figure(result, chosen), folder / named_by("limit", result.of), style)
    with contextlib.suppress(UsageError, LostError):  # linear theory does not apply, or its process is lost
        written += draw_spectral_radius(request, result, folder, style)
    return written


def draw_spectral_radius(request: Request, result: Limit, folder: Path, style: Style) -> list[Path]:
    """Draw the spectral radius of the loop over the quantity; the paths, empty if no linear loop is known.

    Raises `UsageError` where linear theory does not apply, and `LostError` as `isolated_call` does.
    """
    if LOOPS.of(request.kind) is None:
        return []
    ends = [limit for limit in (result.local_limit, result.large_signal_limit) if limit is not None]
    last = 1.3 * max(ends, default=0.1)
    values = np.array([0.001 + i / 199.0 * (last - 0.001) for i in range(200)])
    radii = isolated_call(files_of(system_of(request)).fmus.values(), _radii, request, result.of, values)
    if radii is None:
        return []
    path = folder / f"spectral_radius_{result.of}"
    return figures.save(lambda chosen: spectral_radius(result, values, radii, chosen), path, style)


def spectral_radius(result: Limit, values: Floats, radii: Floats, style: Style = SCREEN) -> Figure:
    """The spectral radius of the sampled loop about hover against the period or delay [s], with both limits."""
    figure = style.figure(30.0)
    panel = figure.add_subplot()
    across = quantities.setting(result.of, values)
    panel.plot(across.of(values), radii, color=BLUE)
    panel.axhline(1.0, color=GREY, linewidth=0.8)
    for limit, color, dashes, name in (
        (result.local_limit, ORANGE, "--", "local limit, by theory"),
        (result.large_signal_limit, RED, "-", "measured limit"),
    ):
        if limit is not None:
            at = across.factor * limit
            panel.axvline(at, color=color, linestyle=dashes, label=f"{name}  {across.text_of(limit, DIGITS)}")
    panel.set(xlabel=across.title, ylabel="spectral radius about hover")
    panel.margins(x=0)
    if panel.get_legend_handles_labels()[0]:
        panel.legend()
    return figure


def _radii(request: Request, of: str, values: Floats) -> Floats | None:
    """The spectral radius at each value; None if the loop is not known as a function of the quantity."""
    known = LOOPS.of(request.kind)
    radius = None if known is None else known.radius_over(request, of)
    return None if radius is None else np.array([radius(value) for value in values])
