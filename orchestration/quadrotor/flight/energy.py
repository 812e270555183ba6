"""The energy function of the law over time."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from orchestration.foundation.basics.times import instants_of
from orchestration.quadrotor.scenarios.wiring import ENERGY
from orchestration.simulation.figures.drawn_run import DrawnRun, title
from orchestration.simulation.figures.lines import TIME, legend_of_runs, logarithmic, positive, quantity, set_time_axis
from orchestration.simulation.figures.style import Style

COLUMN = f"controller.{ENERGY}"


def energy(runs: Sequence[DrawnRun], style: Style) -> Figure | None:
    """L (33) at the samples; None if no controller has this variable, or none has sampled."""
    with_energy = [run for run in runs if COLUMN in run and _sampled(run).any()]
    if not with_energy:
        return None
    figure = style.figure(24.0)
    panel = figure.add_subplot()
    for run in with_energy:
        at = _sampled(run)
        panel.plot(run.time[at], positive(run[COLUMN][at]), color=run.color, linestyle=run.dashes, label=run.name)
    unit = with_energy[0].described[COLUMN].unit
    logarithmic(panel)
    panel.set(xlabel=TIME, ylabel=quantity("energy L", unit))
    set_time_axis(panel, runs)
    if style.has_titles:
        panel.set_title(title(runs))
    legend_of_runs(figure, runs, style)
    return figure


def _sampled(run: DrawnRun) -> npt.NDArray[np.bool_]:
    """Mask of the visible rows that are sampling instants."""
    return np.isin(instants_of(run.time), instants_of(run.instants("sampled")))
