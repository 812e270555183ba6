"""Signals of runs, decimated for a page."""

from collections.abc import Mapping

import numpy as np

from orchestration.experiments.report.blobs import Blobs
from orchestration.experiments.report.known_layouts import layout_for
from orchestration.experiments.report.layouts import About, layout_of
from orchestration.experiments.report.model import ReportLayout, ReportTrack
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.model import System

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
