"""Figures of one run: the path, the errors, the commands with what happened when, the energy."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.master.recording import thinned
from orchestration.quadrotor.measures import desired, position_error
from orchestration.quadrotor.scenario import Scenario
from orchestration.quadrotor.wiring import (
    ATTITUDE_ERROR_SCALAR,
    COMMAND,
    ENERGY,
    POSITION,
    POSITION_REFERENCE,
    components,
)
from orchestration.results.result import FIGURES, SYSTEM_FIGURE, Result
from orchestration.simulator import Floats
from orchestration.system.model import component_of

STYLE = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.constrained_layout.use": True,
    "figure.dpi": 110,
    "font.size": 10,
    "grid.alpha": 0.3,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
}
BLUE, ORANGE, GREEN, RED, GREY = "#1f6f9f", "#e0812b", "#2f8f5b", "#b5323e", "#8a8a8a"

MOST_LINES = 8
"""In one panel"""

_ERRORS = (
    (r"velocity  [m/s]", ORANGE, components("velocity_error")),
    (r"attitude  $\|\tilde q\|$  [1]", GREEN, components("attitude_error")),
    (r"angular velocity  [rad/s]", RED, components("angular_velocity_error")),
)
_DRAWN = {
    "time",
    *POSITION_REFERENCE,
    *(f"plant.{name}" for name in (*POSITION, *COMMAND)),
    *(f"controller.{name}" for name in (ATTITUDE_ERROR_SCALAR, ENERGY)),
    *(f"controller.{name}" for _, _, names in _ERRORS for name in names),
}

Window = tuple[float, float]
"""A span of time [s]."""


MOST = 2**16
"""rows that are drawn of the whole of a longer run, beside all in the window"""


def draw(result: Result, folder: Path, window: Window | None = None) -> list[Path]:
    """Write the figures of a run as PNG; `window` is what the commands are zoomed on. Returns their paths.

    Of a run of more than `MOST` rows every n-th is drawn.
    """
    window = window or (0.0, min(1.0, result.end))
    drawn = _DRAWN if isinstance(result.asked, Scenario) else set(result.columns)
    result = replace(result, recording=thinned(result.recording, drawn, window, MOST))
    if not isinstance(result.asked, Scenario):
        return _written({SYSTEM_FIGURE: lambda: signals(result)}, folder)
    makers: tuple[Callable[[], Figure | None], ...] = (
        lambda: path(result),
        lambda: errors(result),
        lambda: commands(result, window),
        lambda: energy(result),
    )
    return _written(dict(zip(FIGURES, makers, strict=True)), folder)


def _written(makers: Mapping[str, Callable[[], Figure | None]], folder: Path) -> list[Path]:
    written = []
    with matplotlib.rc_context(STYLE):
        for name, make in makers.items():
            figure = make()
            if figure is not None:
                figure.savefig(folder / f"{name}.png")
                written.append(folder / f"{name}.png")
    return written


def signals(result: Result) -> Figure:
    """What is exchanged in a system: a panel for each connection, its signals as the receiver has them.

    Of a system without connections, the recorded outputs of each component.
    """
    groups = {x.name: [end if end in result.signals else start for start, end in zip(x.start, x.end)]
              for x in result.system.connections} or {
        name: [column for column in result.columns if column.startswith(f"{name}.")][:MOST_LINES]
        for name in result.system.components
    }  # fmt: skip
    figure = Figure(figsize=(8.0, 1.0 + 1.8 * len(groups)))
    t = result.signals["time"]
    panels = figure.subplots(len(groups), 1, sharex=True, squeeze=False)[:, 0]
    applied = {end for x in result.system.connections for end in x.end}
    for axes, (name, columns) in zip(panels, groups.items(), strict=True):
        for column in columns:
            held = column in applied or result.system.components[component_of(column)].sampling is not None
            axes.plot(t, result.signals[column], drawstyle="steps-post" if held else "default", label=column)
        axes.margins(x=0)
        if columns:
            axes.legend(loc="upper right", fontsize=8)
        axes.set_ylabel(name)
    panels[0].set_title(_title(result))
    panels[-1].set_xlabel("time [s]")
    return figure


def path(result: Result) -> Figure:
    """The flight in space with its reference, up being up."""
    figure = Figure(figsize=(7.0, 6.0))
    axes = figure.add_subplot(projection="3d")
    x, y, z = (result.signals[f"plant.{name}"] for name in POSITION)
    axes.plot(*desired(result.signals).T, color=ORANGE, linestyle="--", label="reference $P_d$")
    axes.plot(x, y, z, color=BLUE, label="flown $P$")
    axes.scatter(x[:1], y[:1], z[:1], color=BLUE, s=25)
    axes.text(x[0], y[0], z[0], "  start", color=BLUE)
    axes.set(xlabel="x north [m]", ylabel="y east [m]", zlabel="z down [m]", title=_title(result))
    axes.invert_zaxis()
    axes.invert_yaxis()
    axes.view_init(elev=24, azim=-50)
    axes.legend(loc="upper left")
    return figure


def errors(result: Result) -> Figure:
    """The norms of the four errors: position at every recorded row, the others as of the last sample."""
    figure = Figure(figsize=(8.0, 4.5))
    axes = figure.add_subplot()
    t = result.signals["time"]
    _log_line(axes, t, position_error(result.signals), BLUE, "position  [m]")
    for label, color, names in _ERRORS:
        columns = [result.signals.get(f"controller.{name}") for name in names]
        if all(column is not None for column in columns):
            _log_line(axes, t, np.linalg.norm(np.array(columns), axis=0), color, label)
    axes.set(xlabel="time [s]", ylabel="norm of the error", yscale="log", title=_title(result))
    axes.margins(x=0)
    axes.legend(ncols=2)
    return figure


def commands(result: Result, window: Window | None = None) -> Figure:
    """Thrust and torques as applied: the whole run, and a window with the instants of the digital loop."""
    t = result.signals["time"]
    start, end = window or (0.0, min(1.0, float(t[-1])))
    figure = Figure(figsize=(11.0, 7.0))
    rows = figure.subplots(len(COMMAND), 2, sharex="col", width_ratios=(1.0, 1.3))
    for (whole, zoom), name in zip(rows, COMMAND, strict=True):
        applied = result.signals[f"plant.{name}"]
        for axes in (whole, zoom):
            axes.step(t, applied, where="post", color=BLUE)
        inside = (t >= start) & (t <= end)
        visible = applied[inside] if inside.any() else applied
        span = float(np.ptp(visible)) or 1.0  # room below for what happened, above for what was lost
        zoom.set(xlim=(start, end), ylim=(visible.min() - 0.25 * span, visible.max() + 0.15 * span))
        whole.set_ylabel(f"{name} [{'N' if name == COMMAND[0] else 'N·m'}]")
        whole.margins(x=0)
        _mark_events(zoom, result, start, end)
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
    rows[0][0].set_title(_title(result))
    rows[0][1].set_title(f"{start:g} s to {end:g} s, with the instants of the digital loop")
    handles, labels = rows[0][1].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def energy(result: Result) -> Figure | None:
    """The energy function L at the samples; None if the controller has none, or has not sampled."""
    values = result.signals.get(f"controller.{ENERGY}")
    if values is None or not result.sampled.any():
        return None
    figure = Figure(figsize=(8.0, 4.0))
    axes = figure.add_subplot()
    _log_line(axes, result.signals["time"][result.sampled], values[result.sampled], BLUE, "L")
    axes.set(xlabel="time [s]", ylabel="energy L (33) [J]", yscale="log", title=_title(result))
    axes.margins(x=0)
    return figure


def _log_line(axes: Axes, t: Floats, values: Floats, color: str, label: str) -> None:
    axes.plot(t, np.where(values > 0.0, values, np.nan), color=color, label=label)


def _mark_events(axes: Axes, result: Result, start: float, end: float) -> None:
    """Ticks along the lower and upper edge for what happened in the window."""
    for kind, what, marker, color, height, label in (
        ("sampled", "measurement", "|", GREY, 0.04, "sampled"),
        ("arrived", "command", "^", GREEN, 0.11, "command arrives"),
        ("lost", "measurement", "x", ORANGE, 0.93, "measurement lost"),
        ("lost", "command", "x", RED, 0.98, "command lost"),
    ):
        times = [e.time / 1e9 for e in result.events if e.kind == kind and e.what == what]
        times = [time for time in times if start <= time <= end]
        if times:
            axes.plot(
                times, [height] * len(times), linestyle="", marker=marker, color=color, markersize=4,
                markeredgewidth=0.8,
                transform=axes.get_xaxis_transform(), label=label, clip_on=False,
            )  # fmt: skip


def _title(result: Result) -> str:
    parts = []
    if isinstance(result.asked, Scenario):
        timing = result.asked.timing
        parts.append(f"{result.asked.controller.fmu}, period {timing.period * 1e3:g} ms")
        if timing.delay:
            parts.append(f"delay {timing.delay * 1e3:g} ms")
        if timing.order != "gauss-seidel":
            parts.append("Jacobi")
    if result.divergence is not None:
        parts.append(f"diverged at {result.metrics['divergence_time']:g} s")
    if result.interrupted_at is not None:
        parts.append(f"interrupted at {result.interrupted_at:g} s")
    return ", ".join(parts)
