"""The four errors: their norms, and component by component as in Fig. 3 of the paper."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.foundation.basics.simulator import Floats
from orchestration.quadrotor.scenarios.measures import desired
from orchestration.quadrotor.scenarios.wiring import POSITION, components
from orchestration.simulation.figures import lines
from orchestration.simulation.figures.drawn_run import DrawnRun
from orchestration.simulation.figures.palette import BLUE, GREEN, RED
from orchestration.simulation.figures.style import Style
from orchestration.simulation.results import display_names as labels

AXES = tuple(zip("xyz", (BLUE, RED, GREEN), ("-", "--", "-."), strict=True))


@dataclass(frozen=True, kw_only=True)
class Error:
    """One of the four."""

    name: str
    unit: str
    of: Callable[[DrawnRun], Floats | None]
    """shape (n, 3); None: not an output of the controller"""


def errors(runs: Sequence[DrawnRun], style: Style) -> Figure:
    """Norms of the errors on logarithmic axes; position at every row, the others as of the last sample."""
    figure, panels = _panels(runs, style)
    for panel, error in panels:
        for run in runs:
            values = error.of(run)
            if values is not None:
                norm = lines.positive(np.linalg.norm(values, axis=1))
                lines.draw_line(panel, run.time, norm, color=run.color, linestyle=run.dashes, label=run.name)
        lines.logarithmic(panel)
        panel.set_ylabel(lines.wrapped(labels.with_unit(f"{error.name}, norm", error.unit)))
        panel.minorticks_off()
        lines.set_time_axis(panel, runs)
    return figure


def components_of_errors(runs: Sequence[DrawnRun], style: Style) -> Figure:
    """x, y and z of each error; with several runs a panel for each component."""
    if len(runs) > 1:
        return _overlaid(runs, style)
    run = cut(runs[0])
    figure, panels = _panels([run], style)
    for panel, error in panels:
        draw_components(panel, run, error, style)
    rest = None if run is runs[0] else f"flat from there to {runs[0].span[1]:g} s"
    figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3, title=rest)
    return figure


FLAT, CUT = 0.02, 0.2
"""Share of its range within which an error is flat; share of the run beyond which it is cut if all errors are"""


def cut(run: DrawnRun) -> DrawnRun:
    """The run up to where its errors are flat, if they are for at least four fifths of it and it has no window."""
    end = run.span[1]
    if run.window is not None or not end:
        return run
    last = 0.0
    for error in _available_errors([run]):
        values = error.of(run)
        assert values is not None
        moves = np.abs(values - values[-1]) > FLAT * np.ptp(values)
        last = max(last, float(run.time[moves.any(axis=1)].max(initial=0.0)))
    return replace(run, window=(0.0, float(np.ceil(1.2 * last)))) if 0.0 < last <= CUT * end else run


def draw_components(panel: Axes, run: DrawnRun, error: Error, style: Style, *, clips: bool = True) -> None:
    """x, y and z of an error that the run has."""
    values = error.of(run)
    assert values is not None
    for k, (axis, color, dashes) in enumerate(AXES):
        lines.draw_line(panel, run.time, values[:, k], color=color, linestyle=dashes, label=axis)
    panel.set_ylabel(lines.wrapped(labels.with_unit(error.name, error.unit)))
    lines.set_time_axis(panel, [run])
    if clips:
        lines.clip_peaks(panel, [(run.time, values[:, k]) for k in range(3)], error.unit, style)


def _overlaid(runs: Sequence[DrawnRun], style: Style) -> Figure:
    """A row for each error, a column for each component, a line for each run."""
    available = _available_errors(runs)
    figure = style.figure(2.0 + 11.0 * len(available))
    rows = figure.subplots(len(available), 3, sharex=True, squeeze=False)
    for i, (row, error) in enumerate(zip(rows, available, strict=True)):
        for k, panel in enumerate(row):
            drawn = [(run, values[:, k]) for run in runs if (values := error.of(run)) is not None]
            for run, values in drawn:
                lines.draw_line(panel, run.time, values, color=run.color, linestyle=run.dashes, label=run.name)
            lines.set_time_axis(panel, runs)
            panel.set_ylabel(lines.wrapped(labels.with_unit(f"{error.name} {'xyz'[k]}", error.unit), 18))
            if i == len(available) - 1:
                lines.label_time(panel)
    lines.legend_of_runs(figure, runs, style)
    return figure


def _panels(runs: Sequence[DrawnRun], style: Style) -> tuple[Figure, list[tuple[Axes, Error]]]:
    """A figure with legend and title, and a panel for each available error."""
    available = _available_errors(runs)
    columns = 2 if style.is_wide and len(available) > 1 else 1
    rows = -(-len(available) // columns)
    figure = style.figure(3.0 + 14.0 * rows)
    panels = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for panel in panels[len(available) :]:
        panel.set_visible(False)
    for panel in panels[max(0, len(available) - columns) : len(available)]:
        lines.label_time(panel, max(run.span[1] for run in runs))
    lines.name_runs(figure, runs, style)
    return figure, list(zip(panels, available))


def _available_errors(runs: Sequence[DrawnRun]) -> list[Error]:
    return [error for error in ERRORS if any(error.of(run) is not None for run in runs)]


def _position_error(run: DrawnRun) -> Floats | None:
    position = run.stacked([f"plant.{name}" for name in POSITION])
    return position - desired(run.signals)[run.visible]


def _output_of_controller(name: str) -> Callable[[DrawnRun], Floats | None]:
    columns = [f"controller.{component}" for component in components(name)]
    return lambda run: run.stacked(columns) if run.has(columns) else None


ERRORS = (
    Error(name="position error", unit="m", of=_position_error),
    Error(name="velocity error", unit="m/s", of=_output_of_controller("velocity_error")),
    Error(name="attitude error", unit="1", of=_output_of_controller("attitude_error")),
    Error(name="angular velocity error", unit="rad/s", of=_output_of_controller("angular_velocity_error")),
)
"""P̃, Ṽ, q̃ and Ω̃"""
