"""A system at rest at its operating point, and its components about it, each as a `Tangent`."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property, partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.instance import NO_STATE, Instance, Loader
from orchestration.components.fmi.read_description import Model, read_model
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.foundation.basics.records import replaced
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.basics.terminal import stated_beside_bar
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.simulation.engines.algebraic_loops import in_words
from orchestration.simulation.engines.resolved import resolve_with_models
from orchestration.simulation.runs.prepared import PreparedRun, prepared
from orchestration.systems.system.component import Component, Parameter, Sampling
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.model import AFTER, System
from orchestration.theory.stability.equilibrium import Steady, balance
from orchestration.theory.stability.excitation import Rest
from orchestration.theory.stability.fixed_periods import in_repeated_periods
from orchestration.theory.stability.identification import FINEST, SampledRest, in_continuous_time, of_samples
from orchestration.theory.stability.in_double import are_in_double, expect_same_law
from orchestration.theory.stability.lifted_component import LiftedTangent, several_rates
from orchestration.theory.stability.linearised_component import Tangent
from orchestration.theory.stability.operating_point import (
    LONGEST_HYPERPERIOD,
    NotAnEquilibriumError,
    deterministic,
    exchanged_signals,
    expect_rest,
    hyperperiod,
    hyperperiod_of,
    latest_offset,
    longest_period,
    periods_of,
    time_to_rest,
)
from orchestration.theory.stability.periodic_schedule import common_period, periodic_schedule

SETTLED = 6
"""periods of the run to rest, after messages in transit have arrived"""
INSTANTS = 1001
"""instants at which it is seen whether a source changes meanwhile"""
EVEN = "a priority or offsets by which its jobs start at one phase, and nothing is late by one time and another"
HELD = 2
"""messages that a first-order hold remembers, each of a longest period at most"""


@dataclass(frozen=True, kw_only=True)
class ExtraSignals:
    """Signals of the loop beyond those that connections carry, as COMPONENT.VARIABLE."""

    inputs: Sequence[str] = ()
    """Real inputs of components"""
    outputs: Sequence[str] = ()
    """other Reals"""


NO_SIGNALS = ExtraSignals()


AnyTangent = Tangent | LiftedTangent


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where a system has come to rest: there others begin that differ from it in timing."""

    components: Mapping[str, Component]
    saved: Mapping[str, tuple[bytes, float, int]]
    """Saved states of components, the times of their next steps by their own clocks [s], and the steps taken; others
    begin anew"""
    held: Mapping[str, Mapping[str, float]]
    """The inputs of the components there"""
    ticking: frozenset[str]
    """Components with clocks of FMI 3.0"""
    tunable: frozenset[str]
    """Parameters, as COMPONENT.NAME, that may be set between steps"""
    tuned: Mapping[str, Mapping[str, Parameter]] = field(default_factory=dict)
    """Those that components take on there, as they had others when they came to rest"""
    is_retimed: bool = True
    """Whether such are periods that follow those of their components: no other rest is to be expected"""

    @classmethod
    def of(cls, simulation: "PreparedRun", saved: Mapping[str, bytes]) -> "Start":
        """That of a run which has come to rest."""
        instances = cast("Mapping[str, TracedInstance]", simulation.instances)
        return cls(
            components=simulation.system.components,
            saved={name: (state, instances[name].time, instances[name].taken) for name, state in saved.items()},
            held=written_in(simulation),
            ticking=frozenset(name for name, one in instances.items() if one.model.ticking),
            tunable=frozenset(
                f"{name}.{variable.name}"
                for name, one in instances.items()
                for variable in one.model.variables.values()
                if variable.variability == "tunable" and not one.has_events
            ),
        )

    def tuned_to(self, system: System) -> "Start | None":
        """This one with the parameters of another system; None: more of its components differs.

        A component whose parameters cannot be set in its saved state has none, and begins anew.
        """
        if system.components.keys() != self.components.keys():
            return None
        components, saved, tuned = dict[str, Component](), dict(self.saved), dict[str, Mapping[str, Parameter]]()
        is_retimed = True
        for name, one in self.components.items():
            old, new = one.parameters, system.components[name].parameters
            components[name] = replaced(one, parameters=new)
            if old != new:
                tuned[name] = {key: value for key, value in new.items() if old.get(key) != value}
                is_retimed &= all(
                    _is_period(old.get(key), one) and _is_period(new[key], system.components[name])
                    for key in tuned[name]
                )
                if old.keys() - new.keys() or not self.tunable.issuperset(f"{name}.{key}" for key in tuned[name]):
                    del saved[name]
                    is_retimed = False
        found = replace(self, components=components, saved=saved, tuned=tuned, is_retimed=is_retimed)
        return found if found.serves(system) else None

    def serves(self, system: System) -> bool:
        """Whether the components of another system can begin there: their states hold parameters, and clocks."""
        return self._untimed(self.components) == self._untimed(system.components)

    def _untimed(self, components: Mapping[str, Component]) -> dict[str, Component]:
        return {name: one if name in self.ticking else _untimed(one) for name, one in components.items()}


