"""What happens to tasks and messages, as events, from what the scheduler has noted so far."""

from collections.abc import Collection, Sequence

import numpy as np

from orchestration.basics.simulator import Integers
from orchestration.computers.parts import (
    ABORTED,
    FINISHED,
    FRAME_CORRUPTED,
    FRAME_TRANSMITTED,
    LATER,
    NONE,
    PREEMPTED,
    QUEUED,
    RELEASED,
    RESUMED,
    SKIPPED,
    STARTED,
    Parts,
)
from orchestration.computers.parts import KINDS as KINDS_OF_NOTES
from orchestration.recording.recording import KINDS

_EVENTS = {
    RELEASED: "released", STARTED: "started", PREEMPTED: "preempted", RESUMED: "resumed", FINISHED: "finished",
    ABORTED: "aborted", SKIPPED: "skipped", QUEUED: "queued", FRAME_TRANSMITTED: "transmitted",
    FRAME_CORRUPTED: "retransmitted",
}  # fmt: skip
NEEDED = frozenset(_EVENTS)
"""The kinds of notes that they are made of"""
_KIND = np.full(KINDS_OF_NOTES, NONE)
_KIND[[*_EVENTS]] = [KINDS.index(word) for word in _EVENTS.values()]
_MISSED = KINDS.index("missed")


class EventBuilder:
    """Makes events of notes, which come a part of the run after the other."""

    def __init__(self, parts: Parts, names: Sequence[str], without: Collection[str] = ()) -> None:
        """`names` are those of all tasks, then of all messages; those `without` are left out."""
        self.names = tuple(names)
        self._is_told = np.array([name not in without for name in names], dtype=np.bool_)
        self._last_leg = np.array([len(message.legs) - 1 for message in parts.messages], dtype=np.int64)
        self._deadlines = _Deadlines(np.array([task.deadline for task in parts.tasks], dtype=np.int64))
        self._tasks = len(parts.tasks)

    def before(self, time: int, notes: Integers) -> Integers:
        """What happens before `time` [ns], as a table of `Events` in order; `notes` are those since the last time.

        What is missed comes after all else that happens at the deadline.
        """
        what, whose = notes[:, 1], notes[:, 2]
        of_messages = what >= QUEUED
        kind, owner = _KIND[what], whose + self._tasks * of_messages
        said = (kind != NONE) & self._is_told[owner]
        passed = np.flatnonzero(what == FRAME_TRANSMITTED)
        said[passed] &= notes[passed, 4] == self._last_leg[whose[passed]]
        told, jobs = np.flatnonzero(said), np.flatnonzero(said & ~of_messages)
        found = _table(notes[told, 0], kind[told], owner[told], notes[told, 3])
        missed = self._deadlines.missed_before(time, notes.take(jobs, axis=0))
        if not len(missed):
            return found
        found = np.concatenate([found, missed])
        in_order: Integers = found[np.argsort(found[:, 0], kind="stable")]
        return in_order


class _Deadlines:
    """Of the jobs that may still be late: those of each task one after the other, without gaps."""

    def __init__(self, deadlines: Integers) -> None:
        """`deadlines` are those of the tasks, from the nominal release on."""
        self._of_tasks = deadlines
        self._first, self._counts = np.zeros((2, len(deadlines)), dtype=np.int64)
        self._due = self._ended = self._told = np.zeros(0, dtype=np.int64)

    def missed_before(self, time: int, notes: Integers) -> Integers:
        """The deadlines before `time` [ns] at which jobs are not done, as a table of `Events` in order of the tasks.

        A job that is released behind its deadline, by its jitter, is late when it is released.
        """
        what, task = notes[:, 1], notes[:, 2]
        new = np.flatnonzero((what == RELEASED) | (what == SKIPPED))
        counts = self._counts + np.bincount(task[new], minlength=len(self._counts))
        start = np.cumsum(counts) - counts
        places = (start - self._first)[task] + notes[:, 3]
        due, ended, told = np.full((3, int(counts.sum())), LATER, dtype=np.int64)
        shifts = start - (np.cumsum(self._counts) - self._counts)
        before = np.arange(len(self._due)) + np.repeat(shifts, self._counts)
        due[before], ended[before], told[before] = self._due, self._ended, self._told
        due[places[new]] = notes[new, 4] + self._of_tasks[task[new]]
        told[places[new]] = np.maximum(due[places[new]], notes[new, 0])
        done = np.flatnonzero((what == FINISHED) & (places >= start[task]))  # of those that are late has been told
        ended[places[done]] = notes[done, 0]
        past = told < time
        late = np.flatnonzero(past & (ended > due))
        owners = np.repeat(np.arange(len(counts)), counts)
        missed = _table(told[late], _MISSED, owners[late], (self._first - start)[owners[late]] + late)
        gone = np.bincount(owners[past], minlength=len(counts))
        self._first, self._counts = self._first + gone, counts - gone
        self._due, self._ended, self._told = due[~past], ended[~past], told[~past]
        return missed


def _table(*columns: Integers | int) -> Integers:
    found = np.empty((len(columns[0]), len(columns)), dtype=np.int64)  # type: ignore[arg-type]
    for i, column in enumerate(columns):
        found[:, i] = column
    return found
