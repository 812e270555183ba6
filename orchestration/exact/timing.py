"""The tasks and links of a system, with what its timing leaves to chance."""

from __future__ import annotations

from fractions import Fraction

from orchestration.basics.errors import UsageError
from orchestration.exact.chances import CERTAIN, Chance, cut_normal, uniform
from orchestration.exact.clockwork import ATTOSECONDS, Link, Task
from orchestration.schedule.plan import Plan
from orchestration.system.model import Connection, System
from orchestration.system.times import NANOSECONDS, exact_nanoseconds


def tasks_of(system: System) -> list[Task]:
    """The sampled components, in the order of those that are due at once.

    Raises `UsageError` for one that keeps its own clock.
    """
    found = []
    for name in Plan(system).sampled:
        sampling = system.components[name].sampling
        assert sampling is not None
        if sampling.clock == "fmu":
            raise UsageError(f"components.{name}.sampling.clock: fmu: expected the master's")
        ratio = Fraction(repr(float(sampling.clock_ratio)))
        found.append(
            Task(
                name=name, period=_seconds(sampling.period) / ratio, offset=_seconds(sampling.offset) / ratio,
                jitter=_late(sampling.jitter, sampling.jitter_distribution),
            )
        )  # fmt: skip
    return found


def links_of(system: System) -> list[Link]:
    """The connections; those that are wires carry no messages."""
    plan = Plan(system)
    tasks = list(plan.sampled)
    return [_link(x, tasks, system, wire=i in plan.wires) for i, x in enumerate(system.connections)]


def _link(x: Connection, tasks: list[str], system: System, *, wire: bool) -> Link:
    sender, receiver = (tasks.index(name) if name in tasks else None for name in (x.sender, x.receiver))
    step = system.components[x.sender].step if sender is None and receiver is None and not wire else None
    return Link(
        name=f"connections.{x.name}", size=len(x.start), sender=sender, receiver=receiver,
        step=None if step is None else _seconds(step),
        delay=round(_seconds(x.delay) * ATTOSECONDS), late=_late(x.delay_jitter, x.jitter_distribution),
        loss=x.loss, burst=x.burst_length, jacobi=x.order == "jacobi" and sender is not None, first=x.hold == "first",
    )  # fmt: skip


def _seconds(seconds: float) -> Fraction:
    return exact_nanoseconds(seconds) / NANOSECONDS


def _late(largest: float, distribution: str) -> Chance:
    if largest == 0.0:
        return CERTAIN
    high = round(_seconds(largest) * ATTOSECONDS)
    return cut_normal(0, high, high / 6.0) if distribution == "normal" else uniform(0, high)
