"""Signals of runs, decimated for a page, and the panels of their columns: known ones, or those of any system."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from orchestration.experiments.report.blobs import Blobs
from orchestration.experiments.report.known_layouts import layout_for
from orchestration.experiments.report.model import Line, Panel, ReportLayout, ReportTrack
from orchestration.foundation.basics.simulator import Floats
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


Signals = Mapping[str, Floats]
"""Columns of shape (n,), the `time` [s] among them"""


class Tracks:
    """Stores the signals of runs in blobs, and collects their distinct layouts."""

    def __init__(self, blobs: Blobs) -> None:
        self._blobs = blobs
        self.layouts: list[ReportLayout] = []

    def whole(self, system: System | None, signals: Signals, about: About, rows: int) -> ReportTrack:
        """Every n-th row, about `rows` in all, and the rows with the largest or smallest value of a signal."""
        signals = _with_computed(signals)
        kept = _rows(signals, rows)
        columns = {name: self._blobs.exact(values[kept]) for name, values in signals.items() if name != "time"}
        return self._track(system, columns, about, self._blobs.exact(signals["time"][kept]))

    def compact(self, system: System, signals: Signals, about: About, points: int) -> ReportTrack:
        """Values at `points` times, denser where signals change more: interpolated, of held signals the row before."""
        signals = _with_computed(signals)
        time = signals["time"]
        at = _instants(signals, points)
        before = np.clip(np.searchsorted(time, at, side="right") - 1, 0, None)
        layout = layout_of(system, [name for name in signals if name != "time"], about)
        known = layout_for(signals)
        logarithmic = () if known is None else known.logarithmic
        held = {line.column for panel in layout.panels for line in panel.lines if line.held}
        columns = {}
        for name, values in signals.items():
            if name != "time":
                thinned = values[before] if name in held else np.interp(at, time, values)
                columns[name] = self._blobs.compact(thinned, logarithmic=name in logarithmic)
        return self._track(system, columns, about, self._blobs.exact(at))

    def _track(self, system: System | None, columns: Mapping[str, int], about: About, time: int) -> ReportTrack:
        layout = layout_of(system, [*columns], about)
        if layout not in self.layouts:
            self.layouts.append(layout)
        return ReportTrack(layout=self.layouts.index(layout), time=time, columns=tuple(columns.values()))


def _with_computed(signals: Signals) -> Signals:
    """The signals, and those computed by their known layout, such as the position error of a flight."""
    known = layout_for(signals)
    return signals if known is None else {**signals, **known.computed(signals)}


def _instants(signals: Signals, most: int) -> Floats:
    """Times that divide the run equally, half by time and half by the total variation of the signals."""
    time = signals["time"]
    if len(time) <= most:
        return time
    moved = np.zeros(len(time) - 1)
    for name, values in signals.items():
        span = float(np.ptp(values))
        if name != "time" and 0.0 < span < np.inf:
            steps = np.abs(np.diff(values))
            moved += steps / steps.sum()
    share = np.diff(time) / (time[-1] - time[0]) + moved / max(moved.sum(), 1e-300)
    passed = np.concatenate([[0.0], np.cumsum(share)])
    return np.interp(np.linspace(0.0, passed[-1], most), passed, time)


def _rows(signals: Signals, most: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    count = len(signals["time"])
    stride = -(-count // most)
    ends = [pick(values) for values in signals.values() for pick in (np.argmin, np.argmax)] if stride > 1 else []
    return np.unique([*range(0, count, stride), count - 1, *map(int, ends)])
