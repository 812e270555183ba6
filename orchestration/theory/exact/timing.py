"""The tasks and links of a system, with the randomness of its timing."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.choices import Spread
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution, Varying
from orchestration.systems.system.model import System
from orchestration.theory.exact.random_times import (
    ATTOSECONDS,
    CERTAIN,
    RandomLink,
    RandomTime,
    SampledTask,
    attoseconds,
    exact_seconds,
    normal,
    table,
    uniform,
)
from orchestration.theory.stability.periodic_schedule import NO_SCHEDULE, PeriodicSchedule


def sampled_tasks(system: System, schedule: PeriodicSchedule = NO_SCHEDULE) -> list[SampledTask]:
    """The sampled components, in the order of those that are due at once; some sample by a schedule.

    Raises `UsageError` for one that keeps its own clock.
    """
    found = []
    for name in Plan(system).sampled:
        sampling = system.components[name].sampling
        assert sampling is not None
        if name in schedule.samples:
            offsets, numbers = schedule.samples[name], schedule.numbers[name]
            found.append(SampledTask(name=name, period=schedule.period, offsets=offsets, numbers=numbers))
            continue
        if sampling.clock == "fmu":
            raise UsageError(f"components.{name}.sampling.clock: fmu: expected the master's")
        place = f"components.{name}.sampling.jitter"
        found.append(
            SampledTask(
                name=name, period=sampling.true_period / NANOSECONDS, offsets=(sampling.true_offset / NANOSECONDS,),
                jitter=_jitter(sampling.jitter, sampling.jitter_distribution, place),
            )
        )  # fmt: skip
    return found


def by_turns(
    tasks: Sequence[SampledTask], links: Sequence[RandomLink], turns: Mapping[str, int]
) -> tuple[list[SampledTask], list[RandomLink]]:
    """Tasks and links, with as many periods of a task in one as there are until its samples have their turns again."""
    longer, late = list(tasks), list(links)
    for i, task in enumerate(tasks):
        count, rates = len(task.offsets), turns.get(task.name, 1)
        periods = rates // math.gcd(rates, count)
        if periods > 1:
            longer[i] = replace(
                task, period=periods * task.period,
                offsets=tuple(offset + k * task.period for k in range(periods) for offset in task.offsets),
                numbers=tuple(number + k * count for k in range(periods) for number in task.numbers),
            )  # fmt: skip
            late = [replace(x, transit_times=periods * x.transit_times) if x.sender == i else x for x in late]
    return longer, late


def links_of(system: System, schedule: PeriodicSchedule = NO_SCHEDULE) -> list[RandomLink]:
    """The connections; wires carry no messages, some messages are sent by a schedule."""
    plan = Plan(system)
    tasks = list(plan.sampled)
    links = [_link(x, tasks, system, wire=i in plan.wires) for i, x in enumerate(system.connections)]
    return [_scheduled_link(link, x, schedule) for link, x in zip(links, system.connections)]


def _scheduled_link(link: RandomLink, x: Connection, schedule: PeriodicSchedule) -> RandomLink:
    late = schedule.transit_times.get(x.name, (0,) * len(schedule.samples.get(x.sender, ())))
    transit_times = tuple(None if each is None else each * (ATTOSECONDS // NANOSECONDS) for each in late)
    if x.sender in schedule.samples:
        link = replace(link, transit_times=transit_times)
    if x.name in schedule.sent:
        link = replace(
            link, receiver=None, step=schedule.period, send_offsets=schedule.sent[x.name],
            transit_times=transit_times,
        )  # fmt: skip
    if x.name in schedule.with_own_delay:
        link = replace(link, delay=0, delay_jitter=CERTAIN, loss=0.0, burst_length=None)
    return link


def _link(x: Connection, tasks: list[str], system: System, *, wire: bool) -> RandomLink:
    sender, receiver = (tasks.index(name) if name in tasks else None for name in (x.sender, x.receiver))
    step = system.components[x.sender].step if sender is None and receiver is None and not wire else None
    place = f"connections.{x.name}"
    jitter = _jitter(x.delay_jitter, x.jitter_distribution, f"{place}.delay_jitter")
    if isinstance(x.delay, Distribution):
        random_delay = _random_time(x.delay, f"{place}.delay")
        delay, jitter = 0, replace(random_delay, added=None if jitter == CERTAIN else jitter)
    else:
        delay = _attoseconds(x.delay)
    return RandomLink(
        name=place, size=len(x.start), sender=sender, receiver=receiver,
        step=None if step is None else exact_seconds(step), delay=delay, delay_jitter=jitter, loss=_loss(x, place),
        burst_length=x.burst_length, jacobi=x.order == "jacobi" and sender is not None, settles=receiver is None,
        first_order=x.hold == "first",
    )  # fmt: skip


def _loss(x: Connection, place: str) -> float:
    """The probability of a loss; raises `UsageError` for a trace whose losses come in its order."""
    if not isinstance(x.loss, Distribution):
        return x.loss
    losses = _random_time(x.loss, f"{place}.loss")
    return float(sum(p for value, p in zip(losses.values, losses.probabilities) if value))


def _random_time(of: Distribution, place: str) -> RandomTime:
    """Raises `UsageError` for a trace whose rows come in its order."""
    if of.order == "as recorded" and of.lowest < of.highest:
        raise UsageError(f'{place}: a trace as recorded has no expectation; expected order = "drawn"')
    if of.uniform is not None:
        return uniform(*map(_attoseconds, of.uniform))
    if of.normal is not None and of.range is not None:
        mean, deviation = (value * ATTOSECONDS for value in of.normal)
        return normal(mean, deviation, *map(_attoseconds, of.range))
    values = of.table().tolist()
    return table([_attoseconds(value) for value in values], of.probabilities or [1.0 / len(values)] * len(values))


def _attoseconds(seconds: float) -> int:
    return attoseconds(exact_seconds(seconds))


def _jitter(largest: Varying, spread: Spread, place: str) -> RandomTime:
    """A jitter by its largest value, or by its distribution."""
    if isinstance(largest, Distribution):
        return _random_time(largest, place)
    if largest == 0.0:
        return CERTAIN
    high = _attoseconds(largest)
    match spread:
        case "normal":
            return normal(high / 2.0, high / 6.0, 0, high)
        case "uniform":
            return uniform(0, high)
