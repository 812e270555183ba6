"""What a scheduler does again and again, where nothing in that is left to chance.

The timetable is made as for a run and looked at in windows of the period of all that shares a processor or a network.
Windows in which the same happens follow one another without end if nothing waits longer in one than in the one before,
or if what does is the backlog of a task that no other gives way to.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Integers
from orchestration.computers.parts import (
    ABORTED,
    ARRIVES,
    FINISHED,
    FIXED_PRIORITY,
    NONE,
    PASSED,
    QUEUED,
    RELEASED,
    RESUMED,
    SAMPLED,
    SENT,
    SKIPPED,
    STARTED,
    SWITCHING,
    WRITTEN,
)
from orchestration.exact.clockwork import together
from orchestration.exact.foretold import NOTHING, Course, Foretold
from orchestration.exact.shared import expect_certain, is_shared
from orchestration.system.distribution import highest
from orchestration.system.model import System
from orchestration.system.placement import carried, placed_messages, placed_tasks, released_by
from orchestration.system.sampling import is_foreseen
from orchestration.system.times import NANOSECONDS, exact_nanoseconds, nanoseconds

MOST_JOBS = 200_000
"""of all tasks and messages together that are gone through"""
WINDOWS, MOST_WINDOWS = 12, 96
"""that are looked at first, and at most"""
_ARE_TIMES = (RELEASED, SKIPPED, QUEUED, SAMPLED, ARRIVES)
"""Kinds of notes whose last number is a time"""
_WORK = (SWITCHING, STARTED, RESUMED)


def foretold(system: System, *, horizon: float | None = None, beside: Sequence[Fraction] = ()) -> Foretold:
    """What the scheduler of a system decides, of which nothing may be left to chance.

    With a `horizon` [s] it is what happens from 0 to there, as of a period that is a multiple of those `beside` [s].
    Raises `UsageError` for what is random in it, and for what does not come to repeat itself.
    """
    if not is_shared(system):
        return NOTHING
    expect_certain(system)
    released = released_by(system)
    system = replace(
        system,
        connections=tuple(
            x
            if x.name in released
            else replace(x, delay=0.0, delay_jitter=0.0, jitter_distribution="uniform", loss=0.0, burst_length=None)
            for x in system.connections
        ),
    )
    if horizon is not None:
        end = nanoseconds(horizon)
        whole = together(beside) if beside else exact_nanoseconds(horizon) / NANOSECONDS
        period = math.ceil(exact_nanoseconds(horizon) / NANOSECONDS / whole) * whole
        return Course(system, end).foretold(0, end, period) or NOTHING
    begin, length = _common(_instants(system))
    count = WINDOWS
    while True:
        course = Course(system, begin + count * length)
        windows = _Windows(course, begin, length, count)
        found = windows.foretold()
        if found is not None:
            return found
        if count >= MOST_WINDOWS or 4 * course.jobs > MOST_JOBS:
            raise UsageError(windows.why_not())
        count *= 2


def _instants(system: System) -> list[tuple[Fraction, Fraction]]:
    """The offset and the period [ns] of everything that comes by itself and shares something."""
    over, releases = carried(system), released_by(system)
    found = []
    for task in placed_tasks(system.computers):
        if task.task.period is not None:
            found.append((task.task.offset, task.task.period, task.computer.clock_ratio))
    for message in placed_messages(system.networks):
        if message.message.period is not None:
            found.append((message.message.offset, message.message.period, 1.0))
    for name in {x.sender for x in system.connections if x.name in over or x.name in releases}:
        sampling = system.components[name].sampling
        if sampling is not None and not is_foreseen(sampling):
            found.append((sampling.offset, sampling.period, sampling.clock_ratio))
    ratios = [Fraction(repr(float(ratio))) for _, _, ratio in found]
    grids = [(exact_nanoseconds(o) / r, exact_nanoseconds(p) / r) for (o, p, _), r in zip(found, ratios)]
    cycles = [sum(map(exact_nanoseconds, each.slots), Fraction(0)) for each in system.networks.values() if each.slots]
    return grids + [(Fraction(0), cycle) for cycle in cycles]


def _common(instants: Sequence[tuple[Fraction, Fraction]]) -> tuple[int, int]:
    """By when all have begun, and the time after which they are due together again [ns], which divides that."""
    periods = [period for _, period in instants] or [Fraction(NANOSECONDS)]
    length = together(periods).numerator  # of so many of them, where it is no whole number
    begin = math.ceil(max((offset for offset, _ in instants), default=Fraction(0)) / length) * length
    jobs = sum((begin + WINDOWS * length) / period for period in periods)
    if jobs > MOST_JOBS:
        raise UsageError(
            f"computers and networks: {int(jobs)} jobs and messages until all have been due together for {WINDOWS} "
            f"times, {length / NANOSECONDS:g} s each: more than {MOST_JOBS}; expected periods that have more in common"
        )
    return begin, length


class _Windows:
    """A course, from where all have begun cut into windows of one length."""

    def __init__(self, course: Course, begin: int, length: int, count: int) -> None:
        self._course, self._begin, self._length, self._count = course, begin, length, count
        notes = course.notes[course.notes[:, 0] >= begin]
        window = (notes[:, 0] - begin) // length
        told, are_times = notes[:, [0, 1, 2, 4]], np.isin(notes[:, 1], _ARE_TIMES)
        told[:, 0] -= window * length
        told[are_times, 3] -= (window * length)[are_times]
        told[notes[:, 1] == WRITTEN, 3] = 0
        ends = np.searchsorted(window, np.arange(count + 1))
        self._parts = [notes[begin:end] for begin, end in itertools.pairwise(ends.tolist())]
        self._said = [told[begin:end].tobytes() for begin, end in itertools.pairwise(ends.tolist())]

    def foretold(self) -> Foretold | None:
        """What happens from some window on again and again; None where that is not known."""
        for turns in range(1, self._count // 4 + 1):
            alike = max(3 * turns, turns + 1 + math.ceil(self._longest / self._length))
            first = self._count - alike
            if first < 0 or any(self._said[i] != self._said[i - turns] for i in range(first + turns, self._count)):
                continue
            if not self._goes_on(np.concatenate(self._parts[-turns:])):
                continue
            begin, length = self._begin + first * self._length, turns * self._length
            return self._course.foretold(begin, begin + length, Fraction(length, NANOSECONDS))
        return None

    @property
    def _longest(self) -> int:
        """That something may go on without a note [ns]: a job, a frame, what is on its way to release a task."""
        arrivals = self._course.notes[self._course.notes[:, 1] == ARRIVES]
        placed = placed_tasks(self._course.system.computers)
        jobs = [nanoseconds(highest(each.task.execution) + each.computer.switch) for each in placed]
        frames = [leg.length + of.pause for of in self._course.resources.parts.messages for leg in of.legs]
        return max(int((arrivals[:, 4] - arrivals[:, 0]).max(initial=0)), *jobs, *frames, 0)

    def _goes_on(self, notes: Integers) -> bool:
        """Whether what happens in some windows that repeat goes on for ever.

        As many jobs are over as were released: so all that waits is as it was. Of a task whose jobs pile up nothing
        counts but its priority, which no other has.
        """
        parts, count = self._course.resources.parts, _counted(notes)
        for i, task in enumerate(parts.tasks):
            over, works = count(FINISHED, i) + count(ABORTED, i), any(count(kind, i) for kind in _WORK)
            more, processor = count(RELEASED, i) - over, parts.processors[task.processor]
            others = [one for j, one in enumerate(parts.tasks) if one.processor == task.processor and j != i]
            first = processor.policy == FIXED_PRIORITY and all(one.priority != task.priority for one in others)
            if more < 0 or (more > 0 and not first) or (works and not over):
                return False
        for c, carrier in enumerate(parts.carriers):
            if carrier.sender != NONE and count(SAMPLED, carrier.sender) != count(SENT, c):
                return False
        return all(count(QUEUED, m) == self._passed(notes, m) for m in range(len(parts.messages)))

    def _passed(self, notes: Integers, message: int) -> int:
        """How many frames were received."""
        last = len(self._course.resources.parts.messages[message].legs) - 1
        return int(((notes[:, 1] == PASSED) & (notes[:, 2] == message) & (notes[:, 4] == last)).sum())

    def why_not(self) -> str:
        """What stands in the way, in a line."""
        half = np.concatenate(self._parts[-(self._count // 2) :])
        count, seconds = _counted(half), self._count // 2 * self._length / NANOSECONDS
        for i, place in enumerate(self._course.places):
            more = count(RELEASED, i) - count(FINISHED, i) - count(ABORTED, i)
            if more > self._count // 4:
                return (
                    f"{place}: falls behind by {more} jobs in {seconds:g} s, and makes others late; expected less load"
                )
        for m, place in enumerate(self._course.messages):
            more = count(QUEUED, m) - self._passed(half, m)
            if more > self._count // 4:
                return f"{place}: falls behind by {more} messages in {seconds:g} s; expected less load"
        return (
            f"computers and networks: what they do has not come to repeat itself after {self._count} times the "
            f"{self._length / NANOSECONDS:g} s after which all are due together again"
        )


def _counted(notes: Integers) -> Callable[[int, int], int]:
    """How many notes there are of a kind of a task, message or carrier."""
    return lambda kind, whose: int(((notes[:, 1] == kind) & (notes[:, 2] == whose)).sum())
