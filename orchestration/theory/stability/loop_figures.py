"""Figures of loops: gain, phase and sensitivity over the frequency, and steps over time."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.figures.palette import CYCLE, DASHES, GREY
from orchestration.simulation.figures.style import SCREEN, Style
from orchestration.theory.stability.frequency import Bode, Complexes
from orchestration.theory.stability.step_response import Step


def bode_figure(result: Bode, style: Style = SCREEN) -> Figure:
    """The gain of each loop, its phase, and its sensitivity; a dot is where the gain is 1."""
    figure = style.figure(66.0)
    above, middle, below = figure.subplots(3, sharex=True)
    for i, (gain, loop) in enumerate(zip(result.gains, result.loops, strict=False)):
        how = {"color": CYCLE[i % len(CYCLE)], "linestyle": DASHES[i % len(DASHES)]}
        phase = _phase(gain)
        above.plot(result.frequencies, np.abs(gain), label=loop.output, **how)
        middle.plot(result.frequencies, phase, **how)
        below.plot(result.frequencies, np.abs(1.0 / (1.0 + gain)), **how)
        if loop.crossover is not None:
            above.plot(loop.crossover, 1.0, "o", color=how["color"])
            middle.plot(loop.crossover, np.interp(loop.crossover, result.frequencies, phase), "o", color=how["color"])
    for axes in (above, below):
        axes.axhline(1.0, color=GREY, linewidth=1.0, linestyle=":")
        axes.set_yscale("log")
    middle.axhline(-180.0, color=GREY, linewidth=1.0, linestyle=":")
    middle.yaxis.set_major_locator(MultipleLocator(90.0))
    above.set(ylabel="loop gain |L|", xscale="log")
    middle.set(ylabel="phase of L [°]")
    below.set(ylabel="sensitivity |1 / (1 + L)|", xlabel="frequency [rad/s], up to half the sampling rate")
    below.set_xlim(result.frequencies[0], result.frequencies[-1])
    figure.legend(loc="outside lower center", ncols=2)
    return figure


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
            label=loop.output,
        )  # fmt: skip
    axes.axhline(1.0, color=GREY, linewidth=1.0, linestyle=":")
    axes.set(xlabel="time [s]", ylabel="taken back of a step of 1", xlim=(0.0, result.times[-1]))
    figure.legend(loc="outside lower center", ncols=2)
    return figure
