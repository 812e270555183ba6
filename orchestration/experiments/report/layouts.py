"""The panels of runs by their columns: those of a known layout, or the connections of any system."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

from orchestration.experiments.report.known_layouts import layout_for
from orchestration.experiments.report.model import Line, Panel, ReportLayout
from orchestration.simulation.figures.palette import MAX_LINES, MAX_PANELS
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.units import ColumnInfo
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.model import System

About = Mapping[str, ColumnInfo]
"""Descriptions by column"""


def layout_of(system: System | None, columns: Collection[str], about: About) -> ReportLayout:
    """The layout for some columns; `system` is that of the run, if it is known."""
    known = layout_for(columns)
    if known is None:
        every = enumerate(_of_connections(system, columns, about))
        first = [replace(panel, shown=panel.shown and place < MAX_PANELS) for place, panel in every]
        return ReportLayout(columns=tuple(columns), panels=(*first,), scene=None)
    panels, scene = known.panels(columns), known.scene(columns, system)
    if scene is None:  # then the page computes no columns from it
        panels = tuple(panel for panel in panels if all(line.column in columns for line in panel.lines))
    drawn = {line.column for panel in panels for line in panel.lines}
    if scene is not None:
        drawn |= {*scene.position, *scene.quaternion, *(scene.desired or ())}
    rest = [*_of_components(system, [name for name in columns if name not in drawn], about, shown=False)]
    return ReportLayout(columns=tuple(columns), panels=(*panels, *rest), scene=scene)


def _of_connections(system: System | None, columns: Collection[str], about: About) -> Iterator[Panel]:
    """Panels of exchanged signals, as received; then of the other recorded ones."""
    drawn: set[str] = set()
    for x in system.connections if system is not None else ():
        ends = [end if end in columns else start for start, end in zip(x.start, x.end)]
        drawn |= {*x.start, *x.end}
        title = f"connection {x.name}" if x.name.isdigit() else x.name
        applied = x.end[0] in columns or (system is not None and system.components[x.sender].sampling is not None)
        yield from _split(title, [end for end in ends if end in columns], about, held=applied)
    rest = [name for name in columns if name not in drawn and name != "time"]
    yield from _of_components(system, rest, about, shown=not drawn)


def _of_components(system: System | None, columns: Sequence[str], about: About, *, shown: bool) -> Iterator[Panel]:
    """Panels by component and vector; signals of a sampled component are held."""
    groups: dict[str, list[str]] = {}
    for name in columns:
        groups.setdefault(name.rpartition(".")[0], []).append(name)
    for names in groups.values():
        name = component_of(names[0])
        owner = None if system is None else system.components.get(name)
        held = owner is not None and owner.sampling is not None
        yield from _split(name, names, about, held=held, shown=shown)


def _split(
    title: str, names: Sequence[str], about: About, *, held: bool = False, shown: bool = True
) -> Iterator[Panel]:
    """Panels of one unit and few lines each."""
    by_unit: dict[str | None, list[str]] = {}
    for name in names:
        by_unit.setdefault(labels.unit(about[name].unit) if name in about else None, []).append(name)
    for unit, of_unit in by_unit.items():
        for first in range(0, len(of_unit), MAX_LINES):
            columns = of_unit[first : first + MAX_LINES]
            lines = [Line(column=name, label=labels.signal(name, about), held=held) for name in columns]
            yield Panel(title=labels.quantities(title, columns), unit=unit, lines=(*lines,), shown=shown)