def _is_period(value: Parameter | None, one: Component) -> bool:
    return one.sampling is not None and value == one.sampling.period


def _untimed(one: Component) -> Component:
    if one.sampling is None:
        return replace(one, step=1.0)
    sampling = Sampling(period=1.0, fmu_clock=one.sampling.fmu_clock, offset=one.sampling.offset)
    return replaced(one, sampling=sampling)  # parameters that follow the period stay


class KnownTangents(dict[str, tuple[Component, Fraction, AnyTangent]]):
    """Tangents by the name of the component, with what it was, and the period that the ladder is for."""

    start: Start | None = None
    """The state in which the last system that runs to rest has come to rest"""


@dataclass(frozen=True, kw_only=True)
class AtRest:
    """A system at rest, and its components about it."""

    simulation: PreparedRun
    extra: ExtraSignals
    saved_states: Mapping[str, bytes]
    """Saved states of the components at rest"""
    period: Fraction
    """the hyperperiod [ns]"""
    known: KnownTangents
    """Those of other systems whose components may come to rest alike"""
    begun: dict[str, AnyTangent | SampledRest] = field(default_factory=dict)
    """Those of `known` that hold here, and others as far as they are measured"""

    @cached_property
    def tangents(self) -> dict[str, AnyTangent]:
        """The components about rest."""
        return {name: self.tangent(name) for name in self.simulation.instances}

    @cached_property
    def slowest(self) -> Fraction:
        """The longest time after which a sampled component responds as before [ns].

        What is in continuous time foretells as much: it serves in all hyperperiods of these components with others.
        """
        system = self.simulation.system
        sampled = [name for name, one in system.components.items() if one.sampling is not None]
        return max([longest_period(system), *_cycles(system, {name: self.samples(name) for name in sampled})])

    @property
    def in_double(self) -> tuple[str, ...]:
        """Its components whose float code is in double precision."""
        return are_in_double(self.simulation.system.components)

    def tangent(self, name: str) -> AnyTangent:
        """A component about rest."""
        found = self._begun(name)
        if isinstance(found, SampledRest):
            with stated_beside_bar(f"linear model of {name}, of {found.samples} samples"):
                found = self._kept(name, found.tangent())
        return found

    def samples(self, name: str) -> int:
        """After how many of its samples a sampled component responds as before; its tangent is not measured yet."""
        found = self._begun(name)
        return samples_of(found)

    def taken(self, name: str) -> int:
        """How many steps a component has taken before it was at rest."""
        return cast("TracedInstance", self.simulation.instances[name]).taken

    def _begun(self, name: str) -> AnyTangent | SampledRest:
        if name not in self.begun:
            with stated_beside_bar(f"linear model of {name}"):
                self.begun[name] = self._known(name) or self._measured(name)
        return self.begun[name]

    def _kept(self, name: str, found: AnyTangent) -> AnyTangent:
        self.known[name] = self.simulation.system.components[name], self.slowest, found
        self.begun[name] = found
        return found

    def _known(self, name: str) -> AnyTangent | None:
        """The one of `known` if it holds here."""
        component = self.simulation.system.components[name]
        before, period, known = self.known.get(name, (None, Fraction(0), None))
        is_long = component.sampling is not None or period >= self.slowest >= FINEST * period
        if known is None or before != component or not is_long:
            return None
        self.simulation.instances[name].restore(self.saved_states[name])
        return known.about(self.rest_of(name))

    def _measured(self, name: str) -> AnyTangent | SampledRest:
        self.simulation.instances[name].restore(self.saved_states[name])
        model, rest = self.simulation.instances[name].model, self.rest_of(name)
        component = self.simulation.system.components[name]
        if component.sampling is not None:
            return of_samples(rest, component.sampling.period)
        quickest, slowest = (
            float(each) / NANOSECONDS for each in (min(periods_of(self.simulation.system)), self.slowest)
        )
        step = component.step or quickest
        unit = None if model.varies_step else step
        return self._kept(name, in_continuous_time(rest, quickest, step, until=slowest, unit=unit))

    def rest_of(self, name: str) -> Rest:
        """A component at rest: the last inputs and time, and the variables that belong to the loop."""
        fmu, system = cast("TracedInstance", self.simulation.instances[name]), self.simulation.system
        ends = [*(end for x in system.connections for end in x.end), *self.extra.inputs]
        starts = [*(start for x in system.connections for start in x.start), *self.extra.outputs]
        fed = dict.fromkeys(variable_of(end) for end in ends if component_of(end) == name)
        inputs = tuple(end for end in fed if fmu.model.variables[end].kind == "Real")
        read = dict.fromkeys(variable_of(start) for start in starts if component_of(start) == name)
        return Rest(
            fmu=fmu.fmu,
            inputs=inputs,
            held=np.array([fmu.written[end] if end in fmu.written else float(fmu.get(end)) for end in inputs]),
            outputs=tuple(output for output in read if fmu.model.variables[output].kind == "Real"),
            time=fmu.time,
        )


