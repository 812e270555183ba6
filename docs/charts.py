"""Figures of `findings/` that are drawn by no command."""

import re
from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from docs import theory
from orchestration.simulation.figures.palette import BLUE, DASHES, GREY, ORANGE, RED, SHADES
from orchestration.simulation.figures.style import DOCS

Array = Any


def symbols(text: str) -> str:
    """The text with its symbols as mathematics: an underscore is an index."""
    return re.sub(r"(\w)_(\w)", r"$\1_\2$", text)


def gain_limits(factors: Array, ends: Mapping[str, Mapping[str, Array]], local: Array) -> Figure:
    """The largest periods at which flights survive and settle, over the gain factor; a line for each way of scaling."""
    figure = DOCS.figure(32.0)
    panels = figure.subplots(1, 2, sharey=True)
    for panel, fate in zip(panels, ("survive", "settle"), strict=True):
        panel.plot(factors, 1e3 * local, "--", color=GREY, label="local limit about hover, κ = 0")
        for (name, end), color, marker in zip(ends.items(), (RED, ORANGE, BLUE), "so.", strict=True):
            panel.plot(
                factors, 1e3 * end[fate], f"{marker}-", color=color, markersize=6, alpha=0.8, label=symbols(name)
            )
        panel.set(title=f"{fate} up to", xlabel=symbols("factor on k_η, k_θ and k_q"))
        _ticks(panel, factors[::2], (5, 10, 20, 40, 80, 160, 320))
    panels[0].set_ylabel("period [ms]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def energy(curves: Mapping[float, tuple[Array, Array, Array]]) -> Figure:
    """The energy and the position error over time, by the weight of the coupling."""
    figure = DOCS.figure(28.0)
    left, right = figure.subplots(1, 2, sharex=True)
    for (kappa, (time, energy, error)), color, dashes in zip(curves.items(), (BLUE, RED, ORANGE), DASHES):
        left.plot(time, energy, dashes, color=color, linewidth=1.0, label=f"κ = {kappa:g}")
        right.plot(time, error, dashes, color=color, linewidth=1.0)
    left.set(yscale="log", xlabel="time [s]", ylabel=symbols("energy L_κ [J]"), xlim=(0.0, 8.0), ylim=(1e-4, 1e5))
    right.set(yscale="log", xlabel="time [s]", ylabel="position error |e| [m]", ylim=(1e-3, 30.0))
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def decay(curves: Mapping[float, tuple[Array, Array]], medians: Array) -> Figure:
    """Left: the error over time by exponent; right: median rates, shape (exponents, decades)."""
    figure = DOCS.figure(38.0)
    left, right = figure.subplots(1, 2)
    colors = matplotlib.colormaps[SHADES](np.linspace(0.0, 0.9, len(curves)))
    for (exponent, (time, error)), color in zip(curves.items(), colors, strict=True):
        left.plot(time, 1e3 * error, color=color, linewidth=1.0, label=symbols(f"β_t = {exponent:g}"))
    left.axhline(1e3 * theory.LAYER, color=GREY, linestyle="--", linewidth=0.8, label="boundary layer ε")
    left.set(
        yscale="log", xlabel="time [s]", ylabel="position error, largest axis [mm]", xlim=(0, 25), ylim=(1e-5, 1e4)
    )
    for i, (marker, high, low) in enumerate(zip("os^v", theory.BOUNDS, theory.BOUNDS[1:])):
        inside = high <= theory.LAYER
        right.plot(theory.EXPONENTS, medians[:, i], marker, color=BLUE, markerfacecolor="none" if inside else BLUE,
                   label=f"{1e3 * high:g} to {1e3 * low:g} mm")  # fmt: skip
    expected = [theory.expected_rate(exponent) for exponent in theory.EXPONENTS]
    right.plot(theory.EXPONENTS, expected, "-", color=GREY, label=symbols("2k/(3 + β_t)"))
    right.set(xlabel=symbols("exponent of the surface β_t"), ylabel="rate of the error at 1 ms [1/s]", ylim=(0.0, 2.0))
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3)
    right.legend(title="median over the starts", loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2)
    return figure


