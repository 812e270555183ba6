"""The power spectrum of the command, with its sampling rate."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.flight.commands import COLUMNS
from orchestration.simulation.figures.drawn_run import DrawnRun
from orchestration.simulation.figures.lines import logarithmic, name_runs, plain, positive, wrapped
from orchestration.simulation.figures.palette import BLACK, BLUE, GREEN, RED
from orchestration.simulation.figures.style import Style

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
    starts = range(0, len(values) - length + 1, max(1, length // 2))
    window = np.hanning(length + 1)[:-1, None]
    power = np.zeros((length // 2 + 1, values.shape[1]))
    for start in starts:
        part = values[start : start + length]
        power += np.abs(np.fft.rfft(window * (part - part.mean(axis=0)), axis=0)) ** 2
    density: Floats = 2.0 * step / float((window**2).sum()) * power / len(starts)
    density[0] /= 2.0
    if length % 2 == 0:
        density[-1] /= 2.0
    frequencies: Floats = np.arange(length // 2 + 1) / (length * step)
    return frequencies, density


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
