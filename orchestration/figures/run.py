"""A run as figures see it: named, thinned, in a window of time."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from orchestration.drawing.palette import CYCLE, DASHES
from orchestration.master.recording import Events, thinned
from orchestration.quadrotor.scenario import Scenario
from orchestration.results.result import Result
from orchestration.simulator import Floats

Window: TypeAlias = tuple[float, float]
"""A span of time [s]"""

MOST = 2**16
"""Rows that are drawn of the whole of a longer run, beside all in the window"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """One of the runs in a figure."""

    name: str
    """what tells it from the others"""
    place: int
    """among them"""
    result: Result
    """with as many rows as can be seen"""
    whole: Result
    """with all of them"""
    window: Window | None
    """what is to be seen of it; None: all"""

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
        return self.window or (0.0, float(self.result.rows[-1, 0]))

    @cached_property
    def seen(self) -> slice:
        """The rows in the window, and one to each side."""
        if self.window is None:
            return slice(None)
        first, last = np.searchsorted(self.result.rows[:, 0], self.window, side="left")
        return slice(max(int(first) - 1, 0), int(last) + 1)

    @property
    def time(self) -> Floats:
        """Of the rows that are seen [s], shape (n,)."""
        return self.result.rows[self.seen, 0]

    @cached_property
    def events(self) -> Events:
        """Of the rows that are drawn."""
        parts = [chunk.events for chunk in self.result.recording.chunks(("time",))]
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
        return signal in self.result.signals

    def __getitem__(self, signal: str) -> Floats:
        return self.result.signals[signal][self.seen]

    def has(self, signals: Collection[str]) -> bool:
        """Whether it has all of these."""
        return all(signal in self for signal in signals)

    def stacked(self, signals: Sequence[str]) -> Floats:
        """A vector over the rows that are seen, shape (n, number of signals)."""
        return np.column_stack([self[signal] for signal in signals])


def runs_of(
    results: Sequence[Result], names: Sequence[str], columns: Collection[str] | None, window: Window | None
) -> list[Run]:
    """Runs ready to be drawn; of a run of more than `MOST` rows every n-th, all in the window; of some columns."""
    found = []
    for place, (result, name) in enumerate(zip(results, names, strict=True)):
        kept = thinned(
            result.recording, set(result.columns if columns is None else columns), window or (0.0, 1.0), MOST
        )
        found.append(Run(name=name, place=place, result=replace(result, recording=kept), whole=result, window=window))
    return found


def title(runs: Sequence[Run]) -> str:
    """What is flown and how it ended, if that can be said of all of them."""
    told = {_title(run.whole) for run in runs}
    return told.pop() if len(told) == 1 else ""


def _title(result: Result) -> str:
    parts = []
    if isinstance(result.asked, Scenario):
        timing = result.asked.timing
        parts.append(f"{result.asked.controller.fmu}, period {timing.period * 1e3:g} ms")
        if timing.delay:
            parts.append(f"delay {timing.delay * 1e3:g} ms")
        if timing.order != "gauss-seidel":
            parts.append("Jacobi")
    if result.divergence is not None:
        parts.append(f"diverged at {result.metrics['divergence_time']:g} s")
    if result.interrupted_at is not None:
        parts.append(f"interrupted at {result.interrupted_at:g} s")
    return ", ".join(parts)
