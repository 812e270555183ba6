"""The figure of the signals that are exchanged in a system of any FMUs."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.simulation.figures.drawn_run import DrawnRun
from orchestration.simulation.figures.lines import abreast, draw_line, label_time, name_runs, set_time_axis, wrapped
from orchestration.simulation.figures.palette import CYCLE, DASHES, MAX_LINES, MAX_PANELS
from orchestration.simulation.figures.style import Style
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.units import ColumnInfo
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.model import System

Panel = tuple[str, str | None, list[str]]
"""Name of the connection or component, unit, columns"""


def signals(runs: Sequence[DrawnRun], style: Style) -> Figure:
    """A panel for each connection and unit, its signals as the receiver has them.

    Without connections, the recorded outputs of each component.
    """
    return _in_panels([*_panels(runs[0].system, runs[0].described)], runs, style)


def of_name(name: str, runs: Sequence[DrawnRun], style: Style) -> Figure:
    """The recorded signals of this name, as `columns_of` finds them."""
    described = runs[0].described
    return _in_panels([*_by_unit(component_of(name), columns_of(name, described), described)], runs, style)


def columns_of(name: str, recorded: Iterable[str]) -> list[str]:
    """The column of this name, or those of the vector, or part of a component, of this name."""
    return [column for column in recorded if column == name or column.startswith(f"{name}.")]


def _in_panels(available: Sequence[Panel], runs: Sequence[DrawnRun], style: Style) -> Figure:
    """Of more than `MAX_PANELS` the first are drawn, and the number of signals of the others is stated."""
    contents = available[:MAX_PANELS]
    figure = style.figure(3.0 + 10.5 * max(1, len(contents)))
    panels = figure.subplots(max(1, len(contents)), 1, sharex=True, squeeze=False)[:, 0]
    for panel, (name, unit, columns) in zip(panels, contents):
        for run in runs:
            _draw(panel, run, columns, alone=len(runs) == 1)
        panel.set_ylabel(wrapped(labels.with_unit(labels.quantities(labels.words(name), columns), unit), 16))
        set_time_axis(panel, runs)
        handles, names = panel.get_legend_handles_labels()
        panel.legend(handles, names, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=abreast(names, style))
    label_time(panels[-1])
    if left_out := sum(len(columns) for _, _, columns in available[MAX_PANELS:]):
        figure.supxlabel(f"and {left_out} more signals")
    name_runs(figure, runs, style)
    return figure


def drawn(system: System, described: Mapping[str, ColumnInfo]) -> set[str]:
    """The columns that the figure of a run reads, of all that are `described`."""
    shown = [*_panels(system, described)][:MAX_PANELS]
    return {"time", *(column for _, _, columns in shown for column in columns)}


def _panels(system: System, described: Mapping[str, ColumnInfo]) -> Iterator[Panel]:
    of_connections = {
        x.name: [end if end in described else start for start, end in zip(x.start, x.end)] for x in system.connections
    }
    of_components = {
        name: [column for column in described if column.startswith(f"{name}.")] for name in system.components
    }
    for name, columns in (of_connections or of_components).items():
        yield from _by_unit(name, columns, described)


def _by_unit(owner: str, columns: Iterable[str], described: Mapping[str, ColumnInfo]) -> Iterator[Panel]:
    by_unit: dict[str | None, list[str]] = {}
    for column in columns:
        if column in described:
            by_unit.setdefault(described[column].unit, []).append(column)
    for unit, of_unit in by_unit.items():
        for first in range(0, len(of_unit), MAX_LINES):
            yield owner, unit, of_unit[first : first + MAX_LINES]


def _draw(panel: Axes, run: DrawnRun, columns: Sequence[str], *, alone: bool) -> None:
    """Colours distinguish the signals of one run, or several runs; dashes then the signals."""
    system = run.system
    applied = {end for x in system.connections for end in x.end}
    for k, column in enumerate(columns):
        if column not in run:
            continue
        held = column in applied or system.components[component_of(column)].sampling is not None
        draw_line(
            panel, run.time, run[column], drawstyle="steps-post" if held else "default",
            color=CYCLE[k % len(CYCLE)] if alone else run.color,
            linestyle="-" if alone else DASHES[k % len(DASHES)],
            label=labels.signal(column, run.described) if run.place == 0 else None,
        )  # fmt: skip