def loop_gains(found: Mapping[str, Array]) -> Figure:
    """Local limits over the factor on a gain or a loop's gains, and those of the attitude loop alone."""
    figure = DOCS.figure(32.0)
    panels = figure.subplots(1, 2, sharey=True)
    for panel, names in zip(panels, (tuple(theory.GAINS), ("attitude", "translation")), strict=True):
        for name, color, marker in zip(names, (RED, ORANGE, GREY, BLUE, "black"), "osv^x"):
            panel.plot(theory.FACTORS, 1e3 * found[name], f"{marker}-", color=color, markersize=5, label=symbols(name))
        panel.set_xlabel("factor on the gain")
        _ticks(panel, (0.25, 0.5, 1.0, 2.0, 4.0), (20, 40, 80, 160, 320))
    alone = [1e3 * theory.of_attitude_alone(*(15.0 * factor,) * 3) for factor in theory.FACTORS]
    panels[1].plot(theory.FACTORS, alone, "--", color=GREY, label="attitude loop by itself")
    panels[0].set_ylabel("local limit of the period [ms]")
    for panel in panels:
        panel.legend()
    return figure


def margins(constant: Array, certain: Array, breaking: Array) -> Figure:
    """Over the period: the tolerated constant delay, the jitter certainly tolerated, and the jitter that is not."""
    figure = DOCS.figure(32.0)
    panel, periods = figure.add_subplot(), 1e3 * np.array(theory.MARGIN_PERIODS)
    panel.fill_between(periods, 1e3 * certain, 1e3 * breaking, color=GREY, alpha=0.15, linewidth=0.0)
    panel.plot(periods, 1e3 * constant, "--", color=GREY, label="constant delay: exact limit")
    panel.plot(periods, 1e3 * breaking, "v-", color=RED, label="jitter: a sequence breaks hover")
    panel.plot(periods, 1e3 * certain, "^-", color=BLUE, label="jitter: no sequence can (Kao and Lincoln)")
    panel.set(xlabel="period [ms]", ylabel="delay, or jitter of the delay [ms]", ylim=(0.0, None))
    panel.legend()
    return figure


def wind(costs: Mapping[str, Array]) -> Figure:
    """Rms of position and torque under a white force, over period and delay, up to where they are not finite."""
    figure = DOCS.figure(36.0)
    panels = figure.subplots(1, 2, sharey=True)
    periods, delays = 1e3 * np.array(theory.WIND_PERIODS), 1e3 * np.array(theory.WIND_DELAYS)
    for panel, name, scale, levels, label in (
        (panels[0], "position_rmse", 1e3, np.arange(0.209, 0.2251, 0.002), "position [mm]"),
        (panels[1], "torque_rms", 1e3, np.array([20, 25, 30, 40, 50, 70, 100, 200, 400]), "torque [mN·m]"),
    ):
        norm = BoundaryNorm(levels, 256, extend="both")
        shades = panel.pcolormesh(periods, delays, scale * costs[name], norm=norm, cmap=SHADES, shading="nearest")
        panel.contour(periods, delays, costs["radius"], [1.0], colors=[RED])
        panel.grid(False)
        figure.colorbar(shades, ax=panel, label=f"rms of the {label}", ticks=levels, format="%.4g")
        panel.set(xlabel="period [ms]")
    panels[0].set_ylabel("delay of each command [ms]")
    limit = Line2D([], [], color=RED, label="beyond it hover is not stable, and nothing is finite")
    figure.legend(handles=[limit], loc="outside lower center")
    return figure


def _ticks(panel: Axes, x: Array, y: Array) -> None:
    """Logarithmic axes with these numbers."""
    panel.set(xscale="log", yscale="log")
    for axis, values in ((panel.xaxis, x), (panel.yaxis, y)):
        axis.set_ticks(values, [f"{value:g}" for value in values])
        axis.set_ticks([], minor=True)
