"""Figures of loops: over the frequency, after a step, and their poles over a quantity."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import MultipleLocator

from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures.palette import BLACK, BLUE, CYCLE, DASHES, GREY, RED, SHADES
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.simulation.results.display_names import signal
from orchestration.simulation.results.quantities import setting
from orchestration.theory.stability.frequency import Bode, LoopMargins
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.root_locus import RootLocus
from orchestration.theory.stability.step_response import Step

SHOWN = 1.4
"""Largest part of a pole that is drawn"""


def bode_figure(result: Bode, style: Style = SCREEN) -> Figure:
    """The gain of each loop, its phase, and its sensitivity; lines are gain and phase margins, at their crossovers."""
    figure = style.figure(66.0)
    above, middle, below = figure.subplots(3, sharex=True)
    above.set_yscale("log")
    below.set_yscale("log")
    for i, (gain, loop) in enumerate(zip(result.gains, result.loops, strict=False)):
        color = CYCLE[i % len(CYCLE)]
        how = {"color": color, "linestyle": DASHES[i % len(DASHES)]}
        phase = _phase(gain)
        name = signal(loop.output, {})
        label = f"{name}: {_sizes(loop)}" if len(result.loops) > 1 else name
        above.plot(result.frequencies, np.abs(gain), label=label, **how)
        middle.plot(result.frequencies, phase, **how)
        below.plot(result.frequencies, np.abs(1.0 / (1.0 + gain)), **how)
        _mark_margins((above, middle), loop, result.frequencies, phase, color, labelled=len(result.loops) == 1)
    for axes in (above, below):
        axes.axhline(1.0, color=GREY, linewidth=1.0, linestyle=":")
    middle.axhline(-180.0, color=GREY, linewidth=1.0, linestyle=":")
    middle.yaxis.set_major_locator(MultipleLocator(90.0))
    above.set(ylabel="loop gain |L|", xscale="log")
    middle.set(ylabel="phase of L [°]")
    below.set(ylabel="sensitivity |1 / (1 + L)|", xlabel="frequency [rad/s], up to half the sampling rate")
    below.set_xlim(result.frequencies[0], result.frequencies[-1])
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _sizes(loop: LoopMargins) -> str:
    """The margins of a loop in the legend, where those of several loops would hide each other."""
    sizes = [f"× {one.factor:.3g}" for one in loop.gain_margins]
    return ", ".join([*sizes, "infinite" if loop.phase_margin is None else f"{loop.phase_margin:.3g}°"])


def _mark_margins(
    panels: tuple[Axes, Axes], loop: LoopMargins, frequencies: Floats, phase: Floats, color: str, *, labelled: bool
) -> None:
    """The margins as lines at their crossovers, from where they would be none, with their sizes beside the middle."""
    above, middle = panels
    lines = [
        (above, max(one.frequency, frequencies[0]), 1.0, 1.0 / one.factor, f"× {one.factor:.3g}")
        for one in loop.gain_margins
    ]
    if loop.crossover is not None and loop.phase_margin is not None:
        above.plot(loop.crossover, 1.0, "o", color=color)
        reached = float(np.interp(loop.crossover, frequencies, phase))
        lines.append((middle, loop.crossover, reached - loop.phase_margin, reached, f"{loop.phase_margin:.3g}°"))
    for axes, at, none, end, size in lines:
        axes.plot([at, at], [none, end], color=color, linewidth=2.0, clip_on=False)
        place = math.sqrt(none * end) if axes is above else 0.5 * (none + end)
        if labelled:
            axes.annotate(
                size, (at, place), xytext=(4.0, 0.0), textcoords="offset points", verticalalignment="center",
                color=color,
            )  # fmt: skip


def _phase(gain: Complexes) -> Floats:
    """The phase without jumps [°], its median in the turn below 0."""
    phase = np.degrees(np.unwrap(np.angle(gain)))
    unturned: Floats = phase - 360.0 * np.ceil(np.median(phase) / 360.0)
    return unturned


def step_figure(result: Step, style: Style = SCREEN) -> Figure:
    """What the law takes back of a step that is added to each command, sample by sample."""
    figure = style.figure(38.0)
    axes = figure.add_subplot()
    for i, (response, loop) in enumerate(zip(result.responses, result.loops, strict=True)):
        axes.step(
            result.times, response, where="post", color=CYCLE[i % len(CYCLE)], linestyle=DASHES[i % len(DASHES)],
            label=signal(loop.output, {}),
        )  # fmt: skip
    axes.axhline(1.0, color=GREY, linewidth=1.0, linestyle=":")
    axes.set(xlabel="time [s]", ylabel="taken back of a step of 1", xlim=(0.0, result.times[-1]))
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def locus_figure(result: RootLocus, style: Style = SCREEN) -> Figure:
    """The poles beside the unit circle, shaded by the quantity, and the spectral radius over it; crosses leave it."""
    across = setting(result.of if "." in result.of else f"timing.{result.of}", result.values, result.unit)
    figure = style.figure(36.0 if style.is_wide else 80.0)
    plane, over = figure.subplots(1, 2) if style.is_wide else figure.subplots(2, 1)
    values = across.of(result.values)
    plane.axhline(0.0, color=GREY, linewidth=0.5)
    plane.axvline(0.0, color=GREY, linewidth=0.5)
    plane.add_patch(Circle((0.0, 0.0), 1.0, fill=False, color=BLACK, linewidth=1.0))
    is_there = np.isfinite(result.poles) & (np.abs(result.poles) < 2.0 * SHOWN)
    poles = result.poles[is_there]
    shade = np.broadcast_to(values[:, None], result.poles.shape)[is_there]
    dots = plane.scatter(poles.real, poles.imag, c=shade, cmap=SHADES, s=10.0, linewidths=0.0)
    figure.colorbar(dots, ax=plane, label=across.title, location="bottom", aspect=30.0)
    over.plot(values, result.radius, color=BLUE)
    over.axhline(1.0, color=BLACK, linewidth=1.0)
    for one in result.crossings:
        plane.plot([one.real] * 2, [one.imaginary, -one.imaginary], "x", color=RED, linestyle="none")
        at = (float(across.of(one.value)), 1.0)
        over.plot(*at, "x", color=RED)
        left = at[0] > 0.5 * (values[0] + values[-1])
        beside = {"xytext": (-4.0, 5.0) if left else (4.0, -12.0), "ha": "right" if left else "left"}
        over.annotate(across.text_of(one.value, 4), at, textcoords="offset points", **beside)
    plane.set(xlabel="real part", ylabel="imaginary part", xlim=(-SHOWN, SHOWN), ylim=(-SHOWN, SHOWN), aspect="equal")
    over.set(xlabel=across.title, ylabel="spectral radius", xlim=(values[0], values[-1]))
    low, high = float(result.radius.min()), float(result.radius.max())
    room = 0.05 * (max(high, 1.0) - min(low, 1.0))
    over.set_ylim(min(low, 1.0) - room, max(high, 1.0) + room)
    return figure
