"""A schedule: some thousand consecutive instants as arrays, and one by one; the position of a run among them."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from orchestration.foundation.basics.simulator import Integers

if TYPE_CHECKING:
    from orchestration.systems.schedule.timetable import Timetable

Message: TypeAlias = Sequence[int]
"""Index of its connection; its index k there; when it is sent, or measured for a sample [ns]; when it arrives [ns],
negative if it is lost"""


class SampleInstant(NamedTuple):
    """One sampling instant of a component."""

    component: int
    next_time: int
    """true time of the next sample [ns], even after the end"""
    received: Sequence[Message]
    """messages that it reads from components in continuous time"""
    sent: Sequence[Message]
    """messages that it sends; one that arrives at this instant is delivered at once"""


class Instant(NamedTuple):
    """One instant; its parts are processed in this order."""

    time: int
    """Time [ns]"""
    next_time: int
    """Time of the instant after it [ns]"""
    stepped: Sequence[int]
    """components in continuous time that are stepped to this time, in this order"""
    arrivals: Sequence[Message]
    """messages that arrive, in the order of sending"""
    posted: Sequence[Message]
    """messages between components in continuous time that can be late or lost"""
    measured: Sequence[Message]
    """messages measured now for samples to come"""
    samples: Sequence[SampleInstant]
    """samples, in the order in which they are processed"""


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Consecutive instants; instant i has the rows of each table from `…_at[i]` to before `…_at[i + 1]`."""

    times: Integers
    """Times [ns], shape (n + 1,), the last one of the instant after these"""
    stepped: Integers
    """components in continuous time, in the order in which they are stepped"""
    stepped_at: Integers
    posted: Integers
    """messages, shape (m, 4), as `Message`; -1 is the arrival of a lost one"""
    posted_at: Integers
    measured: Integers
    measured_at: Integers
    arrivals: Integers
    arrivals_at: Integers
    samples: Integers
    """shape (m, 5): component, time of its next sample [ns], and the indices in `exchanged` of the first message that
    it receives, of the first that it sends, and of the end of these"""
    samples_at: Integers
    exchanged: Integers
    """messages that samples read and send"""

    def __len__(self) -> int:
        return len(self.times) - 1

    def instants(self) -> Iterator[Instant]:
        """The instants one by one."""
        times, messages = self.times.tolist(), self.exchanged.tolist()
        samples = [
            _made(SampleInstant, (component, next_time, messages[received:sent], messages[sent:end]))
            for component, next_time, received, sent, end in self.samples.tolist()
        ]
        parts = (
            _parts(self.stepped.tolist(), self.stepped_at),
            _parts(self.arrivals.tolist(), self.arrivals_at),
            _parts(self.posted.tolist(), self.posted_at),
            _parts(self.measured.tolist(), self.measured_at),
            _parts(samples, self.samples_at),
        )
        return map(partial(_made, Instant), zip(times, times[1:], *parts))

    def part(self, begin: int, end: int | None = None) -> "Schedule":
        """The instants from index `begin` to before `end`, as a separate schedule."""
        end = len(self) if end is None else min(end, len(self))
        found = {"times": self.times[begin : end + 1]}
        for table in TABLES:
            at = getattr(self, f"{table}_at")[begin : end + 1]
            found |= {table: getattr(self, table)[at[0] : at[-1]], f"{table}_at": at - at[0]}
        samples = found["samples"] = found["samples"].copy()
        first, last = (samples[0, 2], samples[-1, 4]) if len(samples) else (0, 0)
        samples[:, 2:] -= first
        return Schedule(exchanged=self.exchanged[first:last], **found)

    def most_events(self) -> int:
        """An upper bound on the events of one instant."""
        exchanged = np.append(self.samples[:, 2], len(self.exchanged))[self.samples_at]
        counts = 2 * np.diff(self.posted_at + exchanged) + np.diff(self.arrivals_at + self.posted_at + exchanged)
        return int(counts.max(initial=0)) + 1

    def of(self, connection: int, table: str) -> tuple[int, list[int]]:
        """The number of messages of a connection in `table`, and the indices of those that are under way for a time."""
        messages = getattr(self, table)
        which = messages[:, 0] == connection
        kept = which & (messages[:, 3] >= 0)
        if table == "exchanged":
            sampled = np.repeat(
                np.repeat(self.times[:-1], np.diff(self.samples_at)), self.samples[:, 4] - self.samples[:, 2]
            )
            kept &= messages[:, 3] != sampled
        return int(which.sum()), messages[kept, 1].tolist()


TABLES = ("stepped", "posted", "measured", "arrivals", "samples")

_made = tuple.__new__
"""Makes a named tuple from a tuple, without the Python function that its class calls"""


def _parts(rows: list[Any], at: Integers) -> Iterable[list[Any]]:
    """The rows of each instant in a table."""
    if not rows:
        return itertools.repeat(rows)
    return [rows[begin:end] for begin, end in itertools.pairwise(at.tolist())]


INSTANTS = 2**15
"""Approximate number of a schedule, made at once"""
TOGETHER = 2**9
"""Number made into objects at once, few enough to stay in the processor's cache"""


class Cursor:
    """Iterates over a timetable from its begin to its end."""

    def __init__(self, timetable: "Timetable") -> None:
        self.at = 0
        """the next instant of the schedule"""
        self._timetable, self._before = timetable, 0
        self._schedule: Schedule | None = None

    @property
    def past(self) -> int:
        """The number of past instants."""
        return self._before + self.at

    def schedule(self) -> Schedule | None:
        """The schedule of the next instant; None at the end.

        Raises `UsageError` if the run cannot go through it.
        """
        if self._schedule is None or self.at == len(self._schedule):
            self._schedule, self._before, self.at = self._timetable.next_schedule(INSTANTS), self.past, 0
        return self._schedule

    def instants(self) -> Iterator[Instant]:
        """The instants to come, each past as soon as it is yielded."""
        while (schedule := self.schedule()) is not None:
            for instant in schedule.part(self.at, self.at + TOGETHER).instants():
                self.at += 1
                yield instant

    def move_to(self, past: int) -> Iterator[Schedule]:
        """Move on until so many instants are past; yields those skipped."""
        while self.past < past and (schedule := self.schedule()) is not None:
            begin, self.at = self.at, min(len(schedule), self.at + past - self.past)
            yield schedule.part(begin, self.at)