@contextmanager
def at_rest(
    system: System,
    instances: Instances,
    extra: ExtraSignals = NO_SIGNALS,
    models: Mapping[str, Model] | None = None,
    known: KnownTangents | None = None,
) -> Iterator[AtRest]:
    """`system` at its operating point, without jitter, loss, noise and quantisation.

    Its FMUs may be given as `models`; default: they are located, and built if need be. Tangents are kept in `known`,
    and those of equal components there are used again where they hold. Raises `UsageError` where the system does not
    rest there, or has no linear loop, saying why.
    """
    calm = in_repeated_periods(system)
    known = KnownTangents() if known is None else known
    with _settled(calm, _expect_period(calm), instances, extra, models, known) as loop:
        yield loop


@contextmanager
def whole_at_rest(
    system: System,
    instances: Instances,
    extra: ExtraSignals = NO_SIGNALS,
    models: Mapping[str, Model] | None = None,
    known: KnownTangents | None = None,
) -> Iterator[AtRest]:
    """As `at_rest`, over a period after which components of several rates respond as before, too.

    Their tangents are measured where they rest over that period, once.
    """
    calm, known = in_repeated_periods(system), KnownTangents() if known is None else known
    seen = {name: samples_of(one) for name, (_, _, one) in known.items() if name in calm.components}
    period = hyperperiod([_expect_period(calm), *_cycles(calm, seen)])
    with _settled(calm, period, instances, extra, models, known) as loop:
        sampled = [name for name, one in calm.components.items() if one.sampling is not None]
        for name in sampled if calm.uses_scheduler else ():
            if loop.samples(name) > 1:
                raise several_rates(name, loop.samples(name), expected=EVEN)
        whole = hyperperiod([period, *_cycles(calm, {name: loop.samples(name) for name in sampled})])
        if whole == period:
            yield loop
            return
    with _settled(calm, whole, instances, extra, models, known) as loop:
        yield loop


@contextmanager
def _settled(
    calm: System,
    period: Fraction,
    instances: Instances,
    extra: ExtraSignals,
    models: Mapping[str, Model] | None,
    known: KnownTangents,
) -> Iterator[AtRest]:
    """A system that has come to rest over some periods: from where one has that differs in timing, or by a run.

    Where that run finds no rest, as of an unstable loop: at the rest that is computed from one near by.
    """
    near = known.start.tuned_to(calm) if known.start is not None and time_to_rest(calm) else None
    with ExitStack() as stack:
        simulation, start = _found(
            stack,
            partial(_rested, calm, period, instances, models),
            near,
            partial(_corrected, calm, period, instances, known),
        )
        saved = {name: one.save() for name, one in simulation.instances.items()}
        if time_to_rest(calm):
            if start is None:
                known.start = Start.of(simulation, saved)
            elif start is not near:
                known.start = start
        yield AtRest(simulation=simulation, saved_states=saved, extra=extra, period=period, known=known)


