"""A run as figures use it: named, decimated, in a window of time."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import seconds
from orchestration.foundation.recording.recording import Events, Recording, events_of, rows_of
from orchestration.simulation.figures.palette import CYCLE, DASHES
from orchestration.simulation.results.units import ColumnInfo
from orchestration.systems.system.model import System

Window: TypeAlias = tuple[float, float]
"""A span of time [s]"""


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnRun:
    """A run that has ended, as one of those in a figure."""

    name: str
    """Name that distinguishes it from the others"""
    place: int
    """Index among the runs that are drawn"""
    title: str
    """Words for what was run, and how it ended"""
    system: System
    recording: Recording
    """Recording with as many of the rows as a figure can show"""
    whole: Recording
    """All rows"""
    described: Mapping[str, ColumnInfo]
    """Unit and description of each column"""
    parameters: Mapping[str, float]
    """Parameters of all components, by COMPONENT.NAME"""
    window: Window | None
    """The visible span of time; None: all"""

    @cached_property
    def rows(self) -> Floats:
        """The decimated rows, shape (n, number of columns)."""
        return rows_of(self.recording)

    @cached_property
    def signals(self) -> dict[str, Floats]:
        """The columns of the decimated rows by name, shape (n,)."""
        return {name: self.rows[:, i] for i, name in enumerate(self.recording.columns)}

    @property
    def color(self) -> str:
        """The colour of its lines; blue for a run alone."""
        return CYCLE[self.place % len(CYCLE)]

    @property
    def dashes(self) -> str:
        """The dashes of its lines; none for a run alone."""
        return DASHES[self.place % len(DASHES)]

    @property
    def span(self) -> Window:
        """The visible span of time [s]."""
        return self.window or (0.0, float(self.rows[-1, 0]))

    @cached_property
    def visible(self) -> slice:
        """The rows in the window, and one on each side."""
        if self.window is None:
            return slice(None)
        first, last = np.searchsorted(self.rows[:, 0], self.window, side="left")
        return slice(max(int(first) - 1, 0), int(last) + 1)

    @property
    def time(self) -> Floats:
        """The time of the visible rows [s], shape (n,)."""
        return self.rows[self.visible, 0]

    @cached_property
    def events(self) -> Events:
        """All events of the run."""
        return events_of(self.recording)

    def instants(self, kind: str, what: str | None = None) -> Floats:
        """The times of the events of a kind, of one connection if `what` names it [s], shape (n,)."""
        return np.asarray(seconds(self.events.table[self.events.are(kind, what), 0]))

    def __contains__(self, signal: str) -> bool:
        return signal in self.signals

    def __getitem__(self, signal: str) -> Floats:
        return self.signals[signal][self.visible]

    def has(self, signals: Collection[str]) -> bool:
        """Whether it has all of these signals."""
        return all(signal in self for signal in signals)

    def stacked(self, signals: Sequence[str]) -> Floats:
        """A vector over the visible rows, shape (n, number of signals)."""
        return np.column_stack([self[signal] for signal in signals])


def title(runs: Sequence[DrawnRun]) -> str:
    """The common title of all runs; empty if they differ."""
    titles = {run.title for run in runs}
    return titles.pop() if len(titles) == 1 else ""
