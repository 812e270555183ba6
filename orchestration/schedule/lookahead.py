"""What the scheduler has found so far of the components and connections of a system, ahead of its timetable."""

from collections.abc import Collection

import numpy as np

from orchestration.basics.simulator import Integers
from orchestration.computers.compiled import scheduler
from orchestration.computers.parts import ARRIVES, KINDS, LATER, SAMPLED, SENT
from orchestration.schedule.resources import Resources
from orchestration.schedule.streams import Streams
from orchestration.system.model import System

NEVER = 2**60
"""[ns] of what does not come before the end"""
_UNKNOWN = -2
_SENT, _LOST, _NOTHING = range(3)
"""What becomes of a message of a connection, as SENT notes it"""
_FURTHER = 1_000_000
"""[ns] that the scheduler goes on at least where something is not known yet"""


class Messages:
    """Messages of one connection in the order of sending, from when they are sent until they are taken."""

    def __init__(self) -> None:
        self._rows: Integers = np.zeros((0, 3), dtype=np.int64)
        self._first = 0

    def add(self, sent: Integers, arriving: Integers) -> None:
        """Notes of when some were sent and what became of them, and of when some arrive."""
        known = len(self._rows)
        rows = np.empty((known + len(sent), 3), dtype=np.int64)
        rows[:known], rows[known:, :2], rows[known:, 2] = self._rows, sent[:, ::4], _UNKNOWN
        self._rows = rows
        self._rows[arriving[:, 3] - self._first, 2] = arriving[:, 4]

    def known(self, is_complete: bool) -> int:
        """How many there are, up to the first of which it is open when it arrives; at the end nothing is open."""
        if is_complete:
            return len(self._rows)
        is_open = (self._rows[:, 1] == _SENT) & (self._rows[:, 2] == _UNKNOWN)
        return int(is_open.argmax()) if is_open.any() else len(self._rows)

    def instants(self) -> Integers:
        """When those are sent that are known and not taken."""
        return self._rows[:, 0]

    def take(self, count: int) -> tuple[Integers, Integers]:
        """Of the next so many, when they are sent and when they arrive, -1 for never.

        What was under way at the end arrives after it; of what was not sent by then nothing is told at all.
        """
        rows = self._rows[:count]
        sent, arrives = np.full((2, count), NEVER, dtype=np.int64)
        arrives[len(rows) :] = -1
        of_any = rows[:, 1] != _NOTHING
        sent[: len(rows)][of_any] = rows[of_any, 0]
        arrives[: len(rows)] = np.where(rows[:, 1] != _SENT, -1, np.where(rows[:, 2] == _UNKNOWN, NEVER, rows[:, 2]))
        self._rows, self._first = self._rows[count:], self._first + len(rows)
        return sent, arrives


class Samples:
    """When a component samples, from when that is known until it is taken, and what it sends."""

    def __init__(self, messages: Collection[Messages]) -> None:
        """`messages` are those of its connections that the scheduler knows."""
        self.times: Integers = np.zeros(0, dtype=np.int64)
        self._messages = messages

    def add(self, times: Integers) -> None:
        """Some more."""
        self.times = np.concatenate([self.times, times])

    def known(self, is_complete: bool) -> int:
        """Of how many all is known, the time of the next one too."""
        count = len(self.times) if is_complete else max(len(self.times) - 1, 0)
        return count if is_complete else min([count, *(each.known(is_complete) for each in self._messages)])

    def before(self, end: int) -> int:
        """How many are before `end` [ns], as far as there are any: a starved task has the scheduler run far ahead."""
        return int(np.searchsorted(self.times, end))

    def take(self, count: int) -> tuple[Integers, Integers]:
        """The times of the next so many, and of those after each, NEVER if that does not come before the end."""
        times, then = self.times[:count], np.append(self.times[1 : count + 1], NEVER)[:count]
        self.times = self.times[count:]
        return times, then


class Lookahead:
    """The scheduler of a system at work."""

    def __init__(self, system: System, resources: Resources, streams: Streams) -> None:
        self._scheduler = scheduler(resources.of_run(streams), (SAMPLED, SENT, ARRIVES))
        self._tasks, self._stop = resources.tasks, resources.parts.stop
        self._reached = 0
        self.messages = {name: Messages() for name in resources.carriers}
        """by connection"""
        self.samples = {
            name: Samples(
                [self.messages[x.name] for x in system.connections if x.sender == name and x.name in self.messages]
            )
            for name in self._tasks
        }
        """by component"""

    @property
    def is_complete(self) -> bool:
        """Whether all is known up to the end."""
        return self._reached > self._stop

    def advance_to(self, time: int) -> None:
        """Find out what happens before `time` [ns], and somewhat later: of what begins before it, how it ends."""
        if time <= self._reached:
            return
        time += max((time - self._reached) // 16, _FURTHER)
        self._reached = LATER if self._scheduler.next_instant == LATER else time
        self._scheduler.run(time)
        notes = self._scheduler.take_notes()
        if not len(notes):
            return
        which = KINDS * notes[:, 2] + notes[:, 1]

        def of(kind: int, who: int) -> Integers:
            return notes.take(np.flatnonzero(which == KINDS * who + kind), axis=0)

        for name, task in self._tasks.items():
            self.samples[name].add(of(SAMPLED, task)[:, 4])
        for i, messages in enumerate(self.messages.values()):
            messages.add(of(SENT, i), of(ARRIVES, i))

    def advance(self) -> None:
        """Find out more, as something before the time that was asked for is not known yet."""
        self.advance_to(self._reached + max(self._reached // 4, _FURTHER))
