"""What happens to tasks and messages, as events, from what the scheduler has noted so far."""

from collections.abc import Collection, Sequence

import numpy as np

from orchestration.basics.simulator import Integers
from orchestration.computers.parts import (
    ABORTED,
    FINISHED,
    LATER,
    NONE,
    PASSED,
    PREEMPTED,
    QUEUED,
    RELEASED,
    RESUMED,
    SKIPPED,
    SPOILT,
    STARTED,
    Parts,
)
from orchestration.computers.parts import KINDS as KINDS_OF_NOTES
from orchestration.recording.recording import KINDS

_SAID = {
    RELEASED: "released", STARTED: "started", PREEMPTED: "preempted", RESUMED: "resumed", FINISHED: "finished",
    ABORTED: "aborted", SKIPPED: "skipped", QUEUED: "queued", PASSED: "transmitted", SPOILT: "retransmitted",
}  # fmt: skip
NEEDED = frozenset(_SAID)
"""The kinds of notes that they are made of"""
_KIND = np.full(KINDS_OF_NOTES, NONE)
_KIND[[*_SAID]] = [KINDS.index(word) for word in _SAID.values()]
_MISSED = KINDS.index("missed")


class Happenings:
    """Makes events of notes, which come a part of the run after the other."""

    def __init__(self, parts: Parts, names: Sequence[str], without: Collection[str] = ()) -> None:
        """`names` are those of all tasks, then of all messages; those `without` are left out."""
        self.names = tuple(names)
        self._is_told = np.array([name not in without for name in names], dtype=np.bool_)
        self._deadlines = np.array([task.deadline for task in parts.tasks], dtype=np.int64)
        self._last_leg = np.array([len(message.legs) - 1 for message in parts.messages], dtype=np.int64)
        self._waiting: Integers = np.zeros((0, 3), dtype=np.int64)
        """Jobs that may still be late: deadline, task, number"""

    def before(self, time: int, notes: Integers) -> Integers:
        """What happens before `time` [ns], as a table of `Events` in order; `notes` are those since the last time.

        What is missed comes after all else that happens at the deadline.
        """
        what, whose = notes[:, 1], notes[:, 2]
        kind, owner = _KIND[what], np.where(what < QUEUED, whose, len(self._deadlines) + whose)
        said = (kind != NONE) & self._is_told[owner]
        passed = np.flatnonzero(what == PASSED)
        said[passed] &= notes[passed, 4] == self._last_leg[whose[passed]]
        happened = np.column_stack([notes[:, 0], kind, owner, notes[:, 3]])[said]
        found = np.concatenate([happened, self._missed(time, notes[(what < QUEUED) & said])])
        in_order: Integers = found[np.argsort(found[:, 0], kind="stable")]
        return in_order

    def _missed(self, time: int, notes: Integers) -> Integers:
        """The deadlines before `time` at which jobs are not done."""
        what = notes[:, 1]
        new, done = notes[(what == RELEASED) | (what == SKIPPED)], notes[what == FINISHED]
        due = np.column_stack([new[:, 4] + self._deadlines[new[:, 2]], new[:, 2:4]])
        waiting = np.concatenate([self._waiting, due])
        deadline, ended = waiting[:, 0], np.full(len(waiting), LATER, dtype=np.int64)
        keys, wanted = (table @ (1, len(self._deadlines)) for table in (waiting[:, 1:], done[:, 2:4]))
        order = np.argsort(keys)
        places = np.searchsorted(keys, wanted, sorter=order)
        known = places < len(keys)  # those that are late have been told of
        places = order[places[known]]
        same = keys[places] == wanted[known]
        ended[places[same]] = done[known, 0][same]
        self._waiting = waiting[(ended == LATER) & (deadline >= time)]
        missed = waiting[(ended > deadline) & (deadline < time)]
        return np.insert(missed, 1, _MISSED, axis=1)
