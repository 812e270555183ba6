"""Events of tasks and messages from the notes of the scheduler."""

from collections.abc import Collection, Sequence

import numpy as np

from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.recording.recording import KINDS
from orchestration.systems.computers import note
from orchestration.systems.computers.parts import LATER, NONE, Parts

_EVENTS = {
    getattr(note, word.upper()): word
    for word in ("released", "started", "preempted", "resumed", "finished", "aborted", "skipped", "queued")
} | {note.FRAME_TRANSMITTED: "transmitted", note.FRAME_CORRUPTED: "retransmitted"}
NEEDED = frozenset(_EVENTS)
"""The kinds of notes that events are made of"""
_KIND = np.full(note.KINDS, NONE)
_KIND[[*_EVENTS]] = [KINDS.index(word) for word in _EVENTS.values()]
_MISSED = KINDS.index("missed")


class EventBuilder:
    """Makes events from the notes of consecutive parts of a run."""

    def __init__(self, parts: Parts, names: Sequence[str], without: Collection[str] = ()) -> None:
        """`names` are those of all tasks, then of all messages; those in `without` are left out."""
        self.names = tuple(names)
        self._is_reported = np.array([name not in without for name in names], dtype=np.bool_)
        self._last_leg = np.array([len(message.legs) - 1 for message in parts.messages], dtype=np.int64)
        self._deadlines = _Deadlines(np.array([task.deadline for task in parts.tasks], dtype=np.int64))
        self._tasks = len(parts.tasks)

    def before(self, time: int, notes: Integers) -> Integers:
        """The events before `time` [ns], as a table of `Events` in order; `notes` are those since the last call.

        A missed deadline comes after all else at that instant.
        """
        what, part = notes[:, 1], notes[:, 2]
        of_messages = what >= note.QUEUED
        kind, owner = _KIND[what], part + self._tasks * of_messages
        reported = (kind != NONE) & self._is_reported[owner]
        passed = np.flatnonzero(what == note.FRAME_TRANSMITTED)
        reported[passed] &= notes[passed, 4] == self._last_leg[part[passed]]
        rows, jobs = np.flatnonzero(reported), np.flatnonzero(reported & ~of_messages)
        found = _table(notes[rows, 0], kind[rows], owner[rows], notes[rows, 3])
        missed = self._deadlines.missed_before(time, notes.take(jobs, axis=0))
        if not len(missed):
            return found
        found = np.concatenate([found, missed])
        return np.asarray(found[np.argsort(found[:, 0], kind="stable")])


class _Deadlines:
    """The deadlines of the jobs that may still be late, task after task, without gaps."""

    def __init__(self, deadlines: Integers) -> None:
        """`deadlines` are those of the tasks, after the nominal release."""
        self._of_tasks = deadlines
        self._first, self._counts = np.zeros((2, len(deadlines)), dtype=np.int64)
        self._due = self._ended = self._reported_at = np.zeros(0, dtype=np.int64)

    def missed_before(self, time: int, notes: Integers) -> Integers:
        """The deadlines before `time` [ns] at which jobs are not done, as a table of `Events` in order of the tasks.

        A job that is released behind its deadline, by its jitter, is late when it is released.
        """
        what, task = notes[:, 1], notes[:, 2]
        new = np.flatnonzero((what == note.RELEASED) | (what == note.SKIPPED))
        counts = self._counts + np.bincount(task[new], minlength=len(self._counts))
        start = np.cumsum(counts) - counts
        places = (start - self._first)[task] + notes[:, 3]
        due, ended, reported_at = np.full((3, int(counts.sum())), LATER, dtype=np.int64)
        shifts = start - (np.cumsum(self._counts) - self._counts)
        before = np.arange(len(self._due)) + np.repeat(shifts, self._counts)
        due[before], ended[before], reported_at[before] = self._due, self._ended, self._reported_at
        due[places[new]] = notes[new, 4] + self._of_tasks[task[new]]
        reported_at[places[new]] = np.maximum(due[places[new]], notes[new, 0])
        done = np.flatnonzero((what == note.FINISHED) & (places >= start[task]))  # late ones are reported already
        ended[places[done]] = notes[done, 0]
        past = reported_at < time
        late = np.flatnonzero(past & (ended > due))
        owners = np.repeat(np.arange(len(counts)), counts)
        missed = _table(reported_at[late], _MISSED, owners[late], (self._first - start)[owners[late]] + late)
        gone = np.bincount(owners[past], minlength=len(counts))
        self._first, self._counts = self._first + gone, counts - gone
        self._due, self._ended, self._reported_at = due[~past], ended[~past], reported_at[~past]
        return missed


def _table(*columns: Integers | int) -> Integers:
    found = np.empty((len(columns[0]), len(columns)), dtype=np.int64)  # type: ignore[arg-type]
    for i, column in enumerate(columns):
        found[:, i] = column
    return found