def _found(
    stack: ExitStack,
    rested: Callable[[Start | None], AbstractContextManager[PreparedRun]],
    near: Start | None,
    corrected: Callable[[Start], Start],
) -> tuple[PreparedRun, Start | None]:
    """A run at rest, and where it has begun: near by, if that differs in timing only, None: by itself, or corrected.

    What differs in timing only has no other rest near by: from there its own is computed before it is sought by a run.
    """
    is_retimed = near is not None and near.is_retimed
    if near is not None and is_retimed:
        with suppress(NotAnEquilibriumError):
            return stack.enter_context(rested(near)), near
        with suppress(UsageError, SimulatorError):
            start = corrected(near)
            return stack.enter_context(rested(start)), start
    try:
        return stack.enter_context(rested(None)), None
    except NotAnEquilibriumError:
        if near is not None and not is_retimed:
            with suppress(UsageError, SimulatorError):
                start = corrected(near)
                return stack.enter_context(rested(start)), start
        raise


def _corrected(calm: System, period: Fraction, instances: Instances, known: KnownTangents, near: Start) -> Start:
    """Where a system rests, from where one does near by; raises `UsageError` where a component has no tangent there."""
    with prepared(calm, load=tracing_loader(instances, near)) as simulation:
        simulation.master.initialise()
        ones = cast("Mapping[str, TracedInstance]", simulation.instances)
        for name, one in ones.items():
            one.begin(near.held[name])
            if (sampling := calm.components[name].sampling) is not None:
                # Its outputs are those before; one that begins anew has states that no input leads, as of a soft start.
                for _ in range(1 if name in near.saved else math.ceil(time_to_rest(calm) / sampling.period)):
                    one.step(one.time - one.later, sampling.period)
        saved = {name: one.save() for name, one in ones.items()}
        loop = AtRest(simulation=simulation, saved_states=saved, extra=NO_SIGNALS, period=period, known=known)
        components = [Steady(name, found, near.held[name]) for name, found in loop.tangents.items()]
        balance(components, calm.connections)
    return replace(
        near,
        components=simulation.system.components,
        saved={one.name: (one.state.saved, one.state.time, ones[one.name].taken) for one in components},
        held={one.name: {**near.held[one.name], **dict(zip(one.inputs, one.held.tolist()))} for one in components},
        tuned={},
    )


def keep_start(system: System, instances: Instances, known: KnownTangents) -> None:
    """Keep in `known` where a system comes to rest that has a time to run to rest; raises `UsageError`."""
    try:
        calm = in_repeated_periods(system)
        period = common_period(calm, LONGEST_HYPERPERIOD)
    except UsageError:  # runs need no repeated periods
        calm = deterministic(system)
        period = hyperperiod_of(calm)
    start_of(calm, period or longest_period(calm), instances, known)


def start_of(calm: System, period: Fraction, instances: Instances, known: KnownTangents) -> Start | None:
    """Where a system comes to rest that has a time to run to rest, kept in `known`; None: it begins at rest."""
    if not time_to_rest(calm):
        return None
    if known.start is None or not known.start.serves(calm):
        expect_whole_instances(calm)
        with _settled(calm, period, instances, NO_SIGNALS, None, known) as loop:
            return Start.of(loop.simulation, loop.saved_states)
    return known.start


@contextmanager
def _rested(
    calm: System, period: Fraction, instances: Instances, models: Mapping[str, Model] | None, start: Start | None
) -> Iterator[PreparedRun]:
    """A run that has come to rest: begun there, or after the time that it runs to rest."""
    before = Fraction(0) if start is not None else exact_nanoseconds(time_to_rest(calm))
    begin = begin_of(calm, period) + math.ceil(before / period) * period
    calm = replace(calm, stop_time=float(begin + (SETTLED + 2) * period) / NANOSECONDS)
    doubled = {name: read_model(calm.components[name].fmu) for name in are_in_double(calm.components)}
    resolved = None if models is None else resolve_with_models(calm, {**models, **doubled})
    with prepared(calm, load=tracing_loader(instances, start), resolved=resolved) as simulation:
        _expect_states(simulation)
        _expect_open_instants(simulation)
        try:
            _settle(simulation, begin, period)
        finally:  # also where it does not rest, as another law need not
            expect_same_law(calm, instances, written_in(simulation))
        yield simulation


