"""What theory says of response times: bounds that no job and no frame exceeds, whatever its offsets and its luck.

Times are whole nanoseconds; a period may be any fraction of them, as instants are those of a grid, rounded. Responses
count from the nominal release, so that its lateness is in them. None stands where theory has no bound.

Fixed priorities, preemptive: Joseph and Pandya 1986, Lehoczky 1990 for deadlines beyond the period, Tindell, Burns and
Wellings 1994 for release jitter. Not preemptive, and CAN: Davis, Burns, Bril and Lukkien 2007. Earliest deadline: the
demand test of Baruah, Rosier and Howell 1990, with the blocking of Jeffay, Stanat and Martel 1991 if not preemptive.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial

STEPS = 100_000
"""of an iteration, or jobs of a busy period: what takes more, as close to a full load, is given up"""


@dataclass(frozen=True, kw_only=True)
class Periodic:
    """A task, or a message whose frames are its jobs."""

    execution: int
    """the most that a job takes, or the length of a frame"""
    period: int | Fraction | None
    """from one nominal release to the next; None: releases come by chance, or nobody knows when"""
    jitter: int = 0
    """the largest lateness of a release"""
    deadline: int = 0
    """from the nominal release; for earliest deadlines only"""
    priority: int = 1
    """1 is more urgent than 2"""
    counts_when_queued: bool = False
    """whether its responses count from when it is released, however late that is"""


def fixed_priority(tasks: Sequence[Periodic], *, preemptive: bool, switch: int) -> list[int | None]:
    """Of each task on one processor with fixed priorities, the most that its responses can be.

    Tasks of equal priority count as more urgent than each other. Every begin and every resume costs `switch`: a job
    that displaces another costs its own and the other's second.
    """
    tasks = [_on_grid(task) for task in tasks]
    return [_of_task(tasks, i, preemptive, switch) for i in range(len(tasks))]


def can(frames: Sequence[Periodic], *, bit: int) -> list[int | None]:
    """Of each message on a CAN bus, the most that its responses can be; `bit` is the time of one, rounded up."""
    frames = [_on_grid(frame) for frame in frames]
    found = []
    for i, frame in enumerate(frames):
        above = [other for j, other in enumerate(frames) if j != i and other.priority < frame.priority]
        below = [other.execution for other in frames if other.priority > frame.priority]
        found.append(_uninterrupted(frame, above, blocking=max(below, default=0), seen_after=bit))
    return found


def earliest_deadline(tasks: Sequence[Periodic], *, preemptive: bool, switch: int) -> list[int | None]:
    """The deadline of each task, if the processor can give all jobs by theirs what they take; else None of each."""
    begins = 2 * switch if preemptive else switch
    tasks = [_costing(_on_grid(task), begins) for task in tasks]
    holds = _load(tasks) <= 1 and _meets_demand(tasks, preemptive)
    return [task.deadline if holds else None for task in tasks]


def _on_grid(task: Periodic) -> Periodic:
    """Releases on a grid that is no whole number of nanoseconds are late or early by half of one."""
    if task.period is None or task.period == int(task.period):
        return task if task.period is None else replace(task, period=int(task.period))
    return replace(task, jitter=task.jitter + 1)


def _costing(task: Periodic, more: int) -> Periodic:
    """With what a job takes besides; one that takes no time counts as 1 ns, for those of one task begin 1 ns apart."""
    return replace(task, execution=max(task.execution + more, 1))


def _load(tasks: Sequence[Periodic]) -> Fraction:
    """The share of the time that they take; more than 1 if nobody knows."""
    if any(task.period is None for task in tasks):
        return Fraction(2)
    return sum((Fraction(task.execution) / Fraction(task.period or 1) for task in tasks), Fraction(0))


def _released(task: Periodic, within: int) -> int:
    """How many jobs at most are released in a time that begins with a release, its end not included."""
    assert task.period is not None
    return int(-(-(within + task.jitter) // task.period))


def _after(work: int, tasks: Sequence[Periodic], within: int, seen_after: int = 0) -> int:
    """When `work` is done, if so long after the begin, and what is released `seen_after` later, tasks come before."""
    return work + sum(_released(task, within + seen_after) * task.execution for task in tasks)


def _settled(first: int, following: Callable[[int], int]) -> int | None:
    """Where an iteration that only grows comes to rest; None: not in `STEPS`."""
    before = first
    for _ in range(STEPS):
        after = following(before)
        if after == before:
            return after
        before = after
    return None


def _of_task(tasks: Sequence[Periodic], i: int, preemptive: bool, switch: int) -> int | None:
    own = _costing(tasks[i], switch)
    others = [other for j, other in enumerate(tasks) if j != i]
    above = [_costing(each, 2 * switch if preemptive else switch) for each in others if each.priority <= own.priority]
    if preemptive:
        return _interrupted(own, above)
    below = [each.execution + switch - 1 for each in others if each.priority > own.priority]
    return _uninterrupted(own, above, blocking=max((0, *below)), seen_after=1)


def _interrupted(own: Periodic, above: Sequence[Periodic]) -> int | None:
    """The response of a job that all above may interrupt, over all jobs of the longest busy period."""
    if _load([own, *above]) > 1:
        return None
    assert own.period is not None
    most, end = 0, 0
    for number in range(STEPS):
        work = (number + 1) * own.execution
        found = _settled(max(end, work), partial(_after, work, above))
        if found is None:
            return None
        end = found
        most = max(most, math.floor(end + own.jitter - number * own.period))
        if end <= (number + 1) * own.period - own.jitter:
            return most
    return None


def _uninterrupted(own: Periodic, above: Sequence[Periodic], *, blocking: int, seen_after: int) -> int | None:
    """The response of a job that is not interrupted once it has begun, over all jobs of the longest busy period.

    What is released `seen_after` ns before it begins, or later, does not come before it.
    """
    if _load([own, *above]) > 1:
        return None
    assert own.period is not None
    longest = _settled(own.execution, partial(_after, blocking, [own, *above]))
    if longest is None or (count := _released(own, longest)) > STEPS:
        return None
    most, begin = 0, 0
    for number in range(count):
        before = blocking + number * own.execution
        found = _settled(max(begin, before), partial(_after, before, above, seen_after=seen_after))
        if found is None:
            return None
        begin = found
        nominal = number * own.period - own.jitter
        since = max(nominal, 0) if own.counts_when_queued else nominal
        most = max(most, math.floor(begin + own.execution - since))
    return most


def _meets_demand(tasks: Sequence[Periodic], preemptive: bool) -> bool:
    """Whether up to each deadline of the longest busy period no more is demanded than there is time."""
    allowed = [task.deadline - task.jitter for task in tasks]
    block = 0 if preemptive else max((task.execution - 1 for task in tasks), default=0)
    longest = _settled(sum(task.execution for task in tasks), partial(_after, block, tasks))
    if longest is None or sum(_released(task, longest) for task in tasks) > STEPS:
        return False
    times: set[int] = set()
    for task, first in zip(tasks, allowed, strict=True):
        assert task.period is not None
        count = max(math.ceil((longest - first) / Fraction(task.period)), 0) + 1
        times.update(math.floor(first + k * task.period) for k in range(count))
    return all(_demand(tasks, allowed, time) + _blocked(tasks, allowed, time, preemptive) <= time for time in times)


def _demand(tasks: Sequence[Periodic], allowed: Sequence[int], time: int) -> int:
    """What jobs take that are released and due within a time."""
    total = 0
    for task, first in zip(tasks, allowed, strict=True):
        assert task.period is not None
        total += max(math.floor((time - first) // task.period) + 1, 0) * task.execution
    return total


def _blocked(tasks: Sequence[Periodic], allowed: Sequence[int], time: int, preemptive: bool) -> int:
    """What a job that is due later takes of it, if it cannot be interrupted."""
    if preemptive:
        return 0
    return max((task.execution - 1 for task, first in zip(tasks, allowed, strict=True) if first > time), default=0)
