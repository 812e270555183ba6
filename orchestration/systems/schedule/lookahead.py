"""Samples and messages that the scheduler has computed ahead of the timetable."""

from collections.abc import Collection

import numpy as np

from orchestration.foundation.basics.simulator import Integers
from orchestration.systems.computers import note
from orchestration.systems.computers.compiled import scheduler
from orchestration.systems.computers.parts import LATER
from orchestration.systems.schedule.random_timing import NEVER
from orchestration.systems.schedule.resources import Resources
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.model import System

_UNKNOWN = -2
_SENT, _LOST, _NOTHING = range(3)
"""The outcome of a message of a connection, as in a note SENT"""
_FURTHER = 1_000_000
"""Least time by which the scheduler advances [ns]"""


class ForeseenMessages:
    """The messages of one connection in the order of sending, until they are taken."""

    def __init__(self) -> None:
        self._rows: Integers = np.zeros((0, 3), dtype=np.int64)
        self._first = 0

    def add(self, sent: Integers, arriving: Integers) -> None:
        """Add notes of messages sent, with their outcomes, and of arrivals."""
        known = len(self._rows)
        rows = np.empty((known + len(sent), 3), dtype=np.int64)
        rows[:known], rows[known:, :2], rows[known:, 2] = self._rows, sent[:, ::4], _UNKNOWN
        self._rows = rows
        self._rows[arriving[:, 3] - self._first, 2] = arriving[:, 4]

    def known(self, is_complete: bool) -> int:
        """The number of messages before the first whose arrival is not known yet; all, if the run is over."""
        if is_complete:
            return len(self._rows)
        is_open = (self._rows[:, 1] == _SENT) & (self._rows[:, 2] == _UNKNOWN)
        return int(is_open.argmax()) if is_open.any() else len(self._rows)

    def instants(self) -> Integers:
        """When the messages that are not taken yet are sent."""
        return self._rows[:, 0]

    def take(self, count: int) -> tuple[Integers, Integers]:
        """When the next `count` messages are sent and when they arrive, -1 for never.

        A message under way at the end arrives after it; one that is not sent by then has the time `NEVER`.
        """
        rows = self._rows[:count]
        sent, arrives = np.full((2, count), NEVER, dtype=np.int64)
        arrives[len(rows) :] = -1
        is_sent = rows[:, 1] != _NOTHING
        sent[: len(rows)][is_sent] = rows[is_sent, 0]
        arrives[: len(rows)] = np.where(rows[:, 1] != _SENT, -1, np.where(rows[:, 2] == _UNKNOWN, NEVER, rows[:, 2]))
        self._rows, self._first = self._rows[count:], self._first + len(rows)
        return sent, arrives


class Samples:
    """The samples of a component until they are taken, and the messages that it sends."""

    def __init__(self, messages: Collection[ForeseenMessages]) -> None:
        """`messages` are those of its connections that the scheduler computes."""
        self.times: Integers = np.zeros(0, dtype=np.int64)
        self._messages = messages

    def add(self, times: Integers) -> None:
        """Add samples at these times."""
        self.times = np.concatenate([self.times, times])

    def known(self, is_complete: bool) -> int:
        """The number of samples that are fully known, with the time of the next one."""
        count = len(self.times) if is_complete else max(len(self.times) - 1, 0)
        return count if is_complete else min([count, *(each.known(is_complete) for each in self._messages)])

    def before(self, end: int) -> int:
        """The number before `end` [ns]: for a starved task the scheduler runs far ahead."""
        return int(np.searchsorted(self.times, end))

    def take(self, count: int) -> tuple[Integers, Integers]:
        """The times of the next `count` samples, and of those after each, NEVER if there is none before the end."""
        times, then = self.times[:count], np.append(self.times[1 : count + 1], NEVER)[:count]
        self.times = self.times[count:]
        return times, then


class Lookahead:
    """The scheduler of a system, run ahead of the timetable."""

    def __init__(self, system: System, resources: Resources, streams: Streams) -> None:
        self._scheduler = scheduler(resources.of_run(streams), (note.SAMPLED, note.SENT, note.ARRIVES))
        self._tasks, self._stop = resources.tasks, resources.parts.stop
        self._reached = 0
        self.messages = {name: ForeseenMessages() for name in resources.carriers}
        """Messages by connection"""
        self.samples = {
            name: Samples(
                [self.messages[x.name] for x in system.connections if x.sender == name and x.name in self.messages]
            )
            for name in self._tasks
        }
        """Samples by component"""

    @property
    def is_complete(self) -> bool:
        """Whether everything is known up to the end."""
        return self._reached > self._stop

    def advance_to(self, time: int) -> None:
        """Advance to `time` [ns] and somewhat further, so that what begins before it has ended."""
        if time <= self._reached:
            return
        time += max((time - self._reached) // 16, _FURTHER)
        self._reached = LATER if self._scheduler.next_instant == LATER else time
        self._scheduler.run(time)
        notes = self._scheduler.take_notes()
        if not len(notes):
            return
        which = note.KINDS * notes[:, 2] + notes[:, 1]

        def of(kind: int, owner: int) -> Integers:
            return notes.take(np.flatnonzero(which == note.KINDS * owner + kind), axis=0)

        for name, task in self._tasks.items():
            self.samples[name].add(of(note.SAMPLED, task)[:, 4])
        for i, messages in enumerate(self.messages.values()):
            messages.add(of(note.SENT, i), of(note.ARRIVES, i))

    def advance(self) -> None:
        """Advance further, because something before the requested time is not known yet."""
        self.advance_to(self._reached + max(self._reached // 4, _FURTHER))
