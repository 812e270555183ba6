"""Statistics of the tasks and messages of a system: responses, missed deadlines, and the bounds of theory.

Times are in seconds.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import seconds
from orchestration.systems.computers.bounds import bounds_of
from orchestration.systems.computers.timeline import ABORTED, NEVER, SKIPPED, Frames, Jobs, Timeline
from orchestration.systems.schedule.overload import demand_of, rate_of
from orchestration.systems.system.frames import frame_nanoseconds
from orchestration.systems.system.model import System

NO_DEADLINE = 2**60
"""Deadline that counts as none [ns], as every later one"""


@dataclass(frozen=True, kw_only=True)
class Spread:
    """The spread of times."""

    min: float
    mean: float
    p99: float
    """the element ⌈.99 n⌉ of n in order"""
    max: float

    @classmethod
    def of(cls, times: Integers) -> "Spread | None":
        """The spread of times [ns]; None if there are none."""
        if not len(times):
            return None
        ordered = np.sort(times)
        last = ordered[-(-99 * len(ordered) // 100) - 1]
        least, mean, most = int(ordered[0]), float(ordered.mean()), int(ordered[-1])
        return cls(min=seconds(least), mean=seconds(mean), p99=seconds(int(last)), max=seconds(most))


@dataclass(frozen=True, kw_only=True)
class Responses:
    """Statistics of one task or message."""

    jobs: int
    """the number released, or queued; without skipped ones"""
    utilisation: float
    """the demanded share of the time of the processor or link: the mean demand of one, divided by the mean time
    between them"""
    response: Spread | None
    """the time from the nominal release to the end, of those that are done"""
    bound: float | None
    """the bound of theory on the response; None where there is none"""
    start_jitter: float | None
    """the range of the times from nominal release to start"""
    end_jitter: float | None
    """the range of those to the end"""
    latency: Spread | None
    """the time of a task from reading its inputs to writing its outputs"""
    deadline: float | None
    """the time from the nominal release by which it should be done"""
    missed: float | None
    """the share not done by its deadline, of those whose deadline is within the run; None if there are none"""
    skipped: int
    """the number of releases that made no job"""
    aborted: int
    """the number that was ended at its deadline"""
    unfinished: int
    """the number waiting or under way at the end"""


@dataclass(frozen=True, kw_only=True)
class SystemResponses:
    """Statistics of all tasks and messages of a system, up to its end."""

    tasks: Mapping[str, Responses]
    """Responses by COMPUTER.TASK"""
    messages: Mapping[str, Responses]
    """Responses by NETWORK.MESSAGE"""
    busy: Mapping[str, float]
    """the share of the time in which a computer was busy, switches included, or a link carried a frame"""


def responses_of(system: System, timeline: Timeline) -> SystemResponses:
    """The statistics of the tasks and messages of a system."""
    bounds, tasks, messages = bounds_of(system), {}, {}
    for name, computer in system.computers.items():
        for task_name, task in computer.tasks.items():
            place = f"{name}.{task_name}"
            jobs = timeline.jobs[place]
            demand = demand_of(task, computer, len(jobs) / seconds(timeline.stop))
            tasks[place] = _of_jobs(jobs, demand, bounds[place], task.read == "release")
    for name, network in system.networks.items():
        for message_name, message in network.messages.items():
            place = f"{name}.{message_name}"
            frames = timeline.frames[place]
            rate = rate_of(message, 1.0, len(frames) / seconds(timeline.stop))
            demand = seconds(frame_nanoseconds(network, message)) * rate
            messages[place] = _of_records(frames, demand, bounds[place])
    shared = {**timeline.processors, **timeline.links}
    busy = {name: float((each.end - each.begin).sum()) / timeline.stop for name, each in shared.items()}
    return SystemResponses(tasks=tasks, messages=messages, busy=busy)


def _of_jobs(jobs: Jobs, utilisation: float, bound: int | None, read_at_release: bool) -> Responses:
    read = jobs.released if read_at_release else jobs.started
    return replace(
        _of_records(jobs, utilisation, bound, *(int((jobs.outcome == kind).sum()) for kind in (SKIPPED, ABORTED))),
        latency=Spread.of((jobs.written - read)[jobs.written != NEVER]),
    )


def _of_records(
    of: Jobs | Frames, utilisation: float, bound: int | None, skipped: int = 0, aborted: int = 0
) -> Responses:
    return Responses(
        jobs=len(of) - skipped,
        utilisation=utilisation,
        response=Spread.of(of.responses),
        bound=None if bound is None else seconds(bound),
        start_jitter=_range((of.started - of.nominal)[of.started != NEVER]),
        end_jitter=_range(of.responses),
        latency=None,
        deadline=_deadline(of),
        missed=_missed(of),
        skipped=skipped,
        aborted=aborted,
        unfinished=len(of) - int(of.done.sum()) - skipped - aborted,
    )


def _deadline(of: Jobs | Frames) -> float | None:
    """The deadline after the nominal release [s]."""
    after = (of.deadline - of.nominal)[:1]
    return seconds(int(after[0])) if len(after) and after[0] < NO_DEADLINE else None


def _missed(of: Jobs | Frames) -> float | None:
    due = int(of.due.sum())
    return int(of.missed.sum()) / due if due else None


def _range(times: Integers) -> float | None:
    return seconds(int(times.max() - times.min())) if len(times) else None
