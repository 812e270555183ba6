"""Figures of `findings/` that no command draws."""

from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from docs import experiments, theory
from docs.experiments import CASES, DIRECTIONS, PERIODS, SIZES
from orchestration.basics.statistics import wilson
from orchestration.figures.palette import BLUE, GREY, ORANGE, RED, SHADES
from orchestration.results import display_names as labels
from orchestration.studies import figures

Array = Any

TICKS = {"position_noise": (1e-4, 1e-3, 1e-2), "inertia_factor": (0.5, 1.0, 2.0)}
"""of the axes of the Monte Carlo study that are logarithmic"""
LABELS = {
    "jitter": "jitter of the sampling [s]",
    "loss": "share of messages lost [1]",
    "position_noise": "noise of the position [m]",
    "inertia_factor": "factor on the inertia [1]",
}


def gain_limits(factors: Array, ends: dict[str, Array], local: Array) -> Figure:
    """First ends of what flies over the gain factor, one line for each thing held; nan: at no period."""
    figure = Figure(figsize=(8.0, 4.6))
    panel = figure.add_subplot()
    panel.plot(factors, 1e3 * local, "--", color=GREY, label="local limit about hover, κ = 0")
    for (name, end), color, marker in zip(ends.items(), (RED, ORANGE, BLUE), "so."):
        panel.plot(factors, 1e3 * end, f"{marker}-", color=color, markersize=6, alpha=0.8, label=name)
        none = np.isnan(end)
        low = np.full(int(none.sum()), 0.03 if marker == "s" else 0.07)
        panel.plot(factors[none], low, "v", color=color, markersize=6, transform=panel.get_xaxis_transform())
    panel.plot([], [], "v", color=GREY, label="does not fly at any")
    panel.set(xscale="log", yscale="log", xlabel="factor on k_η, k_θ and k_q [1]")
    panel.set_ylabel("flies up to a period of [ms]")
    ticks = (5, 10, 20, 40, 80, 160, 320)
    panel.set_yticks(ticks, [str(tick) for tick in ticks])
    panel.set_yticks([], minor=True)
    panel.set_xticks(factors, [f"{factor:g}" for factor in factors])
    panel.set_xticks([], minor=True)
    panel.legend()
    return figure


def starts(flew: Array) -> Figure:
    """The share of directions whose start flies at all periods up to each, by size, with Wilson intervals."""
    figure = Figure(figsize=(8.0, 5.6))
    panels = figure.subplots(2, 2, sharex=True, sharey=True).ravel()
    colors = matplotlib.colormaps[SHADES](np.linspace(0.0, 0.9, len(SIZES)))
    for panel, (name, *_), case in zip(panels, CASES, experiments.first_ends(flew), strict=True):
        for size, ends, color in zip(SIZES, case, colors, strict=True):
            counts = [int((ends >= period).sum()) for period in PERIODS]
            low, high = np.transpose([wilson(count, DIRECTIONS) for count in counts])
            panel.plot(1e3 * PERIODS, np.array(counts) / DIRECTIONS, color=color, label=f"{size:g} m")
            panel.fill_between(1e3 * PERIODS, low, high, color=color, alpha=0.12, linewidth=0.0)
        panel.set_title(name)
    panels[0].legend(title="initial error")
    figure.supxlabel("period [ms]")
    figure.supylabel("share that flies up to it [1]")
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
        below.set(xlabel=LABELS.get(axis, axis), yscale="log")
        for panel in (above, below):
            panel.set_xscale("log" if axis in TICKS else "linear")
            if axis in TICKS:
                panel.set_xticks(TICKS[axis], [f"{tick:g}" for tick in TICKS[axis]])
                panel.set_xticks([], minor=True)
    panels[0, 0].set(ylabel="share that flies [1]", ylim=(0.0, 1.02))
    panels[1, 0].set_ylabel("largest position error,\nlast third [mm]")
    panels[1, 0].set_yticks((2, 5, 10, 20, 50), ("2", "5", "10", "20", "50"))
    panels[1, 0].set_yticks([], minor=True)
    figure.suptitle("above: eighths of the runs, with 95 % intervals of their shares")
    return figure


