"""The periodic schedule of computers and networks whose timing is deterministic.

The timetable is made as for a run and compared in windows of the hyperperiod of all that shares a processor or a
network. Equal windows repeat for ever if no backlog grows from one to the next, or only that of a task to which no
other yields.
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds, nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.systems.computers import note, parts
from orchestration.systems.computers.compiled import scheduler
from orchestration.systems.computers.parts import LATER, NONE
from orchestration.systems.schedule.overload import errors_name_overload
from orchestration.systems.schedule.resources import Resources
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.component import Sampling, has_scheduled_instants
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import messages_by_connection, placed_messages, placed_tasks, released_by
from orchestration.theory.stability.operating_point import hyperperiod, hyperperiod_of, longest_period, periods_of
from orchestration.theory.stability.scheduled import expect_certain


@dataclass(frozen=True, kw_only=True)
class PeriodicSchedule:
    """The events of each period, from some period on; or, up to a horizon, all events until then."""

    period: Fraction
    """Period [s]"""
    begin: int = field(compare=False)
    """The begin of one from which on the events are these [ns]"""
    samples: Mapping[str, tuple[Fraction, ...]]
    """Times of the samples in a period [s], by component"""
    numbers: Mapping[str, tuple[int, ...]]
    """Numbers of these samples, had all periods from the begin of a run on as many"""
    sent: Mapping[str, tuple[Fraction, ...]]
    """Times at which messages are sent [s], by connection from continuous time over a network"""
    transit_times: Mapping[str, tuple[int | None, ...]]
    """Times from its sample, or its sending, to its arrival [ns], by connection; None: it does not arrive"""
    with_own_delay: frozenset[str]
    """connections whose own delays and losses `transit_times` include"""


NO_SCHEDULE = PeriodicSchedule(
    period=Fraction(1), begin=0, samples={}, numbers={}, sent={}, transit_times={}, with_own_delay=frozenset()
)  # fmt: skip
"""Schedule of a system without computers and networks"""


class ScheduleTrace:
    """The events of the scheduler up to a time."""

    def __init__(self, system: System, stop: int) -> None:
        self.resources = Resources(system, stop)
        running = scheduler(self.resources.of_run(Streams(system.seed, system.streams)))
        running.run(LATER)
        self.notes = running.take_notes()
        self.places = [each.place for each in placed_tasks(system.computers)]
        self.messages = [each.place for each in placed_messages(system.networks)]
        self.system, self.stop = system, stop

    @property
    def jobs(self) -> int:
        """The number of jobs and messages."""
        return int(np.isin(self.notes[:, 1], (note.RELEASED, note.QUEUED)).sum())

    def notes_of(self, kind: int, owner: int) -> Integers:
        """Notes of one kind of a task, message or carrier."""
        return np.asarray(self.notes[(self.notes[:, 1] == kind) & (self.notes[:, 2] == owner)])

    def schedule_between(self, begin: int, end: int, period: Fraction) -> PeriodicSchedule | None:
        """The events between two times [ns], as those of a `period` [s]; None where an arrival is not known.

        Of messages in transit at the end of the trace it is only known that they do not arrive by then.
        """
        parts, until = self.resources.parts, end == self.stop
        samples, sent, transit_times = dict[str, tuple[Fraction, ...]](), dict[str, tuple[Fraction, ...]](), {}
        numbers = dict[str, tuple[int, ...]]()
        for name, task in self.resources.tasks.items():
            times = self.notes_of(note.SAMPLED, task)[:, 4]
            samples[name], which = _offsets_between(times, begin, end, period)
            windows = [Fraction(time, NANOSECONDS) // period for time in times[which].tolist()]
            numbers[name] = tuple(k - window * len(which) for k, window in zip(which.tolist(), windows))
        released = frozenset(name for name, c in self.resources.carriers.items() if parts.carriers[c].releases)
        for name, c in self.resources.carriers.items():
            sender = parts.carriers[c].sender
            notes, arriving = self.notes_of(note.SENT, c), self.notes_of(note.ARRIVES, c)
            times = notes[:, 0] if sender == NONE else self.notes_of(note.SAMPLED, sender)[:, 4]
            outcome, arrives = np.full((2, len(times)), NONE)
            outcome[notes[:, 3]], arrives[arriving[:, 3]] = notes[:, 4], arriving[:, 4]
            offsets, which = _offsets_between(times, begin, end, period)
            is_open = (outcome[which] == NONE) | ((outcome[which] == 0) & (arrives[which] == NONE))
            if is_open.any() and not until:
                return None
            late = (arrives - times)[which].tolist()
            transit_times[name] = tuple(each if arrives[k] != NONE else None for each, k in zip(late, which.tolist()))
            if sender == NONE:
                sent[name] = offsets
        return PeriodicSchedule(
            period=period, begin=begin, samples=samples, numbers=numbers, sent=sent, transit_times=transit_times,
            with_own_delay=released,
        )  # fmt: skip


def _offsets_between(times: Integers, begin: int, end: int, period: Fraction) -> tuple[tuple[Fraction, ...], Integers]:
    """The times [ns] from `begin` to before `end`, as offsets in a period [s], in order; and their indices."""
    which = np.flatnonzero((times >= begin) & (times < end))
    offsets = [Fraction(time, NANOSECONDS) % period for time in times[which].tolist()]
    order = sorted(range(len(offsets)), key=offsets.__getitem__)
    return tuple(offsets[k] for k in order), which[order]


MAX_SIMULATED_JOBS = 200_000
"""Most jobs of all tasks and messages that are simulated"""
WINDOWS, MOST_WINDOWS = 12, 96
"""Windows that are compared at first, and at most"""
_WITH_TIMES = (note.RELEASED, note.SKIPPED, note.QUEUED, note.SAMPLED, note.ARRIVES)
"""Kinds of notes whose last number is a time"""
_WORK = (note.SWITCHING, note.STARTED, note.RESUMED)


def periodic_schedule(
    system: System, *, horizon: float | None = None, other_periods: Sequence[Fraction] = ()
) -> PeriodicSchedule:
    """The schedule of the computers and networks of a system.

    With a `horizon` [s] it is the events from 0 to there, as those of a period that is a multiple of `other_periods`
    [s]. Raises `UsageError` for a random quantity that the scheduler depends on, and for a schedule that does not
    become periodic.
    """
    if not system.uses_scheduler:
        return NO_SCHEDULE
    expect_certain(system)
    released = released_by(system)
    system = replace(
        system,
        connections=tuple(x if x.name in released else x.with_delay(0.0) for x in system.connections),
    )
    if horizon is not None:
        end = nanoseconds(horizon)
        whole = hyperperiod(other_periods) if other_periods else exact_nanoseconds(horizon) / NANOSECONDS
        period = math.ceil(exact_nanoseconds(horizon) / NANOSECONDS / whole) * whole
        return ScheduleTrace(system, end).schedule_between(0, end, period) or NO_SCHEDULE
    begin, length = begin_and_hyperperiod(instants(system))
    count = WINDOWS
    while True:
        trace = ScheduleTrace(system, begin + count * length)
        windows = _Windows(trace, begin, length, count)
        found = windows.schedule()
        if found is not None:
            return found
        if count >= MOST_WINDOWS or 4 * trace.jobs > MAX_SIMULATED_JOBS:
            with errors_name_overload(system):
                raise UsageError(windows.failure_text())
        count *= 2


def common_period(system: System, most: int) -> Fraction | None:
    """After how long the periods of a system and the schedule of its computers and networks repeat [ns].

    None: the periods of sampled components do not soon. Raises `UsageError` for a schedule that does not within `most`
    of the longest.
    """
    own = hyperperiod_of(system)
    if own is None or not system.uses_scheduler:
        return own
    found = hyperperiod([own, NANOSECONDS * periodic_schedule(system).period])
    if found > (limit := most * longest_period(system)):
        raise UsageError(
            f"computers and networks: their schedule repeats after {quantity(float(found) / NANOSECONDS, 's')}, which "
            f"is more than {most} of the longest period that a component has: expected periods that have more in common"
            f"{_one_that_repeats(system, limit)}"
        )
    return found


def _one_that_repeats(system: System, limit: Fraction) -> str:
    """The period by whose least change all of them repeat within a limit [ns], in words; empty: none alone."""
    named = {f"{each.place}.period": each.task.period for each in placed_tasks(system.computers)}
    named |= {f"{each.place}.period": each.message.period for each in placed_messages(system.networks)}
    shared = [period for _, period in instants(system)] + periods_of(system)
    found = list[tuple[Fraction, str, Fraction]]()
    for path, period in named.items():
        own = exact_nanoseconds(period or 0.0)
        if own not in shared:
            continue
        others = hyperperiod([each for k, each in enumerate(shared) if k != shared.index(own)])
        for most in range(1, MOST_PARTS + 1):
            ratio = (own / others).limit_denominator(most)
            if ratio and others * ratio.numerator <= limit and (others * ratio).denominator == 1:
                found.append((abs(others * ratio / own - 1), path, others * ratio))
    if not found:
        return ""
    _, path, nearest = min(found)
    return f", as {path} = {float(nearest) / NANOSECONDS:.12g}"


MOST_PARTS = 10
"""Parts of the period of all others, of which a period may be some so that it is proposed"""


def instants(system: System) -> list[tuple[Fraction, Fraction]]:
    """The offset and the period [ns] of everything periodic that shares a resource."""
    over, releases = messages_by_connection(system), released_by(system)
    senders = {x.sender for x in system.connections if x.name in over or x.name in releases}
    samplings = (system.components[name].sampling for name in senders)
    grids = [(x.true_offset, x.true_period) for x in samplings if x is not None and not has_scheduled_instants(x)]
    for task in placed_tasks(system.computers):
        if task.task.period is not None:
            clock = Sampling(period=task.task.period, offset=task.task.offset, clock_ratio=task.computer.clock_ratio)
            grids.append((clock.true_offset, clock.true_period))
    for of in placed_messages(system.networks):
        if of.message.period is not None:
            grids.append((exact_nanoseconds(of.message.offset), exact_nanoseconds(of.message.period)))
    cycles = [sum(map(exact_nanoseconds, each.slots), Fraction(0)) for each in system.networks.values() if each.slots]
    return grids + [(Fraction(0), cycle) for cycle in cycles]


def begin_and_hyperperiod(instants: Sequence[tuple[Fraction, Fraction]]) -> tuple[int, int]:
    """A multiple of the hyperperiod by which all have begun, and the hyperperiod [ns].

    Raises `UsageError` where it is too long for its jobs.
    """
    periods = [period for _, period in instants] or [Fraction(NANOSECONDS)]
    length = hyperperiod(periods).numerator  # a multiple, where it is no whole number
    begin = math.ceil(max((offset for offset, _ in instants), default=Fraction(0)) / length) * length
    jobs = sum((begin + WINDOWS * length) / period for period in periods)
    if jobs > MAX_SIMULATED_JOBS:
        raise UsageError(
            f"computers and networks: {int(jobs)} jobs and messages in {WINDOWS} hyperperiods of "
            f"{length / NANOSECONDS:g} s: more than {MAX_SIMULATED_JOBS}; expected periods that have more in common"
        )
    return begin, length


class _Windows:
    """A trace, cut into windows of one length from where all have begun."""

    def __init__(self, trace: ScheduleTrace, begin: int, length: int, count: int) -> None:
        self._trace, self._begin, self._length, self._count = trace, begin, length, count
        notes = trace.notes[trace.notes[:, 0] >= begin]
        window = (notes[:, 0] - begin) // length
        content, are_times = notes[:, [0, 1, 2, 4]], np.isin(notes[:, 1], _WITH_TIMES)
        content[:, 0] -= window * length
        content[are_times, 3] -= (window * length)[are_times]
        content[notes[:, 1] == note.WRITTEN, 3] = 0
        ends = np.searchsorted(window, np.arange(count + 1))
        self._parts = [notes[begin:end] for begin, end in itertools.pairwise(ends.tolist())]
        self._contents = [content[begin:end].tobytes() for begin, end in itertools.pairwise(ends.tolist())]

    def schedule(self) -> PeriodicSchedule | None:
        """The schedule that repeats from some window on; None where none is proved to."""
        for turns in range(1, self._count // 4 + 1):
            alike = max(3 * turns, turns + 1 + math.ceil(self._longest / self._length))
            first = self._count - alike
            if first < 0 or any(
                self._contents[i] != self._contents[i - turns] for i in range(first + turns, self._count)
            ):
                continue
            if not self._repeats_for_ever(np.concatenate(self._parts[-turns:])):
                continue
            begin, length = self._begin + first * self._length, turns * self._length
            return self._trace.schedule_between(begin, begin + length, Fraction(length, NANOSECONDS))
        return None

    @property
    def _longest(self) -> int:
        """The longest time without a note [ns] of a job, a frame, or a message that will release a task."""
        arrivals = self._trace.notes[self._trace.notes[:, 1] == note.ARRIVES]
        placed = placed_tasks(self._trace.system.computers)
        jobs = [nanoseconds(highest(each.task.execution) + each.computer.switch) for each in placed]
        frames = [leg.length + of.pause for of in self._trace.resources.parts.messages for leg in of.legs]
        return max(int((arrivals[:, 4] - arrivals[:, 0]).max(initial=0)), *jobs, *frames, 0)

    def _repeats_for_ever(self, notes: Integers) -> bool:
        """Whether the events of some equal windows repeat for ever.

        As many jobs end as are released, so that every queue is as it was before. The jobs of a task may pile up if its
        priority is fixed and its own alone.
        """
        of_all, count = self._trace.resources.parts, _counter(notes)
        for i, task in enumerate(of_all.tasks):
            over = count(note.FINISHED, i) + count(note.ABORTED, i)
            works = any(count(kind, i) for kind in _WORK)
            more, processor = count(note.RELEASED, i) - over, of_all.processors[task.processor]
            others = [one for j, one in enumerate(of_all.tasks) if one.processor == task.processor and j != i]
            first = processor.policy == parts.FIXED_PRIORITY and all(one.priority != task.priority for one in others)
            if more < 0 or (more > 0 and not first) or (works and not over):
                return False
        for c, carrier in enumerate(of_all.carriers):
            if carrier.sender != parts.NONE and count(note.SAMPLED, carrier.sender) != count(note.SENT, c):
                return False
        return all(count(note.QUEUED, m) == self._received(notes, m) for m in range(len(of_all.messages)))

    def _received(self, notes: Integers, message: int) -> int:
        """How many frames of a message were received."""
        last = len(self._trace.resources.parts.messages[message].legs) - 1
        return int(((notes[:, 1] == note.FRAME_TRANSMITTED) & (notes[:, 2] == message) & (notes[:, 4] == last)).sum())

    def failure_text(self) -> str:
        """Why no schedule repeats, in one line."""
        half = np.concatenate(self._parts[-(self._count // 2) :])
        count, seconds = _counter(half), self._count // 2 * self._length / NANOSECONDS
        for i, place in enumerate(self._trace.places):
            more = count(note.RELEASED, i) - count(note.FINISHED, i) - count(note.ABORTED, i)
            if more > self._count // 4:
                return (
                    f"{place}: falls behind by {more} jobs in {seconds:g} s, and makes others late; expected less load"
                )
        for m, place in enumerate(self._trace.messages):
            more = count(note.QUEUED, m) - self._received(half, m)
            if more > self._count // 4:
                return f"{place}: falls behind by {more} messages in {seconds:g} s; expected less load"
        return (
            f"computers and networks: their schedule does not repeat after {self._count} hyperperiods of "
            f"{self._length / NANOSECONDS:g} s"
        )


def _counter(notes: Integers) -> Callable[[int, int], int]:
    """A function that counts the notes of a kind of a task, message or carrier."""
    return lambda kind, owner: int(((notes[:, 1] == kind) & (notes[:, 2] == owner)).sum())
