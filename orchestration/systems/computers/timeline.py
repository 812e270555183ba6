"""The timeline of tasks and messages: their jobs and frames, and the use of processors and networks.

Times are in nanoseconds; NEVER stands for what did not happen before the end.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from orchestration.foundation.basics.simulator import Booleans, Integers
from orchestration.foundation.recording.recording import Events
from orchestration.systems.computers import note
from orchestration.systems.computers.parts import LATER, NONE, Parts
from orchestration.systems.computers.scheduler_events import EventBuilder

NEVER = -1
"""The time of what did not happen"""
DONE, UNFINISHED, SKIPPED, ABORTED = range(4)
"""Outcomes of a job: one that is under way or waits at the end is unfinished"""
RUN, SWITCH, CORRUPTED = range(3)
"""Uses of a processor or a network: work, the switch before it, or a corrupted frame"""


@dataclass(frozen=True, kw_only=True)
class _Records:
    """Jobs or frames, in the order of their release."""

    nominal: Integers
    """the nominal releases, from which responses and deadlines count"""
    started: Integers
    """Times at which its first instruction ran, or its first bit was first sent"""
    ended: Integers
    """Times at which it was done, or received"""
    deadline: Integers
    """the largest number for none"""
    stop: int

    def __len__(self) -> int:
        return len(self.nominal)

    @property
    def done(self) -> Booleans:
        """Which of them are done, or received."""
        found: Booleans = self.ended != NEVER
        return found

    @property
    def responses(self) -> Integers:
        """The times from nominal release to end, of those that are done."""
        found: Integers = (self.ended - self.nominal)[self.done]
        return found

    @property
    def due(self) -> Booleans:
        """Which of them have their deadline within the run."""
        found: Booleans = self.deadline <= self.stop
        return found

    @property
    def missed(self) -> Booleans:
        """Which of those that are `due` were not done by their deadline, including skipped and aborted ones."""
        found: Booleans = self.due & ((self.ended == NEVER) | (self.ended > self.deadline))
        return found


@dataclass(frozen=True, kw_only=True)
class Jobs(_Records):
    """The jobs of one task, by index in the order of release, including skipped ones."""

    released: Integers
    """the releases"""
    written: Integers
    """Times at which outputs were sent"""
    preemptions: Integers
    """the number of preemptions of each"""
    outcome: Integers
    """DONE, UNFINISHED, SKIPPED or ABORTED"""

    @property
    def done(self) -> Booleans:
        """Which of them are done, without aborted ones."""
        found: Booleans = self.outcome == DONE
        return found


@dataclass(frozen=True, kw_only=True)
class Frames(_Records):
    """The messages of one name, in the order in which they were queued."""

    queued: Integers
    attempts: Integers
    """the number of transmissions; over two links at least two"""


@dataclass(frozen=True, kw_only=True)
class Slices:
    """The use of one processor, or of one link of a network, as consecutive slices."""

    owners: tuple[str, ...]
    """the names of its tasks, or of the messages over it"""
    owner: Integers
    """the index of the owner of each slice"""
    number: Integers
    """the index of its job or frame"""
    begin: Integers
    end: Integers
    kind: Integers
    """RUN, SWITCH or CORRUPTED"""


@dataclass(frozen=True, kw_only=True)
class Timeline:
    """The timeline of all computers and networks of a system, up to a time."""

    stop: int
    jobs: Mapping[str, Jobs]
    """Jobs by COMPUTER.TASK"""
    frames: Mapping[str, Frames]
    """Frames by NETWORK.MESSAGE"""
    processors: Mapping[str, Slices]
    """Slices by computer"""
    links: Mapping[str, Slices]
    """Slices by network or, where it has several links, by `NETWORK: NODE -> switch`"""
    happenings: Callable[[], Events]
    """the events, in order"""


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
        found = np.full(count, NEVER, dtype=np.int64)
        some = notes[what == kind]
        found[some[:, 3]] = some[:, 0]
        return found

    ended = times(note.FINISHED)
    outcome = np.where(ended == NEVER, UNFINISHED, DONE)
    outcome[notes[what == note.ABORTED, 3]] = ABORTED
    outcome[notes[what == note.SKIPPED, 3]] = SKIPPED
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
    started, ended = np.full((2, len(first)), NEVER, dtype=np.int64)
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
    kinds = np.where(kept[:, 1] == note.SWITCHING, SWITCH, RUN)
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
    return _slices(kept, np.where(is_corrupted, CORRUPTED, RUN), (note.FRAME_STARTED,), owners, names, stop)


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