def sobol(names: list[str], outcome: Array, rank: Array) -> Figure:
    """Total indices of each design, arrays (designs, axes, 2) of value and half-width, as points with their bars."""
    figure = Figure(figsize=(8.0, 3.6))
    panels = figure.subplots(1, 2, sharey=True)
    titles = ("whether a flight flies", "rank of the ultimate bound, diverged last")
    for panel, designs, title in zip(panels, (outcome, rank), titles, strict=True):
        for i, (design, color) in enumerate(zip(designs, (BLUE, ORANGE, RED, GREY), strict=False)):
            at = np.arange(len(names)) + 0.15 * (i - 1.5)
            panel.errorbar(
                design[:, 0], at, xerr=design[:, 1], fmt="o", color=color, markersize=3, capsize=2, label=f"{i + 1}"
            )
        panel.set_title(title)
        panel.set_xlabel("total Sobol index [1]")
        panel.axvline(0.0, color=GREY, linewidth=0.8)
    panels[0].set_yticks(range(len(names)), map(labels.words, names))
    panels[0].invert_yaxis()
    panels[1].legend(title="design, with 95 % intervals", loc="center right")
    return figure


def decay(curves: dict[float, tuple[Array, Array]], medians: Array) -> Figure:
    """Left the error over time by exponent; right median rates, shape (exponents, periods, decades)."""
    figure = Figure(figsize=(10.0, 4.2))
    left, right = figure.subplots(1, 2)
    colors = matplotlib.colormaps[SHADES](np.linspace(0.0, 0.9, len(curves)))
    for (exponent, (time, error)), color in zip(curves.items(), colors, strict=True):
        left.plot(time, 1e3 * error, color=color, linewidth=1.0, label=f"β_t = {exponent:g}")
    left.axhline(1e3 * theory.LAYER, color=GREY, linestyle="--", linewidth=0.8)
    left.set(yscale="log", xlabel="time [s]", ylabel="position error, largest axis [mm]", ylim=(1e-5, 1e4))
    left.legend()
    marks = {0: ("o", "100 to 10 mm"), 1: ("s", "10 to 1 mm"), 2: ("^", "1 to 0.1 mm"), 3: ("v", "0.1 to 0.01 mm")}
    for i, (marker, label) in marks.items():
        filled = BLUE if i < 2 else "none"
        right.plot(
            theory.EXPONENTS, medians[:, 0, i], marker, color=BLUE, markerfacecolor=filled, markersize=6, label=label
        )
    right.plot(
        theory.EXPONENTS, [theory.expected_rate(b) for b in theory.EXPONENTS], "-", color=GREY, label="2k/(3 + β_t)"
    )
    right.set(xlabel="exponent of the surface β_t [1]", ylabel="rate of the error at 1 ms [1/s]", ylim=(0.0, 2.5))
    right.legend(title="median over the starts")
    return figure


def loop_gains(found: dict[str, Array]) -> Figure:
    """Local limits over the factor on a gain or a loop's gains, and the attitude loop's by itself."""
    figure = Figure(figsize=(10.0, 4.2))
    panels = figure.subplots(1, 2, sharey=True)
    for panel, names in zip(panels, (tuple(theory.GAINS), ("attitude", "translation")), strict=True):
        for name, color, marker in zip(names, (RED, ORANGE, GREY, BLUE, "black"), "osv^x"):
            panel.plot(theory.FACTORS, 1e3 * found[name], f"{marker}-", color=color, markersize=5, label=name)
        panel.set(xscale="log", yscale="log", xlabel="factor on the gain [1]")
        panel.set_xticks((0.25, 0.5, 1.0, 2.0, 4.0), ("0.25", "0.5", "1", "2", "4"))
        panel.set_xticks([], minor=True)
        panel.set_yticks((20, 40, 80, 160, 320), ("20", "40", "80", "160", "320"))
        panel.set_yticks([], minor=True)
    alone = [theory.of_attitude_alone(*(15.0 * factor,) * 2, 15.0 * factor) for factor in theory.FACTORS]
    panels[1].plot(theory.FACTORS, 1e3 * np.array(alone), "--", color=GREY, label="attitude loop by itself")
    panels[0].set_ylabel("local limit of the period [ms]")
    for panel in panels:
        panel.legend()
    return figure


def margins(constant: Array, certain: Array, breaking: Array) -> Figure:
    """Over the period: what delay is stood constantly, how much jitter certainly, how much not."""
    figure = Figure(figsize=(8.0, 4.4))
    panel, periods = figure.add_subplot(), np.array(theory.MARGIN_PERIODS)
    panel.fill_between(1e3 * periods, 1e3 * certain, 1e3 * breaking, color=GREY, alpha=0.15, linewidth=0.0)
    panel.plot(1e3 * periods, 1e3 * constant, "--", color=GREY, label="constant delay: exact limit")
    panel.plot(1e3 * periods, 1e3 * breaking, "v-", color=RED, label="jitter: a sequence breaks hover")
    panel.plot(1e3 * periods, 1e3 * certain, "^-", color=BLUE, label="jitter: no sequence can (Kao and Lincoln)")
    panel.set(xlabel="period [ms]", ylabel="delay, or jitter of the delay [ms]", ylim=(0.0, None))
    panel.legend()
    return figure
