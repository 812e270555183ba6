"""What is exchanged in a system of any FMUs."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from orchestration.figures.lines import TIME, legend_of_runs, quantity, see
from orchestration.figures.palette import CYCLE
from orchestration.figures.run import Run, title
from orchestration.figures.style import Style
from orchestration.results import display_names as labels
from orchestration.system.model import component_of

MOST_LINES = 8
"""In one panel"""


def signals(runs: Sequence[Run], style: Style) -> Figure:
    """A panel for each connection, its signals as the receiver has them.

    Of a system without connections, the recorded outputs of each component.
    """
    groups = _groups(runs[0])
    figure = style.figure(3.0 + 10.5 * max(1, len(groups)))
    panels = figure.subplots(max(1, len(groups)), 1, sharex=True, squeeze=False)[:, 0]
    for panel, (name, columns) in zip(panels, groups.items()):
        for run in runs:
            _draw(panel, run, columns, alone=len(runs) == 1)
        units = {runs[0].described[column].unit for column in columns}
        panel.set_ylabel(quantity(labels.words(name), units.pop() if len(units) == 1 else None))
        see(panel, runs)
        if columns:
            panel.legend(loc="upper right")
    if style.has_titles and title(runs):
        panels[0].set_title(title(runs))
    panels[-1].set_xlabel(TIME)
    legend_of_runs(figure, runs, style)
    return figure


def _groups(run: Run) -> dict[str, list[str]]:
    """The columns of each panel."""
    carried = {
        x.name: [end if end in run else start for start, end in zip(x.start, x.end)][:MOST_LINES]
        for x in run.system.connections
    }
    return carried or {
        name: [column for column in run.recording.columns if column.startswith(f"{name}.")][:MOST_LINES]
        for name in run.system.components
    }


def _draw(panel: Axes, run: Run, columns: Sequence[str], *, alone: bool) -> None:
    """Colours tell signals of one run, or runs; dashes the other."""
    system = run.system
    applied = {end for x in system.connections for end in x.end}
    several = len({run.described[column].unit for column in columns}) > 1
    for k, column in enumerate(columns):
        if column not in run:
            continue
        held = column in applied or system.components[component_of(column)].sampling is not None
        name = labels.signal(column, run.described)
        if several:
            name = quantity(name, run.described[column].unit)
        panel.plot(
            run.time, run[column], drawstyle="steps-post" if held else "default",
            color=CYCLE[k % len(CYCLE)] if alone else run.color,
            linestyle="-" if alone else ("-", "--", "-.", ":")[k % 4],
            label=name if run.place == 0 else None,
        )  # fmt: skip
