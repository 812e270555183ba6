"""Response-time analysis: bounds that no job and no frame exceeds, for any offsets and any random numbers.

Times are whole nanoseconds; a period may be any fraction of them, as instants are those of a grid, rounded. Responses
count from the nominal release, and so include its lateness. None stands for no bound.

Fixed priorities, preemptive: Joseph and Pandya 1986, Lehoczky 1990 for deadlines beyond the period, Tindell, Burns and
Wellings 1994 for release jitter. Not preemptive, and CAN: Davis, Burns, Bril and Lukkien 2007. Earliest deadline: the
demand test of Baruah, Rosier and Howell 1990, with the blocking of Jeffay, Stanat and Martel 1991 if not preemptive.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import Any

from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds, nanoseconds
from orchestration.systems.system.component import SamplingOnArrival
from orchestration.systems.system.computers import Computer, Message, Network, Task
from orchestration.systems.system.distribution import highest, lowest
from orchestration.systems.system.frames import frame_nanoseconds
from orchestration.systems.system.model import System

STEPS = 100_000
"""Steps of an iteration, or jobs of a busy period: beyond them, as near full load, there is no bound"""


@dataclass(frozen=True, kw_only=True)
class Periodic:
    """A task, or a message whose frames are its jobs."""

    execution: int
    """the worst-case execution time of a job, or the length of a frame"""
    period: int | Fraction | None
    """Time from one nominal release to the next; None: releases are random or unknown"""
    jitter: int = 0
    """the largest lateness of a release"""
    deadline: int = 0
    """Time from the nominal release to the deadline; only used for earliest deadline first"""
    priority: int = 1
    """1 is more urgent than 2"""
    counts_when_queued: bool = False
    """whether its responses count from the actual release"""


def fixed_priority(tasks: Sequence[Periodic], *, preemptive: bool, switch: int) -> list[int | None]:
    """Bounds on the responses of the tasks on one processor with fixed priorities.

    Tasks of equal priority count as more urgent than each other. Every start and every resume costs `switch`: a job
    that preempts another adds its own and a second one of the other.
    """
    tasks = [_with_rounding(task) for task in tasks]
    return [_of_task(tasks, i, preemptive, switch) for i in range(len(tasks))]


def can(frames: Sequence[Periodic], *, bit: int) -> list[int | None]:
    """Bounds on the responses of the messages on a CAN bus; `bit` is the time of a bit, rounded up."""
    frames = [_with_rounding(frame) for frame in frames]
    found = []
    for i, frame in enumerate(frames):
        above = [other for j, other in enumerate(frames) if j != i and other.priority < frame.priority]
        below = [other.execution for other in frames if other.priority > frame.priority]
        found.append(_nonpreemptive_response(frame, above, blocking=max(below, default=0), seen_after=bit))
    return found


def earliest_deadline(tasks: Sequence[Periodic], *, preemptive: bool, switch: int) -> list[int | None]:
    """The deadlines of the tasks, if all jobs always meet them; else None for each."""
    begins = 2 * switch if preemptive else switch
    tasks = [_with_overhead(_with_rounding(task), begins) for task in tasks]
    holds = _utilisation(tasks) <= 1 and _meets_demand(tasks, preemptive)
    return [task.deadline if holds else None for task in tasks]


def _with_rounding(task: Periodic) -> Periodic:
    """The task with the rounding of its releases as jitter, if its period is no whole number of nanoseconds."""
    if task.period is None or task.period == int(task.period):
        return task if task.period is None else replace(task, period=int(task.period))
    return replace(task, jitter=task.jitter + 1)


def _with_overhead(task: Periodic, more: int) -> Periodic:
    """The task with `more` overhead; at least 1 ns in all, as jobs of one task start 1 ns apart."""
    return replace(task, execution=max(task.execution + more, 1))


def _utilisation(tasks: Sequence[Periodic]) -> Fraction:
    """The utilisation by the tasks; above 1 if it is unknown."""
    if any(task.period is None for task in tasks):
        return Fraction(2)
    return sum((Fraction(task.execution) / Fraction(task.period or 1) for task in tasks), Fraction(0))


def _released(task: Periodic, within: int) -> int:
    """The most jobs that are released in an interval `within` that begins with a release, without its end."""
    assert task.period is not None
    return int(-(-(within + task.jitter) // task.period))


def _total_work(work: int, tasks: Sequence[Periodic], within: int, seen_after: int = 0) -> int:
    """`work`, with all jobs of `tasks` that are released in the interval `within` and `seen_after` beyond it."""
    return work + sum(_released(task, within + seen_after) * task.execution for task in tasks)


def _fixed_point(first: int, following: Callable[[int], int]) -> int | None:
    """The fixed point of an increasing iteration; None: not within `STEPS`."""
    before = first
    for _ in range(STEPS):
        after = following(before)
        if after == before:
            return after
        before = after
    return None


def _of_task(tasks: Sequence[Periodic], i: int, preemptive: bool, switch: int) -> int | None:
    own = _with_overhead(tasks[i], switch)
    others = [other for j, other in enumerate(tasks) if j != i]
    above = [
        _with_overhead(each, 2 * switch if preemptive else switch) for each in others if each.priority <= own.priority
    ]
    if preemptive:
        return _preemptive_response(own, above)
    below = [each.execution + switch - 1 for each in others if each.priority > own.priority]
    return _nonpreemptive_response(own, above, blocking=max((0, *below)), seen_after=1)


def _preemptive_response(own: Periodic, above: Sequence[Periodic]) -> int | None:
    """The largest response in the longest busy period of jobs that those of `above` preempt."""
    if _utilisation([own, *above]) > 1:
        return None
    assert own.period is not None
    most, end = 0, 0
    for number in range(STEPS):
        work = (number + 1) * own.execution
        found = _fixed_point(max(end, work), partial(_total_work, work, above))
        if found is None:
            return None
        end = found
        most = max(most, math.floor(end + own.jitter - number * own.period))
        if end <= (number + 1) * own.period - own.jitter:
            return most
    return None


def _nonpreemptive_response(own: Periodic, above: Sequence[Periodic], *, blocking: int, seen_after: int) -> int | None:
    """The largest response in the longest busy period of jobs that are not preempted once started.

    Releases less than `seen_after` ns after the start of a job count as before it.
    """
    if _utilisation([own, *above]) > 1:
        return None
    assert own.period is not None
    longest = _fixed_point(own.execution, partial(_total_work, blocking, [own, *above]))
    if longest is None or (count := _released(own, longest)) > STEPS:
        return None
    most, begin = 0, 0
    for number in range(count):
        before = blocking + number * own.execution
        found = _fixed_point(max(begin, before), partial(_total_work, before, above, seen_after=seen_after))
        if found is None:
            return None
        begin = found
        nominal = number * own.period - own.jitter
        since = max(nominal, 0) if own.counts_when_queued else nominal
        most = max(most, math.floor(begin + own.execution - since))
    return most


def _meets_demand(tasks: Sequence[Periodic], preemptive: bool) -> bool:
    """Whether the demand up to each deadline of the longest busy period is at most the time."""
    allowed = [task.deadline - task.jitter for task in tasks]
    block = 0 if preemptive else max((task.execution - 1 for task in tasks), default=0)
    longest = _fixed_point(sum(task.execution for task in tasks), partial(_total_work, block, tasks))
    if longest is None or sum(_released(task, longest) for task in tasks) > STEPS:
        return False
    times: set[int] = set()
    for task, first in zip(tasks, allowed, strict=True):
        assert task.period is not None
        count = max(math.ceil((longest - first) / Fraction(task.period)), 0) + 1
        times.update(math.ceil(first + k * task.period) for k in range(count))
    return all(_demand(tasks, allowed, time) + _blocking(tasks, allowed, time, preemptive) <= time for time in times)


def _demand(tasks: Sequence[Periodic], allowed: Sequence[int], time: int) -> int:
    """The execution time of the jobs that are released and due within a time."""
    total = 0
    for task, first in zip(tasks, allowed, strict=True):
        assert task.period is not None
        total += max(math.floor((time - first) // task.period) + 1, 0) * task.execution
    return total


def _blocking(tasks: Sequence[Periodic], allowed: Sequence[int], time: int, preemptive: bool) -> int:
    """The blocking by a job that is due later, if it is not preempted."""
    if preemptive:
        return 0
    return max((task.execution - 1 for task, first in zip(tasks, allowed, strict=True) if first > time), default=0)


Bounds = dict[str, int | None]
"""Bounds [ns] by COMPUTER.TASK or NETWORK.MESSAGE; None without a bound"""


def bounds_of(system: System) -> Bounds:
    """Upper bounds on responses, for any seed.

    There is none for random arrivals and releases by messages, nor for first come, TDMA, Ethernet and networks with
    errors. The jitter of a message of a task is the variation of the task's response, if that has a bound.
    """
    found: Bounds = {}
    for name, computer in system.computers.items():
        bounds = _of_computer(computer)
        found |= {f"{name}.{task}": bound for task, bound in zip(computer.tasks, bounds, strict=True)}
    for name, network in system.networks.items():
        found |= {f"{name}.{message}": bound for message, bound in _of_network(system, network, found).items()}
    return found


def _of_computer(computer: Computer) -> list[int | None]:
    policies = {"fixed-priority": fixed_priority, "earliest-deadline-first": earliest_deadline}
    if computer.scheduling not in policies:
        return [None] * len(computer.tasks)
    tasks = [_periodic(task, computer) for task in computer.tasks.values()]
    bounds = policies[computer.scheduling]
    return bounds(tasks, preemptive=computer.preemptive, switch=nanoseconds(computer.switch))


def _periodic(task: Task, computer: Computer) -> Periodic:
    return Periodic(
        execution=nanoseconds(highest(task.execution)),
        period=None if task.period is None else _true_period(task.period, computer.clock_ratio),
        jitter=nanoseconds(highest(task.jitter)),
        deadline=nanoseconds(task.due),
        priority=task.priority,
    )


def _true_period(period: float, clock_ratio: float) -> Fraction:
    return exact_nanoseconds(period) / Fraction(repr(float(clock_ratio)))


def _of_network(system: System, network: Network, bounds: Bounds) -> Bounds:
    if network.kind not in ("can", "can-fd") or network.error > 0.0:
        return dict.fromkeys(network.messages)
    frames = {}
    for name, message in network.messages.items():
        length = frame_nanoseconds(network, message)
        frame = Periodic(execution=length, period=None, priority=message.identifier or 0)
        frames[name] = replace(frame, **_queueing(system, message, bounds))
    bit = math.ceil(NANOSECONDS / Fraction(repr(float(network.bit_rate))))
    return dict(zip(frames, can([*frames.values()], bit=bit), strict=True))


def _queueing(system: System, message: Message, bounds: Bounds) -> dict[str, Any]:
    """The times at which frames of a message are queued, as fields of `Periodic`."""
    if message.connection is None or message.period is not None:
        period = None if message.period is None else exact_nanoseconds(message.period)
        return {"period": period, "jitter": nanoseconds(highest(message.jitter))}
    sender = next(x.sender for x in system.connections if x.name == message.connection)
    for name, computer in system.computers.items():
        for task_name, task in computer.tasks.items():
            if task.component == sender:
                return _writing(task, computer, bounds[f"{name}.{task_name}"])
    sampling = system.components[sender].sampling
    if sampling is None or isinstance(sampling, SamplingOnArrival):
        return {}
    period = _true_period(sampling.period, sampling.clock_ratio)
    return {"period": period, "jitter": nanoseconds(highest(sampling.jitter)), "counts_when_queued": True}


def _writing(task: Task, computer: Computer, bound: int | None) -> dict[str, Any]:
    """The times at which a task writes: when a job is done, or at its deadline if it is done by then."""
    if task.period is None or bound is None:
        return {}
    least = nanoseconds(lowest(task.execution)) + nanoseconds(computer.switch)
    jitter = bound - least if task.write == "end" else max(bound - nanoseconds(task.due), 0)
    return {"period": _true_period(task.period, computer.clock_ratio), "jitter": jitter, "counts_when_queued": True}
