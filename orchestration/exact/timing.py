"""The tasks and links of a system, with what its timing leaves to chance."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from orchestration.basics.errors import UsageError
from orchestration.exact.chances import CERTAIN, Chance, normal, table, uniform
from orchestration.exact.clockwork import ATTOSECONDS, Link, Task
from orchestration.exact.foretold import NOTHING, Foretold
from orchestration.schedule.plan import Plan
from orchestration.system.connection import Connection
from orchestration.system.distribution import Distribution, Varying
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS, exact_nanoseconds


def tasks_of(system: System, told: Foretold = NOTHING) -> list[Task]:
    """The sampled components, in the order of those that are due at once; of some a scheduler has `told` when.

    Raises `UsageError` for one that keeps its own clock.
    """
    found = []
    for name in Plan(system).sampled:
        sampling = system.components[name].sampling
        assert sampling is not None
        if name in told.samples:
            found.append(Task(name=name, period=told.period, offsets=told.samples[name]))
            continue
        if sampling.clock == "fmu":
            raise UsageError(f"components.{name}.sampling.clock: fmu: expected the master's")
        ratio = Fraction(repr(float(sampling.clock_ratio)))
        found.append(
            Task(
                name=name, period=_seconds(sampling.period) / ratio, offsets=(_seconds(sampling.offset) / ratio,),
                jitter=_late(sampling.jitter, sampling.jitter_distribution, f"components.{name}.sampling.jitter"),
            )
        )  # fmt: skip
    return found


def links_of(system: System, told: Foretold = NOTHING) -> list[Link]:
    """The connections; those that are wires carry no messages, of some a scheduler has `told` when they do."""
    plan = Plan(system)
    tasks = list(plan.sampled)
    links = [_link(x, tasks, system, wire=i in plan.wires) for i, x in enumerate(system.connections)]
    return [_told(link, x, told) for link, x in zip(links, system.connections)]


def _told(link: Link, x: Connection, told: Foretold) -> Link:
    if x.sender in told.samples:
        nothing = (0,) * len(told.samples[x.sender])
        link = replace(link, behind=told.behind.get(x.name, nothing))
    if x.name in told.sent:
        step, posts = told.period, told.sent[x.name]
        link = replace(link, receiver=None, step=step, posts=posts, behind=told.behind[x.name])
    if x.name in told.settled:
        link = replace(link, delay=0, late=CERTAIN, loss=0.0, burst=None)
    return link


def _link(x: Connection, tasks: list[str], system: System, *, wire: bool) -> Link:
    sender, receiver = (tasks.index(name) if name in tasks else None for name in (x.sender, x.receiver))
    step = system.components[x.sender].step if sender is None and receiver is None and not wire else None
    place = f"connections.{x.name}"
    late = _late(x.delay_jitter, x.jitter_distribution, f"{place}.delay_jitter")
    if isinstance(x.delay, Distribution):
        own = _drawn(x.delay, f"{place}.delay")
        delay, late = 0, replace(own, more=None if late == CERTAIN else late)
    else:
        delay = round(_seconds(x.delay) * ATTOSECONDS)
    return Link(
        name=place, size=len(x.start), sender=sender, receiver=receiver,
        step=None if step is None else _seconds(step), delay=delay, late=late, loss=_lost(x, place),
        burst=x.burst_length, jacobi=x.order == "jacobi" and sender is not None, first=x.hold == "first",
    )  # fmt: skip


def _lost(x: Connection, place: str) -> float:
    """The probability of a loss; raises `UsageError` for a trace whose losses come in its order."""
    if not isinstance(x.loss, Distribution):
        return x.loss
    chance = _drawn(x.loss, f"{place}.loss")
    return float(sum(p for value, p in zip(chance.values, chance.probabilities) if value))


def _drawn(of: Distribution, place: str) -> Chance:
    """Raises `UsageError` for a trace whose rows come one after the other: it is as long as it is."""
    if of.order == "as recorded" and of.lowest < of.highest:
        raise UsageError(f'{place}: a trace as recorded has no expectation; expected order = "drawn"')
    if of.uniform is not None:
        return uniform(*map(_whole, of.uniform))
    if of.normal is not None and of.range is not None:
        mean, deviation = (value * ATTOSECONDS for value in of.normal)
        return normal(mean, deviation, *map(_whole, of.range))
    values = of.table().tolist()
    return table([_whole(value) for value in values], of.probabilities or [1.0 / len(values)] * len(values))


def _whole(seconds: float) -> int:
    return round(_seconds(seconds) * ATTOSECONDS)


def _seconds(seconds: float) -> Fraction:
    return exact_nanoseconds(seconds) / NANOSECONDS


def _late(largest: Varying, spread: str, place: str) -> Chance:
    """Of which the largest is given, or how it is distributed."""
    if isinstance(largest, Distribution):
        return _drawn(largest, place)
    if largest == 0.0:
        return CERTAIN
    high = _whole(largest)
    return normal(high / 2.0, high / 6.0, 0, high) if spread == "normal" else uniform(0, high)
