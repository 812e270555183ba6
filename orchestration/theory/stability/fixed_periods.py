"""A system at its operating point whose instants repeat, where it can be each component sampled at a fixed period.

A task whose jobs start at one phase of its period is a component that is sampled then, and a message that is always as
late is behind a constant delay: of processor time, of the network, and its own. Where a phase or a latency varies, or a
network samples what is in continuous time, the computers and networks remain, whose schedule repeats.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import inform
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity, some
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
INSTEAD = "a linearised loop has as many in each: expected less load, or expect or limit by runs, which do without"


def in_repeated_periods(system: System) -> System:
    """As `deterministic`, with computers and networks as phases and delays, if these are constant.

    Raises `UsageError` for what they depend on at random, and for jobs that do not start, or send nothing.
    """
    return _in_repeated_periods(system)[0]


def inform_of_uneven(system: System) -> None:
    """Say what of a schedule is now earlier and now later, and by how much: a loop has all of these times."""
    with suppress(UsageError):
        if uneven := _in_repeated_periods(system)[1]:
            inform(f"included as it repeats: {some(uneven)}")


def _in_repeated_periods(system: System) -> tuple[System, list[str]]:
    calm = deterministic(system)
    if not system.uses_scheduler:
        return calm, []
    expect_certain(at_operating_point(system))
    schedule = periodic_schedule(calm)
    with errors_name_overload(calm):
        fixed = _Fixed(calm, schedule)
        return fixed.system(), fixed.uneven


class _Fixed:
    """A system with a periodic schedule, in fixed periods."""

    def __init__(self, calm: System, schedule: PeriodicSchedule) -> None:
        self._calm, self._schedule = calm, schedule
        self._tasks, self._messages = tasks_of(calm), messages_by_connection(calm)
        self.uneven: list[str] = []
        """The times that vary, in words"""

    def system(self) -> System:
        """The system without computers and networks; with them, where they make a phase or a latency vary."""
        clocks = {name: self._clock(name, self._calm.components[name]) for name in self._schedule.samples}
        connections = [self._delayed(x) for x in self._calm.connections]
        placed = {name: one for name, one in clocks.items() if one is not None}
        if len(placed) < len(clocks) or None in connections:
            return self._calm
        plain = without_scheduler(self._calm)
        samplings = {name: placed.get(name, one.sampling) for name, one in plain.components.items()}
        if all(one is None or name in placed for name, one in samplings.items()):  # the first sample is at 0
            first = min(each.true_offset for each in placed.values())
            samplings |= {name: _at(one, one.true_offset - first) for name, one in placed.items()}
        components = {name: replace(one, sampling=samplings[name]) for name, one in plain.components.items()}
        return replace(plain, components=components, connections=tuple(x for x in connections if x is not None))

    def _clock(self, name: str, component: Component) -> Sampling | None:
        """The clock of a component whose instants are scheduled; None: it has no one phase."""
        given, offsets = component.sampling, self._schedule.samples[name]
        assert given is not None
        place = self._tasks[name].place if name in self._tasks else f"components.{name}"
        each = given.true_period
        late = [NANOSECONDS * offset - k * each for k, offset in enumerate(offsets)]
        released, whole = NANOSECONDS * self._schedule.period / each, quantity(float(self._schedule.period), "s")
        if len(offsets) != round(released):
            raise UsageError(f"{place}: of {round(released)} jobs in {whole} {len(offsets)} start, and {INSTEAD}")
        if max(late) - min(late) > ROUNDING:
            self.uneven.append(f"{place} starts {_between(late)} after the begin of its period")
            return None
        fixed = Sampling(period=given.period, clock_ratio=given.clock_ratio, fmu_clock=given.fmu_clock)
        return _at(fixed, min(late))

    def _delayed(self, x: Connection) -> Connection | None:
        """A connection with all that makes its messages late as its delay; None: it has no one delay."""
        late = self._schedule.transit_times.get(x.name)
        if late is None:
            return x
        known = [Fraction(each) for each in late if each is not None]
        of, task = self._messages.get(x.name), self._tasks.get(x.sender)
        place = of.place if of is not None else f"connections.{x.name}" if task is None else task.place
        if len(known) < len(late):
            raise UsageError(f"{place}: {len(late) - len(known)} of {len(late)} jobs send nothing, and {INSTEAD}")
        varies = max(known) - min(known) > ROUNDING
        if varies:
            since = "it is sent" if x.name in self._schedule.sent else f"{x.sender} samples"
            self.uneven.append(f"{place} arrives {_between(known)} after {since}")
        if varies or x.name in self._schedule.sent:
            return None
        own = Fraction(0) if x.name in self._schedule.with_own_delay else exact_nanoseconds(lowest(x.delay))
        return x.with_delay(float((min(known) + own) / NANOSECONDS))


def _at(sampling: Sampling, offset: Fraction) -> Sampling:
    """A clock that begins at an offset of true time [ns]."""
    return replace(sampling, offset=float(offset / NANOSECONDS * Fraction(repr(float(sampling.clock_ratio)))))


def _between(times: Sequence[Fraction]) -> str:
    """The least and the largest of some times [ns], in words."""
    least, most = (quantity(float(each) / NANOSECONDS, "s") for each in (min(times), max(times)))
    return f"{least} to {most}"
