"""A system at its operating point, each of whose components is sampled at a fixed period.

A task whose jobs start at one phase of its period is a component that is sampled then, and a message that is always as
late is behind a constant delay: of processor time, of the network, and its own.
"""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.systems.schedule.overload import errors_name_overload
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import at_operating_point
from orchestration.systems.system.placement import messages_by_connection, tasks_of
from orchestration.theory.stability.operating_point import deterministic
from orchestration.theory.stability.periodic_schedule import PeriodicSchedule, periodic_schedule
from orchestration.theory.stability.scheduled import expect_certain, without_scheduler

ROUNDING = 1
"""Variation that is rounding, where a period is no whole number [ns]"""
INSTEAD = (
    "a linearised loop needs one phase and one latency: expected a priority or offsets by which it has them; expect or "
    "limit by runs, which need neither; or in place of the computer sampling = { period = SECONDS } of the component, "
    "and as delay of what it sends the latency that schedule prints"
)


def in_fixed_periods(system: System) -> System:
    """As `deterministic`, with computers and networks as phases and delays.

    Raises `UsageError` for what they depend on at random, and for a phase or a latency that varies.
    """
    calm = deterministic(system)
    if not system.uses_scheduler:
        return calm
    expect_certain(at_operating_point(system))
    schedule = periodic_schedule(calm)
    with errors_name_overload(calm):
        return _Fixed(calm, schedule).system()


class _Fixed:
    """A system with a periodic schedule, in fixed periods."""

    def __init__(self, calm: System, schedule: PeriodicSchedule) -> None:
        self._calm, self._schedule = calm, schedule
        self._tasks, self._messages = tasks_of(calm), messages_by_connection(calm)

    def system(self) -> System:
        """The system without computers and networks."""
        plain = without_scheduler(self._calm)
        placed = {name: self._clock(name, self._calm.components[name]) for name in self._schedule.samples}
        samplings = {name: placed.get(name, one.sampling) for name, one in plain.components.items()}
        if all(one is None or name in placed for name, one in samplings.items()):  # the first sample is at 0
            first = min(each.true_offset for each in placed.values())
            samplings |= {name: _at(one, one.true_offset - first) for name, one in placed.items()}
        components = {name: replace(one, sampling=samplings[name]) for name, one in plain.components.items()}
        connections = tuple(self._delayed(x) for x in self._calm.connections)
        return replace(plain, components=components, connections=connections)

    def _clock(self, name: str, component: Component) -> Sampling:
        """The clock of a component whose instants are scheduled."""
        given, offsets = component.sampling, self._schedule.samples[name]
        assert given is not None
        place = self._tasks[name].place if name in self._tasks else f"components.{name}"
        period = NANOSECONDS * self._schedule.period
        each = given.true_period
        late = [NANOSECONDS * offset - k * each for k, offset in enumerate(offsets)]
        released, whole = round(period / given.true_period), quantity(float(self._schedule.period), "s")
        if len(offsets) != released:
            raise UsageError(f"{place}: of {released} jobs in {whole} {len(offsets)} start, and {INSTEAD}")
        if max(late) - min(late) > ROUNDING:
            raise UsageError(
                f"{place}: in {whole} its jobs start between {_between(late)} after the begin of a period, "
                f"and {INSTEAD}"
            )
        fixed = Sampling(period=given.period, clock_ratio=given.clock_ratio, fmu_clock=given.fmu_clock)
        return _at(fixed, min(late))

    def _delayed(self, x: Connection) -> Connection:
        """A connection with all that makes its messages late as its delay."""
        of, late = self._messages.get(x.name), self._schedule.transit_times.get(x.name)
        if of is not None and x.name in self._schedule.sent:
            raise UsageError(
                f"{of.place}.period: the network has a clock of its own for a component in continuous time, and a "
                "linearised loop has none; expected expect, or limit by runs"
            )
        if late is None:
            return x
        task = self._tasks.get(x.sender)
        place = of.place if of is not None else f"connections.{x.name}" if task is None else task.place
        known = [Fraction(each) for each in late if each is not None]
        if len(known) < len(late):
            raise UsageError(f"{place}: {len(late) - len(known)} of {len(late)} jobs send nothing, and {INSTEAD}")
        if max(known) - min(known) > ROUNDING:
            raise UsageError(f"{place}: its outputs arrive between {_between(known)} after it has read, and {INSTEAD}")
        own = Fraction(0) if x.name in self._schedule.with_own_delay else exact_nanoseconds(lowest(x.delay))
        return x.with_delay(float((min(known) + own) / NANOSECONDS))


def _at(sampling: Sampling, offset: Fraction) -> Sampling:
    """A clock that begins at an offset of true time [ns]."""
    return replace(sampling, offset=float(offset / NANOSECONDS * Fraction(repr(float(sampling.clock_ratio)))))


def _between(times: Sequence[Fraction]) -> str:
    """The least and the largest of some times [ns], in words."""
    least, most = (quantity(float(each) / NANOSECONDS, "s") for each in (min(times), max(times)))
    return f"{least} and {most}"
