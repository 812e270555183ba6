"""Figures of `findings.md` that no command draws."""

from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from docs import experiments
from docs.experiments import CASES, DIRECTIONS, PERIODS, SIZES
from orchestration.results.plots import BLUE, GREY, ORANGE, RED
from orchestration.statistics import wilson
from orchestration.studies import figures

Array = Any

TICKS = {"position_noise": (1e-4, 1e-3, 1e-2), "inertia_factor": (0.5, 1.0, 2.0)}
"""of the axes of the Monte Carlo study that are logarithmic"""
UNITS = {"jitter": "s", "position_noise": "m"}


def gain_limits(factors: Array, ends: dict[str, Array], local: Array, first: float) -> Figure:
    """First ends of what flies over the gain factor, one line for each thing held; nan: not at the `first` period."""
    figure = Figure(figsize=(8.0, 4.6))
    panel = figure.add_subplot()
    panel.plot(factors, 1e3 * local, "--", color=GREY, label="local limit about hover, κ = 0")
    for (name, end), color, marker in zip(ends.items(), (RED, ORANGE, BLUE), "so."):
        panel.plot(factors, 1e3 * end, f"{marker}-", color=color, markersize=6, alpha=0.8, label=name)
        none = np.isnan(end)
        low = np.full(int(none.sum()), 0.03 if marker == "s" else 0.07)
        panel.plot(factors[none], low, "v", color=color, markersize=6, transform=panel.get_xaxis_transform())
    panel.plot([], [], "v", color=GREY, label=f"does not fly at {1e3 * first:g} ms")
    panel.set(xscale="log", yscale="log", xlabel="factor on k_η, k_θ and k_q", ylabel="flies up to a period of [ms]")
    ticks = (5, 10, 20, 40, 80, 160, 320)
    panel.set_yticks(ticks, [str(tick) for tick in ticks])
    panel.set_yticks([], minor=True)
    panel.set_xticks(factors, [f"{factor:g}" for factor in factors])
    panel.set_xticks([], minor=True)
    panel.legend(fontsize=8)
    return figure


def starts(flew: Array) -> Figure:
    """The share of directions whose start flies at all periods up to each, by size, with Wilson intervals."""
    figure = Figure(figsize=(8.0, 5.6))
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    colors = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(SIZES)))
    for panel, (name, *_), case in zip(panels, CASES, experiments.first_ends(flew), strict=True):
        for size, ends, color in zip(SIZES, case, colors, strict=True):
            counts = [int((ends >= period).sum()) for period in PERIODS]
            low, high = np.transpose([wilson(count, DIRECTIONS) for count in counts])
            panel.plot(1e3 * PERIODS, np.array(counts) / DIRECTIONS, color=color, label=f"{size:g} m")
            panel.fill_between(1e3 * PERIODS, low, high, color=color, alpha=0.12, linewidth=0.0)
        panel.set_title(name, fontsize=10)
    panels[0].legend(title="initial error", fontsize=8)
    figure.supxlabel("period [ms]")
    figure.supylabel("share that flies up to it")
    return figure


def monte_carlo(table: Any, axes: tuple[str, ...]) -> Figure:
    """Above, the share that flies over each axis with Wilson intervals; below, the ultimate bound of what flies."""
    figure = Figure(figsize=(10.0, 5.2))
    panels = figure.subplots(2, len(axes), sharey="row")
    flew = figures.flew(table).to_numpy()
    for (above, below), axis in zip(panels.T, axes, strict=True):
        x = table[axis].to_numpy(float)
        for part in np.array_split(np.argsort(x), 8):
            low, high = wilson(int(flew[part].sum()), len(part))
            share = flew[part].mean()
            span = [x[part].min(), x[part].max()]
            above.fill_between(span, low, high, color=BLUE, alpha=0.2, linewidth=0.0)
            above.plot(span, [share, share], color=BLUE)
        below.plot(x[flew], 1e3 * table["ultimate_bound"].to_numpy(float)[flew], ".", color=BLUE, markersize=4)
        below.set(xlabel=f"{axis} [{UNITS[axis]}]" if axis in UNITS else axis, yscale="log")
        for panel in (above, below):
            panel.set_xscale("log" if axis in TICKS else "linear")
            if axis in TICKS:
                panel.set_xticks(TICKS[axis], [f"{tick:g}" for tick in TICKS[axis]])
                panel.set_xticks([], minor=True)
    panels[0, 0].set(ylabel="share that flies", ylim=(0.0, 1.02))
    panels[1, 0].set_ylabel("ultimate bound [mm]")
    panels[1, 0].set_yticks((2, 5, 10, 20, 50), ("2", "5", "10", "20", "50"))
    panels[1, 0].set_yticks([], minor=True)
    figure.suptitle("above: eighths of the runs, with 95 % intervals of their shares", fontsize=10)
    return figure


def sobol(names: list[str], outcome: Array, rank: Array) -> Figure:
    """Total indices of each design, arrays (designs, axes, 2) of value and half-width, as points with their bars."""
    figure = Figure(figsize=(8.0, 3.6))
    panels = figure.subplots(1, 2, sharey=True)
    titles = ("whether a flight flies", "rank of the ultimate bound, diverged last")
    for panel, designs, title in zip(panels, (outcome, rank), titles, strict=True):
        for i, (design, color) in enumerate(zip(designs, (BLUE, ORANGE, RED, GREY), strict=False)):
            at = np.arange(len(names)) + 0.15 * (i - 1.5)
            panel.errorbar(design[:, 0], at, xerr=design[:, 1], fmt="o", color=color, markersize=3, capsize=2)
        panel.set_title(title, fontsize=10)
        panel.set_xlabel("total Sobol index")
        panel.axvline(0.0, color=GREY, linewidth=0.8)
    panels[0].set_yticks(range(len(names)), names)
    panels[0].invert_yaxis()
    return figure
