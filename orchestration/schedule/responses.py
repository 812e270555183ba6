"""What the tasks and messages of a system come to: how long they take, how often they are late, and what theory says.

Times are in seconds.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from orchestration.basics.simulator import Integers
from orchestration.computers.results import ABORTED, NEVER, SKIPPED, Frames, Jobs, Timeline
from orchestration.computers.system_bounds import bounds_of
from orchestration.system.computers import Message, Task
from orchestration.system.distribution import mean
from orchestration.system.frames import frame_nanoseconds
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS

NO_DEADLINE = 2**60
"""[ns], from where on a deadline is none"""


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Of times, from the least to the most."""

    min: float
    mean: float
    p99: float
    """the element ⌈.99 n⌉ of n in order"""
    max: float

    @classmethod
    def of(cls, times: Integers) -> "Spread | None":
        """Of times [ns]; None if there are none."""
        if not len(times):
            return None
        ordered = np.sort(times)
        last = ordered[-(-99 * len(ordered) // 100) - 1]
        least, mean, most = int(ordered[0]), float(ordered.mean()), int(ordered[-1])
        return cls(min=_s(least), mean=mean / NANOSECONDS, p99=_s(int(last)), max=_s(most))


@dataclass(frozen=True, kw_only=True)
class Responses:
    """Of one task or message."""

    jobs: int
    """how many were released, or queued; not those that a skip left out"""
    utilisation: float
    """the share of the time that they ask of the processor, or of a link: what one takes on average, by what there is
    from one to the next"""
    response: Spread | None
    """from the nominal release to the end, of those that are done"""
    bound: float | None
    """the most that it can be, by theory; None where theory has no bound"""
    start_jitter: float | None
    """from the least to the most between nominal release and begin"""
    end_jitter: float | None
    """likewise to the end"""
    latency: Spread | None
    """of a task, from reading its inputs to writing its outputs"""
    deadline: float | None
    missed: float | None
    """the share that is not done by its deadline, of all whose deadline is within the run; None if there are none"""
    skipped: int
    aborted: int
    unfinished: int
    """how many are under way at the end, or wait"""


@dataclass(frozen=True, kw_only=True)
class SystemResponses:
    """Of all tasks and messages of a system, up to its end."""

    tasks: Mapping[str, Responses]
    """by COMPUTER.TASK"""
    messages: Mapping[str, Responses]
    """by NETWORK.MESSAGE"""
    busy: Mapping[str, float]
    """the share of the time that a computer was at work, switches included, or a link carried a frame"""


def responses_of(system: System, timeline: Timeline) -> SystemResponses:
    """What has become of the tasks and messages of a system."""
    bounds, tasks, messages = bounds_of(system), {}, {}
    for name, computer in system.computers.items():
        for task_name, task in computer.tasks.items():
            place = f"{name}.{task_name}"
            jobs = timeline.jobs[place]
            asked = mean(task.execution) * _rate(task, computer.clock_ratio, jobs)
            tasks[place] = _of_jobs(jobs, asked, bounds[place], task.read == "release")
    for name, network in system.networks.items():
        for message_name, message in network.messages.items():
            place = f"{name}.{message_name}"
            frames = timeline.frames[place]
            asked = _s(frame_nanoseconds(network, message)) * _rate(message, 1.0, frames)
            messages[place] = _of_frames(frames, asked, bounds[place])
    shared = {**timeline.processors, **timeline.links}
    busy = {name: float((each.end - each.begin).sum()) / timeline.stop for name, each in shared.items()}
    return SystemResponses(tasks=tasks, messages=messages, busy=busy)


def _of_jobs(jobs: Jobs, utilisation: float, bound: int | None, read_at_release: bool) -> Responses:
    done, skipped, aborted = jobs.done, int((jobs.outcome == SKIPPED).sum()), int((jobs.outcome == ABORTED).sum())
    read = jobs.released if read_at_release else jobs.started
    is_written = jobs.written != NEVER
    return Responses(
        jobs=len(jobs) - skipped,
        utilisation=utilisation,
        response=Spread.of(jobs.responses),
        bound=None if bound is None else _s(bound),
        start_jitter=_range((jobs.started - jobs.nominal)[jobs.started != NEVER]),
        end_jitter=_range(jobs.responses),
        latency=Spread.of((jobs.written - read)[is_written]),
        deadline=_deadline(jobs),
        missed=_missed(jobs),
        skipped=skipped,
        aborted=aborted,
        unfinished=len(jobs) - int(done.sum()) - skipped - aborted,
    )


def _of_frames(frames: Frames, utilisation: float, bound: int | None) -> Responses:
    return Responses(
        jobs=len(frames),
        utilisation=utilisation,
        response=Spread.of(frames.responses),
        bound=None if bound is None else _s(bound),
        start_jitter=_range((frames.started - frames.nominal)[frames.started != NEVER]),
        end_jitter=_range(frames.responses),
        latency=None,
        deadline=_deadline(frames),
        missed=_missed(frames),
        skipped=0,
        aborted=0,
        unfinished=len(frames) - int(frames.done.sum()),
    )


def _rate(of: Task | Message, clock_ratio: float, found: Jobs | Frames) -> float:
    """How many there are a second: as it says itself, or else as many as came."""
    if of.period is not None:
        return clock_ratio / of.period
    return of.arrivals.poisson if of.arrivals is not None else len(found) / _s(found.stop)


def _deadline(of: Jobs | Frames) -> float | None:
    """From the nominal release."""
    after = (of.deadline - of.nominal)[:1]
    return _s(int(after[0])) if len(after) and after[0] < NO_DEADLINE else None


def _missed(of: Jobs | Frames) -> float | None:
    due = int(of.due.sum())
    return int(of.missed.sum()) / due if due else None


def _range(times: Integers) -> float | None:
    return _s(int(times.max() - times.min())) if len(times) else None


def _s(nanoseconds: int) -> float:
    return nanoseconds / NANOSECONDS
