"""A component of a system: an FMU, its parameters, and how it is stepped.

A digital task runs at every period of its own clock, as a task of a computer, or when a message arrives.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import field
from fractions import Fraction
from typing import Any

from orchestration.components.fmi.access import SCHEDULED, USUAL, Access, Interface, Solver
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.fitting import MarkedFloat
from orchestration.foundation.basics.records import Scalar, record
from orchestration.foundation.basics.times import exact_nanoseconds, is_at_least
from orchestration.foundation.processes.passable import passable
from orchestration.systems.system.choices import Align, Clock, Spread
from orchestration.systems.system.distribution import (
    Varying,
    highest,
    reads_file,
    require_spread,
    require_varying,
    spreads,
)
from orchestration.systems.system.requirements import (
    is_finite,
    require,
    require_not_negative,
    require_own_clock,
    require_positive,
)


@record()
class Sampling:
    """When a digital task runs; times in seconds of the true clock, but for `period` and `offset` (its own)."""

    period: float
    """The period T of the task [s], in its own time: instant k is offset + kT."""
    offset: float = 0.0
    """The time of the first instant [s], in its own time."""
    jitter: Varying = 0.0
    """The largest lateness J of an instant [s], drawn for each, or the distribution of the lateness itself; it is less
    than the period."""
    jitter_distribution: Spread = "uniform"
    """The distribution over [0, J] of a lateness whose largest value is given; normal is centred at J/2 with standard
    deviation J/6, cut to the range."""
    clock_ratio: float = 1.0
    """The seconds r that the component believes pass per true second."""
    clock: Clock = "master"
    """The clock by which it samples: that of the master, or of the FMU, by its parameters sample_period and
    sample_offset."""
    fmu_clock: str | None = None
    """The periodic input clock of an FMU of FMI 3.0 that ticks at each sample; in a file period and offset are then by
    default its interval and shift."""

    def __post_init__(self) -> None:
        require_positive(self, "period", "clock_ratio")
        require_not_negative(self, "offset")
        require_varying(self, "jitter")
        require_spread(self.jitter_distribution, self.jitter)
        require(is_at_least(self.period, self.clock_ratio), "period", self.period, "at least a nanosecond")
        if not reads_file(self.jitter):
            self.expect_jitter_within_period()
        if self.clock == "fmu":
            require_own_clock(self)
            require(self.fmu_clock is None, "fmu_clock", self.fmu_clock, "none beside clock = fmu")

    @property
    def true_period(self) -> Fraction:
        """The period by the true clock [ns]."""
        return exact_nanoseconds(self.period) / Fraction(repr(float(self.clock_ratio)))

    @property
    def true_offset(self) -> Fraction:
        """The time of the first instant by the true clock [ns]."""
        return exact_nanoseconds(self.offset) / Fraction(repr(float(self.clock_ratio)))

    @property
    def is_random(self) -> bool:
        """Whether the seed changes its instants."""
        return spreads(self.jitter)

    def expect_jitter_within_period(self) -> None:
        """Raise `UsageError` for a lateness of a period or more; that of a trace is known when the file is read."""
        longest, most = self.period / self.clock_ratio, highest(self.jitter)
        require(most < longest, "jitter", most, f"less than the period of {shown(longest)} s")


@record()
class TaskSampling(Sampling):
    """The approximate instants of a task of a computer: its period, or that of what releases it.

    A system makes it from the task; the scheduler computes when the task runs.
    """

    task: str
    """The path of the task."""


@record()
class SamplingOnArrival(Sampling):
    """When a digital task runs that messages release: whenever one arrives."""

    on: str
    """The connection whose arriving messages it runs on, in place of a period."""
    period: float = 0.0
    """Approximate; the system sets it."""

    def __post_init__(self) -> None:
        require_positive(self, "clock_ratio")
        for key in ("offset", "jitter"):
            require(getattr(self, key) == 0.0, key, getattr(self, key), "0 beside on: messages say when it runs")
        require(self.clock == "master", "clock", self.clock, "master beside on: messages say when it runs")


def has_scheduled_instants(sampling: Sampling) -> bool:
    """Whether the scheduler computes its instants."""
    return isinstance(sampling, (TaskSampling, SamplingOnArrival))


OWN_PERIOD = "sampling.period"


@passable
class OwnPeriod(MarkedFloat):
    """The value of a parameter that follows the sampling period of its component, which is `OWN_PERIOD` in a file."""


Parameter = Scalar


def with_own_period(parameters: Mapping[str, Parameter], sampling: Sampling | None) -> Mapping[str, Parameter]:
    """The parameters, of which those that follow the period have that of the sampling; without one, unchanged."""
    following = [name for name, value in parameters.items() if value == OWN_PERIOD or isinstance(value, OwnPeriod)]
    if sampling is None or not following:
        return parameters
    return {**parameters, **dict.fromkeys(following, OwnPeriod(sampling.period))}


@record()
class Component:
    """An FMU, its parameters, and how it is stepped: at sampling instants if it has `sampling`, else continuously."""

    fmu: str
    """The name of one of this project's FMUs, or the path of an .fmu file; in a file, relative to its folder."""
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    """The parameters to set, by their names in the FMU and in the units that it declares; the text `sampling.period`
    has a parameter in seconds follow the component's period, whatever sets it."""
    step: float | None = None
    """The distance of the communication points [s] of a component in continuous time; a component has either this or
    `sampling`."""
    points: tuple[float, ...] = ()
    """More communication points of such a component [s], as where its inputs jump."""
    sampling: Sampling | None = None
    """The times at which a digital task runs; a component has either this or `step`, or neither if it is the task of a
    computer."""
    tolerance: float | None = None
    """The relative tolerance of the FMU's solver; default: that of the experiment that the FMU declares, if any."""
    interface: Interface | None = None
    """The interface by which the FMU is called; default: co-simulation, or model exchange where it offers that only."""
    partition: str | None = None
    """The input clock of an FMU for scheduled execution whose partition it is: each step is a job of that partition."""
    instance: str | None = None
    """The instance that its partition belongs to, by any name; default: one for all partitions of the FMU."""
    solver: Solver | None = None
    """The solver of an FMU for model exchange; default: dormand-prince. For a stiff one, cvode, in the Python loop."""
    start_time: float | None = None
    """The FMU's own time at which the run begins [s]; default: 0. All other times are those of the run, from 0."""
    align: Align = "exact"
    """The treatment of an instant between two points of a component that only takes its own fixed step: an error
    (exact), or it moves to the next point (next)."""
    record: tuple[str, ...] | None = None
    """The variables to record beside the exchanged ones; default: all outputs and local Reals."""

    @property
    def access(self) -> Access:
        """How its FMU is called."""
        if self.partition is not None:
            return Access(interface=SCHEDULED, solver=self.solver, clock=self.partition)
        clock = None if self.sampling is None else self.sampling.fmu_clock
        if self.interface is None and self.solver is None and clock is None and not self.start_time:
            return USUAL
        interface: Interface | None = self.interface or ("event-mode" if clock else None)
        return Access(interface=interface, solver=self.solver, clock=clock, start_time=self.start_time or 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parameters", with_own_period(self.parameters, self.sampling))
        if self.tolerance is not None:
            require_positive(self, "tolerance")
        if self.start_time is not None:
            require(is_finite(self.start_time), "start_time", self.start_time, "a finite number")
        if self.step is not None:
            for name, value in self.parameters.items():
                require(value != OWN_PERIOD, f"parameters.{name}", value, "a number: beside step there is no sampling")
            require_positive(self, "step")
            require(is_at_least(self.step, 1.0), "step", self.step, "at least a nanosecond")
        if self.points:
            require(self.step is not None, "points", len(self.points), "none without step")
            is_increasing = all(one < other for one, other in itertools.pairwise((0.0, *self.points)))
            require(is_increasing and is_finite(self.points[-1]), "points", self.points, "positive times that increase")
        if self.partition is not None:
            require(self.interface in (None, SCHEDULED), "interface", self.interface, f"{SCHEDULED} beside partition")
            require(self.step is None, "step", self.step, "none beside partition, which is sampled or a task")
            require(self.start_time is None, "start_time", self.start_time, "none beside partition")
            own = None if self.sampling is None else self.sampling.fmu_clock
            require(own is None, "sampling.fmu_clock", own, "none beside partition, which is a clock")
        else:
            require(self.interface != SCHEDULED, "partition", "none", f"an input clock of the FMU, for {SCHEDULED}")
            require(self.instance is None, "instance", self.instance, "none without partition")
        if self.sampling is not None:
            require(self.step is None, "step", self.step, "none beside sampling, whose period it follows")
            if self.sampling.fmu_clock is not None and self.interface is not None:
                require(self.interface == "event-mode", "interface", self.interface, "event-mode beside fmu_clock")


def instance_of(component: Component) -> tuple[str, str | None] | None:
    """What the components with one instance of an FMU have in common; None: the component has its own."""
    return None if component.partition is None else (component.fmu, component.instance)


def expect_partitions(components: Mapping[str, Component]) -> None:
    """Raise `UsageError` for components that cannot be partitions of one instance."""
    for name, one in components.items():
        if one.partition is None:
            continue
        first = next(each for each, other in components.items() if instance_of(other) == instance_of(one))
        taken = next(each for each, other in components.items() if _is_same_partition(other, one))
        expected = f"another one than {taken} has, or instance = NAME for another instance of the FMU"
        require(taken == name, f"components.{name}.partition", one.partition, expected)
        ratio, other = (_ratio(components[each]) for each in (name, first))
        place = f"components.{name}: its clock_ratio"
        require(ratio == other, place, ratio, f"{other}, that of {first}, which has the same instance")
        for key, value in one.parameters.items():
            before = components[first].parameters.get(key, value)
            place = f"components.{name}.parameters.{key}"
            require(before == value, place, value, f"{before}, as of {first}, which has the same instance")


def _is_same_partition(one: Component, other: Component) -> bool:
    return (instance_of(one), one.partition) == (instance_of(other), other.partition)


def _ratio(component: Component) -> float:
    return 1.0 if component.sampling is None else component.sampling.clock_ratio


Values = Mapping[str, Parameter]
"""Parameters by target, as axes of studies name them"""


def parameters_in(table: Mapping[str, Any], place: str) -> dict[str, Parameter]:
    """The values of a table by dotted names; raises `UsageError`, naming the `place`, for an invalid value."""
    found = dict(flattened(table))
    for name, value in found.items():
        if not isinstance(value, (int, float, str)):
            raise UsageError(f"{place}.{name} = {shown(repr(value))}: expected a number, true, false or a text")
    return found


def flattened(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested tables by dotted names: `gain.eta = 15` and `"gain.eta" = 15` mean the same.

    An empty table is kept as a value, which the caller rejects.
    """
    for key, value in table.items():
        if isinstance(value, Mapping) and value:
            yield from flattened(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