def begin_of(calm: System, period: Fraction) -> Fraction:
    """Begin of a period in which as many messages are in transit as ever after [ns].

    It is a sample of the component that begins last; of a schedule, a multiple of the period.
    """
    late = max((exact_nanoseconds(highest(x.delay)) for x in calm.connections), default=Fraction(0))
    late += HELD * longest_period(calm)
    schedule = None
    with suppress(UsageError):  # a run comes to rest without one that repeats
        schedule = periodic_schedule(calm) if calm.uses_scheduler else None
    if schedule is None:
        return latest_offset(calm) + math.ceil(late / period) * period
    late += max((Fraction(one or 0) for each in schedule.transit_times.values() for one in each), default=Fraction(0))
    return math.ceil((max(Fraction(schedule.begin), latest_offset(calm)) + late) / period) * period


def written_in(simulation: PreparedRun) -> dict[str, dict[str, float]]:
    """The inputs last written in a run of instances that trace them, by component."""
    return {name: dict(cast("TracedInstance", one).written) for name, one in simulation.instances.items()}


def samples_of(found: AnyTangent | SampledRest) -> int:
    """After how many samples a component responds as before."""
    return 1 if isinstance(found, Tangent) else found.samples


def _cycles(system: System, samples: Mapping[str, int]) -> Iterator[Fraction]:
    """After how long components of several rates respond as before [ns]."""
    for name, count in samples.items():
        sampling = system.components[name].sampling
        if count > 1 and sampling is not None:
            yield count * sampling.true_period


# -- coming to rest -------------------------------------------------------------------------------------------------


def expect_whole_instances(system: System) -> None:
    """Raise `UsageError` for a component that is a partition."""
    for name, component in system.components.items():
        if component.partition is not None:
            raise UsageError(
                f"{name} is a partition, whose state is that of the whole instance: expected the code as one component "
                "without partition, whose tasks run when they are due; limit takes partitions, by runs"
            )


def _expect_period(system: System) -> Fraction:
    if not system.connections:
        raise UsageError("there is no loop, as no component is connected: expected [[connections]]")
    expect_whole_instances(system)
    for name, component in system.components.items():
        if component.sampling is not None and component.sampling.clock == "fmu":
            raise UsageError(f"{name} has its own clock")
    period = common_period(system, LONGEST_HYPERPERIOD)
    if period is None:
        raise UsageError(
            "the sampled components have no hyperperiod of at most twenty times the longest period: expected periods "
            "in ratios of small whole numbers"
        )
    return period


def _expect_states(simulation: PreparedRun) -> None:
    without = [name for name, instance in simulation.instances.items() if not instance.model.saves_state]
    if without:
        raise UsageError(f"the FMU of {', '.join(without)} {NO_STATE}")


def _expect_open_instants(simulation: PreparedRun) -> None:
    running = simulation.master.running
    if groups := running.closing.groups:
        wires = in_words([running.system.connections[i] for group in groups for i in group])
        raise UsageError(f"outputs follow inputs at once, and are passed on within an instant: {wires}")


def _settle(simulation: PreparedRun, begin: Fraction, period: Fraction) -> None:
    """Run for some periods from `begin` on [ns], in which no exchanged signal may change."""
    master, system = simulation.master, simulation.system
    master.initialise()
    exchanged, after = [master.board.place[signal] for signal in exchanged_signals(system)], time_to_rest(system)

    def rows_from(begin: Fraction, count: int = SETTLED) -> Floats:
        rows = []
        for k in range(count):
            if master.run(pause_at=round(begin + k * period)):
                why = master.divergence or master.running.termination or "it was interrupted"
                rest = f" in {after:g} s, or without {AFTER} such at which it rests" if after else ""
                raise NotAnEquilibriumError(
                    f"unstable here, no rest: the run leaves the operating point: {why}: expected values in "
                    f"[operating_point] from which it comes to rest{rest}"
                )
            rows.append(master.board.row[exchanged])
        return np.array(rows)

    half = begin_of(system, period) + math.ceil(exact_nanoseconds(after) / 2 / period) * period
    if half + SETTLED * period <= begin:
        before = rows_from(half)
    else:
        initial, first = master.board.row[exchanged].copy(), latest_offset(system)
        before = np.vstack([initial, *rows_from(first, int((begin - first) / period))])
    calm = rows_from(begin)
    start, end = (float(begin + k * period) / NANOSECONDS for k in (-1, SETTLED - 1))
    try:
        expect_rest(system, calm, before, lambda signal: simulation.resolved.described[signal].unit)
    except NotAnEquilibriumError as error:
        for signal, change in _changes_of_sources(simulation, start if after else 0.0, end):
            raise NotAnEquilibriumError(
                f"the operating point is not at rest: source {signal} changes after {quantity(change, 's', 2)}, while "
                f"the loop comes to rest over {quantity(end, 's', 2)}: expected it to change later, or not at all"
            ) from error
        raise


