"""The figures of the sliding law: its energy function over time, and phase portraits with its surface."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import instants_of
from orchestration.quadrotor.scenarios.wiring import ENERGY, SURFACE, components
from orchestration.simulation.figures.drawn_run import DrawnRun, title
from orchestration.simulation.figures.lines import (
    label_time,
    legend_of_runs,
    logarithmic,
    name_runs,
    positive,
    set_time_axis,
)
from orchestration.simulation.figures.palette import GREY
from orchestration.simulation.figures.style import Style
from orchestration.simulation.results import display_names as labels

ERROR, RATE = (tuple(f"controller.{c}" for c in components(name)) for name in ("position_error", "velocity_error"))


def phase(runs: Sequence[DrawnRun], style: Style) -> Figure | None:
    """A panel each for x, y and z, as of the samples; None if no controller has its errors as outputs."""
    with_errors = [run for run in runs if run.has((*ERROR, *RATE))]
    if not with_errors:
        return None
    columns = 3 if style.is_wide else 1
    figure = style.figure(24.0 if columns == 3 else 48.0)
    panels = figure.subplots(3 // columns, columns, squeeze=False).ravel()
    for k, (panel, axis) in enumerate(zip(panels, "xyz", strict=True)):
        for run in with_errors:
            _draw(panel, run, run[ERROR[k]], run[RATE[k]], alone=len(runs) == 1)
        _draw_surfaces(panel, with_errors)
        panel.set(
            xlabel=labels.with_unit(f"position error {axis}", "m"),
            ylabel=labels.with_unit(f"velocity error {axis}", "m/s"),
        )
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names))
    name_runs(figure, runs, style)
    return figure


def _draw(panel: Axes, run: DrawnRun, error: Floats, rate: Floats, *, alone: bool) -> None:
    color, first = run.color, run.place == 0
    panel.plot(error, rate, color=color, linestyle=run.dashes, label="flown" if alone else None)
    for k, marker, what in ((0, "o", "start"), (-1, "s", "end")):
        filled = "white" if what == "start" else color
        panel.plot(
            error[k], rate[k], marker, color=color, markerfacecolor=filled, label=what if first else None, zorder=3
        )


def _draw_surfaces(panel: Axes, runs: Sequence[DrawnRun]) -> None:
    """The surface s = 0 of each law that has one, over the visible range."""
    panel.margins(0.06)
    seen, rates = panel.get_xlim(), panel.get_ylim()
    panel.set(xlim=seen, ylim=rates)
    size = max(abs(end) for end in seen)
    bend = np.geomspace(1e-6 * size, size, 200)
    error = np.concatenate([-bend[::-1], bend])
    drawn: list[Floats] = []
    for run in runs:
        rate = surface(error, run.parameters)
        if rate is not None and not any(np.array_equal(rate, other) for other in drawn):
            panel.plot(
                error, rate, color=GREY, linestyle="--", label="sliding surface s = 0" if not drawn else None, zorder=1
            )
            drawn.append(rate)


def surface(error: Floats, parameters: Mapping[str, float]) -> Floats | None:
    """The rate of the error on the sliding surface (19)-(21) [m/s]; None if the controller has no such surface.

    Where `surface` of the law is 0, solved for the rate: this package does not import the sources of FMUs.
    """
    if not all(name in parameters for name in SURFACE):
        return None
    k_s, beta_t, epsilon = (parameters[name] for name in SURFACE)
    size = np.abs(error)
    return np.where(size < epsilon, -k_s * error, -k_s * size**beta_t * np.sign(error))


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
    panel.set_ylabel(labels.with_unit("energy L", unit))
    set_time_axis(panel, runs)
    label_time(panel)
    if style.has_titles:
        panel.set_title(title(runs))
    legend_of_runs(figure, runs, style)
    return figure


def _sampled(run: DrawnRun) -> npt.NDArray[np.bool_]:
    """Mask of the visible rows that are sampling instants."""
    return np.isin(instants_of(run.time), instants_of(run.instants("sampled")))
