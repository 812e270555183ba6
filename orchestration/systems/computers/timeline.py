"""The timeline of tasks and messages from the notes of the scheduler."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from orchestration.foundation.basics.simulator import Booleans, Integers
from orchestration.foundation.recording.recording import Events
from orchestration.systems.computers import note, results
from orchestration.systems.computers.parts import LATER, NONE, Parts
from orchestration.systems.computers.results import Frames, Jobs, Slices, Timeline
from orchestration.systems.computers.scheduler_events import EventBuilder

_OF_TASKS = tuple(kind for kind in range(note.QUEUED) if kind != note.SAMPLED)
_OF_MESSAGES = (note.QUEUED, note.FRAME_STARTED, note.FRAME_CORRUPTED, note.FRAME_TRANSMITTED)
_ON_A_PROCESSOR = (note.SWITCHING, note.STARTED, note.RESUMED, note.PREEMPTED, note.FINISHED, note.INTERRUPTED)
NEEDED = frozenset((*_OF_TASKS, *_OF_MESSAGES))
"""The kinds of notes that a timeline is made of"""


@dataclass(frozen=True, kw_only=True)
class Names:
    """The names of the parts."""

    processors: Sequence[str]
    tasks: Sequence[str]
    """Names as COMPUTER.TASK"""
    messages: Sequence[str]
    """Names as NETWORK.MESSAGE"""
    links: Sequence[str]

    @property
    def all(self) -> Sequence[str]:
        """The names in events."""
        return (*self.tasks, *self.messages)


def timeline(
    parts: Parts, names: Names, deadlines: Sequence[int], notes: Integers, without: Collection[str] = ()
) -> Timeline:
    """The timeline from all notes of a run; `deadlines` are those of the messages, LATER for none.

    Processors and tasks whose names are in `without` are left out.
    """
    until, what = parts.stop, notes[:, 1]
    of_tasks, of_messages = notes[_are(what, _OF_TASKS)], notes[_are(what, _OF_MESSAGES)]
    jobs = [_jobs(of_tasks[of_tasks[:, 2] == i], task.deadline, until) for i, task in enumerate(parts.tasks)]
    frames = [
        _frames(of_messages[of_messages[:, 2] == m], deadlines[m], len(message.legs), until)
        for m, message in enumerate(parts.messages)
    ]
    return Timeline(
        stop=until,
        jobs={name: each for name, each in zip(names.tasks, jobs) if name not in without},
        frames=dict(zip(names.messages, frames)),
        processors={
            name: _slices_of_processor(of_tasks, parts, p, names.tasks, until)
            for p, name in enumerate(names.processors)
        },
        links={
            name: _slices_of_link(of_messages, parts, k, names.messages, until) for k, name in enumerate(names.links)
        },
        happenings=partial(_events, notes, parts, names, without),
    )


def _are(what: Integers, kinds: Sequence[int]) -> Booleans:
    """Which notes are of one of these kinds."""
    is_one = np.zeros(note.KINDS, dtype=np.bool_)
    is_one[[*kinds]] = True
    return np.asarray(is_one[what])


def _jobs(notes: Integers, deadline: int, stop: int) -> Jobs:
    what = notes[:, 1]
    first = notes[(what == note.RELEASED) | (what == note.SKIPPED)]
    count = len(first)

    def times(kind: int) -> Integers:
        found = np.full(count, results.NEVER, dtype=np.int64)
        some = notes[what == kind]
        found[some[:, 3]] = some[:, 0]
        return found

    ended = times(note.FINISHED)
    outcome = np.where(ended == results.NEVER, results.UNFINISHED, results.DONE)
    outcome[notes[what == note.ABORTED, 3]] = results.ABORTED
    outcome[notes[what == note.SKIPPED, 3]] = results.SKIPPED
    return Jobs(
        nominal=first[:, 4],
        released=first[:, 0],
        started=times(note.STARTED),
        ended=ended,
        written=times(note.WRITTEN),
        deadline=first[:, 4] + deadline,
        preemptions=np.bincount(notes[what == note.PREEMPTED, 3], minlength=count),
        outcome=outcome,
        stop=stop,
    )


def _frames(notes: Integers, deadline: int, legs: int, stop: int) -> Frames:
    what = notes[:, 1]
    first = notes[what == note.QUEUED]
    started, ended = np.full((2, len(first)), results.NEVER, dtype=np.int64)
    first_bits = notes[(what == note.FRAME_STARTED) & (notes[:, 4] == 0)]
    last = notes[(what == note.FRAME_TRANSMITTED) & (notes[:, 4] == legs - 1)]
    started[first_bits[::-1, 3]] = first_bits[::-1, 0]  # of several attempts the first
    ended[last[:, 3]] = last[:, 0]
    return Frames(
        nominal=first[:, 4],
        queued=first[:, 0],
        started=started,
        ended=ended,
        deadline=np.minimum(first[:, 4], LATER - deadline) + deadline,
        attempts=np.bincount(notes[what == note.FRAME_STARTED, 3], minlength=len(first)),
        stop=stop,
    )


def _slices_of_processor(notes: Integers, parts: Parts, processor: int, names: Sequence[str], stop: int) -> Slices:
    """The slices of a processor: each note about its use ends the slice before it."""
    owners = [i for i, task in enumerate(parts.tasks) if task.processor == processor]
    kept = notes[_are(notes[:, 1], _ON_A_PROCESSOR) & np.isin(notes[:, 2], owners)]
    kinds = np.where(kept[:, 1] == note.SWITCHING, results.SWITCH, results.RUN)
    return _slices(kept, kinds, (note.SWITCHING, note.STARTED, note.RESUMED), owners, names, stop)


def _slices_of_link(notes: Integers, parts: Parts, link: int, names: Sequence[str], stop: int) -> Slices:
    legs = max((len(message.legs) for message in parts.messages), default=1)
    where = np.full((len(parts.messages), legs), NONE)
    for m, message in enumerate(parts.messages):
        for place, leg in enumerate(message.legs):
            where[m, place] = leg.link
    notes = notes[notes[:, 1] != note.QUEUED]
    kept = notes[where[notes[:, 2], notes[:, 4]] == link]
    is_corrupted = np.append(kept[1:, 1] == note.FRAME_CORRUPTED, [False])[: len(kept)]
    owners = np.flatnonzero((where == link).any(axis=1)).tolist()
    return _slices(
        kept, np.where(is_corrupted, results.CORRUPTED, results.RUN), (note.FRAME_STARTED,), owners, names, stop
    )


def _slices(
    notes: Integers, kinds: Integers, beginning: Sequence[int], owners: Sequence[int], names: Sequence[str], stop: int
) -> Slices:
    begins = _are(notes[:, 1], beginning)
    ends = np.append(notes[1:, 0], stop)[: len(notes)]
    return Slices(
        owners=tuple(names[i] for i in owners),
        owner=np.searchsorted(np.array(owners, dtype=np.int64), notes[begins, 2]),
        number=notes[begins, 3],
        begin=notes[begins, 0],
        end=ends[begins],
        kind=kinds[begins],
    )


def _events(notes: Integers, parts: Parts, names: Names, without: Collection[str]) -> Events:
    found = EventBuilder(parts, names.all, without)
    return Events(found.names, found.before(parts.stop + 1, notes))
