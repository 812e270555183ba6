"""The bounds of theory on the responses of the tasks and messages of a system."""

import math
from dataclasses import replace
from fractions import Fraction
from typing import Any

from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds, nanoseconds
from orchestration.systems.computers.bounds import Periodic, can, earliest_deadline, fixed_priority
from orchestration.systems.system.component import SamplingOnArrival
from orchestration.systems.system.computers import Computer, Message, Network, Task
from orchestration.systems.system.distribution import highest, lowest
from orchestration.systems.system.frames import frame_nanoseconds
from orchestration.systems.system.model import System

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