def _changes_of_sources(simulation: PreparedRun, start: float, end: float) -> Iterator[tuple[str, float]]:
    """The signals of sources that change from `start` to `end` [s], and when first."""
    times = np.linspace(start, end, INSTANTS)
    for signals, values in simulation.master.running.sources:
        changed = values.over(times) != values.over(times[:1])
        yield from ((signal, float(times[one.argmax()])) for signal, one in zip(signals, changed.T) if one.any())


# -- instances that trace what is written to them ----------------------------------------------------------------------


class TracedInstance:
    """An FMU with the values last written to it, and the time of its next step, by its own clock.

    It may begin in a saved state, at the time of its next step then, with other values of tunable parameters.
    """

    def __init__(
        self,
        fmu: Instance,
        begins: tuple[bytes, float, int] | None = None,
        tuned: Mapping[str, Parameter] | None = None,
    ) -> None:
        self.fmu, self._tuned = fmu, tuned or {}
        self.written: dict[str, float] = {}
        self.time = self.later = 0.0
        self.taken = 0
        self._begins = begins

    def __getattr__(self, name: str) -> Any:
        return getattr(self.fmu, name)

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As `Simulator`."""
        write = self.fmu.writer(names, source)

        def transfer() -> None:
            write()
            self.written.update(zip(names, source.tolist()))

        return transfer

    @contextmanager
    def beside(self, instance_name: str, access: Access) -> Iterator["TracedInstance"]:
        """As `Instance`."""
        with self.fmu.beside(instance_name, access) as other:
            yield TracedInstance(other)

    def enter_initialization(self, start: float, stop: float) -> None:
        """As `Simulator`, without an end: other runs begin where this one has come to rest."""
        self.fmu.enter_initialization(start, math.inf)
        if self._begins is not None:
            self.fmu.exit_initialization()
            self.later = self._begins[1] - start
            self.begin({})

    def begin(self, held: Mapping[str, float]) -> None:
        """Take the state in which it begins, with some inputs."""
        if self._begins is not None:
            saved, self.time, self.taken = self._begins
            self.fmu.restore(saved)
            for name, value in self._tuned.items():
                self.fmu.set(name, value)
        self.writer(list(held), np.array(list(held.values())))()

    def exit_initialization(self) -> None:
        """As `Simulator`."""
        if self._begins is None:
            self.fmu.exit_initialization()

    def step(self, t: float, h: float) -> None:
        """As `Simulator`."""
        t += self.later
        self.fmu.step(t, h)
        self.time = t + h
        self.taken += 1


def tracing_loader(instances: Instances, start: Start | None = None) -> Loader:
    """A loader of instances as `TracedInstance`, which may begin where a system has come to rest."""
    if start is None:
        return wrapping_loader(instances.load, TracedInstance)
    return wrapping_loader(
        instances.load, lambda fmu: TracedInstance(fmu, start.saved.get(fmu.name), start.tuned.get(fmu.name))
    )


def wrapping_loader(of: Loader, wrapper: Callable[[Instance], object]) -> Loader:
    """A loader of the instances of another, each in a wrapper that has its attributes."""

    @contextmanager
    def load(path: Path, instance_name: str, access: Access = USUAL) -> Iterator[Instance]:
        with of(path, instance_name, access) as fmu:
            yield cast(Instance, wrapper(fmu))

    return load
