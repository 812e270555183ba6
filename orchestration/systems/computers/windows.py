"""Windows in which a component samples and in which its messages arrive, for any random numbers.

They follow from the bounds of theory: a job that is done by its bound R, whatever its execution time, started before R
less the largest execution time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import exact_nanoseconds, nanoseconds, seconds
from orchestration.systems.computers.bounds import Bounds, bounds_of
from orchestration.systems.system.component import SamplingOnArrival
from orchestration.systems.system.distribution import highest, lowest
from orchestration.systems.system.frames import frame_nanoseconds
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import PlacedMessage, PlacedTask, messages_by_connection, tasks_of


@dataclass(frozen=True, kw_only=True)
class Window:
    """The windows of one component, after each nominal sample [ns]."""

    earliest: int
    """Earliest time of its samples"""
    latest: int
    at_deadline: bool
    """whether it writes at its deadline"""
    least: int
    """the least time from a sample to the arrival of its messages; from the nominal sample if it writes at its
    deadline"""
    most: int
    """the largest, likewise"""
    end: int
    """the last instant at which messages arrive"""

    @property
    def is_certain(self) -> bool:
        """Whether samples and arrivals have one possible instant each."""
        return self.shift == 0 and self.spread == 0

    @property
    def shift(self) -> int:
        """The width of the window of samples [ns]."""
        return self.latest - self.earliest

    @property
    def spread(self) -> int:
        """The width of the window of arrivals after samples of equal lateness [ns]."""
        return self.most - self.least if self.at_deadline else min(self.most, self.end - self.earliest) - self.least

    @property
    def together(self) -> int:
        """The largest sum of both variations [ns]."""
        return self.shift + self.spread if self.at_deadline else self.end - self.earliest - self.least


def windows_of(system: System) -> dict[str, Window]:
    """The windows of the components that run on a computer, send over a network or have jitter, by component.

    Messages that sample a component in continuous time have their own, by their places. Raises `UsageError` where there
    is no bound, where a job or frame may still be under way when the next one comes, and for a task without a period.
    """
    tasks, messages, bounds = tasks_of(system), messages_by_connection(system), bounds_of(system)
    found = {}
    for name, component in system.components.items():
        sent = [x.name for x in system.connections if x.sender == name]
        over = [messages[each] for each in sent if each in messages]
        sampling, task = component.sampling, tasks.get(name)
        if sampling is None:
            for each in over:
                late = nanoseconds(highest(each.message.jitter))
                found[each.place] = _with_frame(_of_clock(late), each, bounds)
            continue
        if isinstance(sampling, SamplingOnArrival) or (task is not None and task.task.on is not None):
            raise UsageError(f"{name} runs when a message arrives; expected a component with a period")
        if len(sent) > 1 and over:
            raise UsageError(f"{over[0].place}: expected all that {name} sends in one connection")
        if task is not None:
            found[name] = _of_task(task, bounds)
        elif over or highest(sampling.jitter):
            found[name] = _of_clock(nanoseconds(highest(sampling.jitter)))
        if over:
            found[name] = _with_frame(found[name], over[0], bounds)
    return found


def _of_clock(late: int) -> Window:
    """The window of samples that are up to that late, and sent at once."""
    return Window(earliest=0, latest=late, at_deadline=False, least=0, most=0, end=late)


def _of_task(of: PlacedTask, bounds: Bounds) -> Window:
    task, switch = of.task, nanoseconds(of.computer.switch)
    bound = bounds[f"{of.computer_name}.{of.name}"]
    if bound is None:
        raise UsageError(f"{of.place}: theory has no bound of its responses, or the processor has too much to do")
    assert task.period is not None
    due = nanoseconds(task.due)
    in_time = exact_nanoseconds(task.period) / Fraction(repr(float(of.computer.clock_ratio)))
    if task.overrun == "abort" or task.write == "deadline":
        in_time = min(in_time, Fraction(due))
    if bound > in_time:
        responds = f"{of.place}: may respond after {seconds(bound):g} s"
        raise UsageError(f"{responds}; expected {seconds(float(in_time)):g} s at most")
    least, most = (nanoseconds(end(task.execution)) for end in (lowest, highest))
    earliest, latest = switch, bound - most
    if task.read == "release":
        earliest, latest, least, most = 0, nanoseconds(highest(task.jitter)), least + switch, bound
    elif not _is_uninterrupted(of):
        most = bound
    if task.write == "deadline":
        return Window(earliest=earliest, latest=latest, at_deadline=True, least=due, most=due, end=due)
    return Window(earliest=earliest, latest=latest, at_deadline=False, least=least, most=most, end=bound)


def _is_uninterrupted(of: PlacedTask) -> bool:
    """Whether no job is preempted."""
    others = [task for name, task in of.computer.tasks.items() if name != of.name]
    comes_first = of.computer.scheduling == "fixed-priority" and all(x.priority > of.task.priority for x in others)
    return comes_first or not of.computer.preemptive


def _with_frame(window: Window, of: PlacedMessage, bounds: Bounds) -> Window:
    """The window with a frame between the sample and the arrival."""
    bound = bounds[f"{of.network_name}.{of.name}"]
    if bound is None:
        raise UsageError(f"{of.place}: theory has no bound of its responses, or the network has too much to carry")
    shortest = frame_nanoseconds(of.network, of.message)
    return replace(window, least=window.least + shortest, most=window.most + bound, end=window.end + bound)
