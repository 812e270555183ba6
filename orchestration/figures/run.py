"""A run as figures see it: named, thinned, in a window of time."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from orchestration.basics.simulator import Floats
from orchestration.figures.palette import CYCLE, DASHES
from orchestration.recording.recording import Events, Recording
from orchestration.results.column_info import ColumnInfo
from orchestration.system.model import System

Window: TypeAlias = tuple[float, float]
"""A span of time [s]"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One of the runs in a figure."""

    name: str
    """what tells it from the others"""
    place: int
    """among them"""
    title: str
    """what was run, and how it ended"""
    system: System
    recording: Recording
    """as many rows as can be seen"""
    whole: Recording
    """all of them"""
    described: Mapping[str, ColumnInfo]
    """what is known of each column"""
    parameters: Mapping[str, float]
    """of all components, by COMPONENT.NAME"""
    window: Window | None
    """what is to be seen of it; None: all"""

    @cached_property
    def rows(self) -> Floats:
        """As many as can be seen, shape (n, number of columns)."""
        return np.concatenate([chunk.rows for chunk in self.recording.chunks()])

    @cached_property
    def signals(self) -> dict[str, Floats]:
        """Every column of them by its name, shape (n,)."""
        return {name: self.rows[:, i] for i, name in enumerate(self.recording.columns)}

    @property
    def color(self) -> str:
        """Its own, where runs are laid over each other."""
        return CYCLE[self.place % len(CYCLE)]

    @property
    def dashes(self) -> str:
        """How its lines are dashed, likewise."""
        return DASHES[self.place % len(DASHES)]

    @property
    def span(self) -> Window:
        """From when to when it is seen [s]."""
        return self.window or (0.0, float(self.rows[-1, 0]))

    @cached_property
    def seen(self) -> slice:
        """The rows in the window, and one to each side."""
        if self.window is None:
            return slice(None)
        first, last = np.searchsorted(self.rows[:, 0], self.window, side="left")
        return slice(max(int(first) - 1, 0), int(last) + 1)

    @property
    def time(self) -> Floats:
        """Of the rows that are seen [s], shape (n,)."""
        return self.rows[self.seen, 0]

    @cached_property
    def events(self) -> Events:
        """Of the rows that are drawn."""
        parts = [chunk.events for chunk in self.recording.chunks(("time",))]
        names = tuple(dict.fromkeys(name for part in parts for name in part.names))
        places = [np.array([names.index(name) for name in part.names], dtype=np.int64) for part in parts]
        tables = [
            np.column_stack([part.table[:, :2], place[part.table[:, 2]], part.table[:, 3]])
            for part, place in zip(parts, places, strict=True)
        ]
        return Events(names, np.concatenate(tables))

    def instants(self, kind: str, what: str | None = None) -> Floats:
        """When something of a kind happened to messages, of one connection if it is named [s], shape (n,)."""
        found: Floats = self.events.table[self.events.are(kind, what), 0] / 1e9
        return found

    def __contains__(self, signal: str) -> bool:
        return signal in self.signals

    def __getitem__(self, signal: str) -> Floats:
        return self.signals[signal][self.seen]

    def has(self, signals: Collection[str]) -> bool:
        """Whether it has all of these."""
        return all(signal in self for signal in signals)

    def stacked(self, signals: Sequence[str]) -> Floats:
        """A vector over the rows that are seen, shape (n, number of signals)."""
        return np.column_stack([self[signal] for signal in signals])


def title(runs: Sequence[Run]) -> str:
    """What is flown and how it ended, if that can be said of all of them."""
    told = {run.title for run in runs}
    return told.pop() if len(told) == 1 else ""
