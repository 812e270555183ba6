"""Thrust and torques as applied, with marks for events and for active limits of the plant, and their power spectrum."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.mlab import psd

from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios.measures import saturated
from orchestration.quadrotor.scenarios.wiring import COMMAND
from orchestration.simulation.figures.drawn_run import DrawnRun, Window, title
from orchestration.simulation.figures.lines import (
    clip_peaks,
    draw_line,
    label_time,
    legend_of_runs,
    logarithmic,
    name_runs,
    plain,
    positive,
    set_span,
    wrapped,
)
from orchestration.simulation.figures.palette import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, RED
from orchestration.simulation.figures.style import Style
from orchestration.simulation.results import display_names as labels

NAMES = dict(zip(COMMAND, ("thrust", "torque x", "torque y", "torque z"), strict=True))
UNITS = dict(zip(COMMAND, ("N", "N.m", "N.m", "N.m"), strict=True))
COLUMNS = tuple(f"plant.{name}" for name in COMMAND)
MAX_MARKS = 150
"""Most marks of one kind that can be told apart in a window"""
AT_LIMIT = "a limit of the plant is active"


def commands(runs: Sequence[DrawnRun], style: Style) -> Figure:
    """The whole run, and a window of it: by default the first second. In a narrow figure the window alone, if any."""
    end = max(float(run.rows[-1, 0]) for run in runs)
    window = runs[0].window
    zoom = window or (0.0, min(1.0, end))
    spans: list[Window] = [(0.0, end), zoom] if style.is_wide else [window or (0.0, end)]
    figure = style.figure(3.0 + 10.5 * len(COMMAND))
    rows = figure.subplots(len(COMMAND), len(spans), sharex="col", squeeze=False, width_ratios=(1.0, 1.3)[: len(spans)])
    for row, name in zip(rows, COMMAND, strict=True):
        for panel, span in zip(row, spans, strict=True):
            is_zoom = panel is not row[0] or (len(spans) == 1 and window is not None)
            _draw(panel, runs, name, span, style, clips=not is_zoom, beside=zoom if len(spans) > 1 else None)
            if is_zoom and len(runs) == 1:
                mark_events(panel, runs[0], span)
        row[0].set_ylabel(labels.with_unit(NAMES[name], UNITS[name]))
        if len(spans) > 1 and window is not None:
            row[0].axvspan(*zoom, color=GREY, alpha=0.15, linewidth=0.0)
    for panel in rows[-1]:
        label_time(panel, end)
    if style.has_titles:
        rows[0][0].set_title(title(runs))
        if len(spans) > 1:
            rows[0][1].set_title(f"{zoom[0]:g} s to {zoom[1]:g} s")
    _legend(figure, list(rows.ravel()))
    legend_of_runs(figure, runs, style)
    return figure


def _draw(
    panel: Axes, runs: Sequence[DrawnRun], name: str, span: Window, style: Style, *, clips: bool, beside: Window | None
) -> None:
    """One command over one span, with the limits that are near; `beside`: the window of the panel beside it."""
    lines = []
    for run in runs:
        t, values = run.signals["time"], run.signals[f"plant.{name}"]
        first, last = np.searchsorted(t, span)
        near = slice(max(int(first) - 1, 0), int(last) + 1)
        draw_line(panel, t[near], values[near], drawstyle="steps-post", color=run.color, linestyle=run.dashes)
        inside = (t >= span[0]) & (t <= span[1])
        lines.append((t[inside], values[inside]) if inside.any() else (t, values))
    set_span(panel, span)
    low, high = min(float(y.min()) for _, y in lines), max(float(y.max()) for _, y in lines)
    room = (high - low) or 1.0  # below for samples and arrivals, above for losses
    panel.set_ylim(low - (0.1 if clips else 0.25) * room, high + 0.15 * room)
    if not (clips and clip_peaks(panel, lines, UNITS[name], style, beside)):
        _mark_limits(panel, runs, name)
    _mark_saturation(panel, runs, name)


def _mark_limits(panel: Axes, runs: Sequence[DrawnRun], name: str) -> None:
    """A line at each limit within the range of the axis."""
    bottom, top = panel.get_ylim()
    for run in runs:
        most = run.parameters.get("plant.thrust_max" if name == COMMAND[0] else "plant.torque_max", np.inf)
        for limit in (run.parameters.get("plant.thrust_min", 0.0) if name == COMMAND[0] else -most, most):
            if bottom <= limit <= top:
                panel.axhline(limit, color=BLACK, linestyle=":", label="limit of the plant")


def _mark_saturation(panel: Axes, runs: Sequence[DrawnRun], name: str) -> None:
    """Shade the time during which a limit alters the command."""
    for run in runs:
        t = run.signals["time"]
        active = saturated(run.signals, run.parameters)[name]
        if active.any():
            panel.fill_between(
                t, 0.0, 1.0, where=active, step="post", transform=panel.get_xaxis_transform(),
                color=RED if len(runs) == 1 else run.color, alpha=0.2, linewidth=0.0, label=AT_LIMIT,
            )  # fmt: skip


def mark_events(axes: Axes, run: DrawnRun, span: Window) -> None:
    """Marks along the lower and upper edge for the events in the window; for losses only where there are too many."""
    for kind, what, marker, color, height, label in (
        ("sampled", "measurement", "|", GREY, 0.04, "sampled"),
        ("arrived", "command", "^", GREEN, 0.11, "command arrives"),
        ("lost", "measurement", "x", ORANGE, 0.93, "measurement lost"),
        ("lost", "command", "x", PURPLE, 0.98, "command lost"),
    ):
        times = run.instants(kind, what)
        times = times[(times >= span[0]) & (times <= span[1])]
        if len(times) and (kind == "lost" or len(times) <= MAX_MARKS):
            axes.plot(
                times, [height] * len(times), linestyle="", marker=marker, color=color, markersize=4,
                markeredgewidth=0.8,
                transform=axes.get_xaxis_transform(), label=label, clip_on=False,
            )  # fmt: skip


def _legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """One legend below the panels, each label once."""
    handles: dict[str, Artist] = {}
    for panel in panels:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        figure.legend([*handles.values()], [*handles], loc="outside lower center", ncols=len(handles))


SEGMENTS = 8
"""Segments of the run, before they overlap by half"""
ROUNDING = 1e-18
"""Share of the largest density below which there is rounding, not signal"""
MIN_SEGMENT = 64
"""values in a segment"""


def spectrum(runs: Sequence[DrawnRun], style: Style) -> Figure | None:
    """Power spectral densities of thrust and torques as applied; None for less than `MIN_SEGMENT` plant steps."""
    with_command = [(run, *of) for run in runs if (of := _command(run)) is not None]
    if not with_command:
        return None
    columns = 2 if style.is_wide else 1
    figure = style.figure(25.0 if columns == 2 else 42.0)
    thrust, torque = figure.subplots(2 // columns, columns, squeeze=False).ravel()
    for run, step, command in with_command:
        color, dashes = run.color, run.dashes
        frequency, densities = welch(command, step)
        thrust.plot(frequency, positive(densities[:, 0]), color=color, linestyle=dashes)
        if len(runs) == 1:
            for k, (axis, line) in enumerate(zip("xyz", (BLUE, RED, GREEN), strict=True)):
                thin = (1.0 - 0.25 * k) * style.line  # the lower lines stay visible where they cross
                torque.plot(frequency, positive(densities[:, k + 1]), color=line, linewidth=thin, label=axis)
        else:
            torque.plot(frequency, positive(densities[:, 1:].sum(axis=1)), color=color, linestyle=dashes)
    all_three = "" if len(runs) == 1 else " (all axes)"
    thrust.set(ylabel=wrapped("thrust, power spectral density [N²/Hz]"))
    torque.set(ylabel=wrapped(f"torque{all_three}, power spectral density [(N·m)²/Hz]"))
    for panel in (thrust, torque):
        logarithmic(panel)
        panel.set(xscale="log", xlabel="frequency [Hz]")
        panel.set_xlim(frequency[1], frequency[-1])
        plain(panel.xaxis)
        if panel.get_yscale() == "log":
            low, high = panel.get_ylim()
            panel.set_ylim(max(low, ROUNDING * high), high)
        _mark_rates(panel, runs, style)
    if len(runs) == 1:
        torque.legend(loc="lower left")
    name_runs(figure, runs, style)
    return figure


def welch(values: Floats, step: float) -> tuple[Floats, Floats]:
    """One-sided power spectral density by Welch's method, with Hann windows that overlap by half.

    `values` are of shape (n, signals), `step` apart [s]. Returns frequencies [Hz], shape (m,), and densities
    [unit²/Hz], shape (m, signals).
    """
    length = min(len(values), max(MIN_SEGMENT, len(values) // SEGMENTS))
    how: Any = {"NFFT": length, "noverlap": length - length // 2, "window": np.hanning(length + 1)[:-1]}
    found = [psd(signal, Fs=1.0 / step, detrend="mean", **how) for signal in values.T]
    return np.asarray(found[0][1]), np.column_stack([np.asarray(density) for density, _ in found])


def _command(run: DrawnRun) -> tuple[float, Floats] | None:
    """The step of the plant [s] and its command at each, shape (n, 4), for all rows in the window."""
    step = run.system.components["plant"].step
    if step is None:
        return None
    chunks = run.whole.chunks(("time", *COLUMNS))
    rows = np.concatenate([[chunk.signals[name] for name in ("time", *COLUMNS)] for chunk in chunks], axis=1).T
    start, end = run.window or (0.0, float(rows[-1, 0]))
    count = int((min(end, rows[-1, 0]) - start) / step + 1e-9)
    if count < MIN_SEGMENT or not np.isfinite(rows).all():
        return None
    grid = start + step * (np.arange(count) + 0.5)  # between the instants, so that none is missed by rounding
    held = np.searchsorted(rows[:, 0], grid, side="right") - 1
    return step, rows[held, 1:]


def _mark_rates(panel: Axes, runs: Sequence[DrawnRun], style: Style) -> None:
    """Mark the sampling rate of what sends the command, the controller or a part of it, and its Nyquist frequency."""
    for run in runs:
        senders = [x.sender for x in run.system.connections if COLUMNS[0] in x.end]
        sampling = run.system.components[senders[0]].sampling if senders else None
        if sampling is None:
            continue
        rate, color = 1.0 / sampling.period, BLACK if len(runs) == 1 else run.color
        for value, dashes, what in ((rate, "-", f"sampled at {rate:g} Hz"), (0.5 * rate, ":", "half of it")):
            if not panel.get_xlim()[0] < value < panel.get_xlim()[1]:
                continue
            panel.axvline(value, color=color, linestyle=dashes, linewidth=0.7 * style.line, label="_rate")
            if len(runs) == 1:
                panel.text(
                    value, 0.98, f"{what} ", rotation=90, ha="right", va="top", fontsize=0.8 * style.font,
                    transform=panel.get_xaxis_transform(),
                    bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
                )  # fmt: skip
