"""A system about its operating point as a linear one: each component a `Tangent`, under the clock of the system.

The master exchanges what the tangents do. What goes through a period is what the components, the connections and the
row hold; its map is found by one period from each of these numbers, and, where a component is left open, from each of
those that it may say.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats, Transfer
from orchestration.engines.master import Master
from orchestration.engines.wiring import fixed_steps
from orchestration.fmi.instance import Instance, Loader
from orchestration.fmi.model import Model
from orchestration.fmi.reuse import Instances
from orchestration.recording.recording import Chunk, InMemory
from orchestration.runs.prepared import PreparedRun, prepared
from orchestration.runs.resolved import resolve_with_models
from orchestration.schedule.streams import Streams
from orchestration.schedule.timetable import Timetable
from orchestration.stability.linear_simulator import Linear, Opened
from orchestration.stability.linearised_component import PULSE, Rest, Tangent
from orchestration.stability.operating_point import common_period, deterministic, exchanged, expect_rest, latest_offset
from orchestration.system.component import Component
from orchestration.system.criterion import Criterion
from orchestration.system.distribution import highest
from orchestration.system.model import System
from orchestration.system.placement import expect_unscheduled
from orchestration.system.times import NANOSECONDS, exact_nanoseconds
from orchestration.system.variable_names import component_of, variable_of

SETTLED = 6
"""periods of the run that comes to rest, after what is on its way has arrived"""
HELD = 2
"""messages that a first-order hold remembers"""
LARGEST = 400
"""of a loop: numbers that go through a period"""
RUNGS, FINEST = 12, 0.25
"""of the ladder of a component in continuous time: points, each twice the one before; the first by the period"""
LONGER = (1, 4, 16, 64)
"""times as long steps are tried in turn, for as long as they tell more states: a fast loop leaves slow ones no time"""
RUNGS_OF_FIXED = 5
"""where a component takes short steps of one length only"""
RUNGS_OF_TASK = 32
"""of a sampled component: samples"""


@dataclass(frozen=True, kw_only=True)
class Beside:
    """What of the components counts beside what connections carry, as COMPONENT.VARIABLE."""

    moved: Sequence[str] = ()
    """Real inputs"""
    seen: Sequence[str] = ()
    """other Reals"""


NOTHING = Beside()


@dataclass(frozen=True, kw_only=True)
class AtRest:
    """A system that has come to rest, and its components about it."""

    simulation: PreparedRun
    pulse: float
    beside: Beside
    begun: Mapping[str, bytes]
    """the saved states of the components there"""
    begin: Fraction
    """of a period, when the component that begins last samples [ns]"""
    period: Fraction
    """after which all sampled components are due together again [ns]"""

    @cached_property
    def tangents(self) -> dict[str, Tangent]:
        """The components about it."""
        return {name: self.tangent(name, self.pulse) for name in self.simulation.instances}

    def tangent(self, name: str, pulse: float) -> Tangent:
        """A component about it, by pulses of that size."""
        self.simulation.instances[name].restore(self.begun[name])
        return _tangent(self, name, pulse)

    def rest_of(self, name: str) -> Rest:
        """What was done to a component last, and which of its variables count."""
        fmu, system = cast("Watched", self.simulation.instances[name]), self.simulation.system
        ends = [*(end for x in system.connections for end in x.end), *self.beside.moved]
        starts = [*(start for x in system.connections for start in x.start), *self.beside.seen]
        given = dict.fromkeys(variable_of(end) for end in ends if component_of(end) == name)
        inputs = tuple(end for end in given if fmu.model.variables[end].kind == "Real")
        taken = dict.fromkeys(variable_of(start) for start in starts if component_of(start) == name)
        return Rest(
            fmu=fmu.fmu,
            inputs=inputs,
            held=np.array([fmu.written[end] for end in inputs]),
            outputs=tuple(output for output in taken if fmu.model.variables[output].kind == "Real"),
            time=fmu.time,
        )


@contextmanager
def at_rest(
    system: System,
    instances: Instances,
    pulse: float = PULSE,
    beside: Beside = NOTHING,
    models: Mapping[str, Model] | None = None,
) -> Iterator[AtRest]:
    """`system` at its operating point, punctual and without loss, noise and quantisation.

    Its FMUs may have been found (`models`); else they are found, and built if need be. Raises `UsageError` where it
    does not rest there, or cannot be put into a linear loop, saying why.
    """
    calm = deterministic(system)
    period = _expect_period(calm)
    delay = max((exact_nanoseconds(highest(x.delay)) for x in calm.connections), default=Fraction(0))
    begin = latest_offset(calm) + (math.ceil(delay / period) + HELD) * period
    calm = replace(calm, stop_time=float(begin + (SETTLED + 2) * period) / NANOSECONDS)
    resolved = None if models is None else resolve_with_models(calm, models)
    with prepared(calm, load=watching(instances), resolved=resolved) as simulation:
        _expect_states(simulation)
        _come_to_rest(simulation, begin, period)
        yield AtRest(
            simulation=simulation, begun={name: one.save() for name, one in simulation.instances.items()},
            pulse=pulse, beside=beside, begin=begin, period=period,
        )  # fmt: skip


# -- where it is taken -----------------------------------------------------------------------------------------------


def _expect_period(system: System) -> Fraction:
    expect_unscheduled(system, "has no fixed period, which a loop that is made linear needs")
    for name, component in system.components.items():
        if component.sampling is not None and component.sampling.clock == "fmu":
            raise UsageError(f"{name} has a clock of its own")
    period = common_period(system)
    if period is None:
        raise UsageError("the sampled components are not due together again within twenty of the longest period")
    return period


def _expect_states(simulation: PreparedRun) -> None:
    without = [name for name, instance in simulation.instances.items() if not instance.model.saves_state]
    if without:
        raise UsageError(f"the FMU of {', '.join(without)} cannot save its state")


def _come_to_rest(simulation: PreparedRun, begin: Fraction, period: Fraction) -> None:
    """Run for some periods, in which nothing may move."""
    master, system = simulation.master, simulation.system
    master.initialise()
    rows = []
    for k in range(SETTLED):
        if master.run(pause_at=math.floor(begin + k * period)):
            raise UsageError(
                f"the operating point is left: {master.divergence or master.termination or 'the run was interrupted'}"
            )
        rows.append([master.board.row[master.board.place[signal]] for signal in exchanged(system)])
    expect_rest(system, np.array(rows))


def _tangent(loop: AtRest, name: str, pulse: float) -> Tangent:
    fmu, rest, period = loop.simulation.instances[name], loop.rest_of(name), loop.period
    component = loop.simulation.system.components[name]
    if component.sampling is not None:
        return Tangent(rest, [component.sampling.period] * RUNGS_OF_TASK, pulse)
    first = FINEST * float(period) / NANOSECONDS
    if fmu.model.varies_step:
        ladder = np.array([first * 2 ** max(i - 1, 0) for i in range(RUNGS)])
        return _telling_most(rest, [(times * ladder).tolist() for times in LONGER], pulse)
    assert component.step is not None
    points = (round(first * 2**i / component.step) for i in range(RUNGS_OF_FIXED))
    counts = np.diff(sorted({0, *(max(1, point) for point in points)}))
    return Tangent(rest, [float(count * component.step) for count in counts], pulse, unit=component.step)


def _telling_most(rest: Rest, ladders: Sequence[Sequence[float]], pulse: float) -> Tangent:
    """By the first of the ladders of which the next one tells no more states."""
    begun = rest.fmu.save()
    best = Tangent(rest, ladders[0], pulse)
    for ladder in ladders[1:]:
        rest.fmu.restore(begun)
        with suppress(UsageError):  # one on which what is unstable has run away
            other = Tangent(rest, ladder, pulse)
            if len(other.state) > len(best.state):
                best = other
                continue
        break
    return best


# -- the map of a period ---------------------------------------------------------------------------------------------


def map_of(loop: AtRest, opened: Mapping[str, Opened] | None = None) -> Floats:
    """The derivatives of what a loop holds after a period, below of what `opened` components hear in it.

    By what it holds before, at the instants of `begin` plus whole periods, and to the right by what those say.
    """
    opened = opened or {}
    simulators = {**loop.tangents, **opened}
    master = _master(loop, simulators)
    master.initialise()
    master.run(pause_at=math.floor(loop.begin))
    places = [*_held(master, simulators), *(one.said for one in opened.values())]
    heard = [one.heard for one in opened.values()]
    columns, rows = sum(map(len, places)), sum(map(len, [*_held(master, simulators), *heard]))
    if columns > LARGEST:
        raise UsageError(f"{columns} numbers go through a period, more than {LARGEST}")
    result: Floats = np.zeros((rows, columns))
    for i, unit in enumerate(np.eye(columns)):
        _put(unit, [*_held(master, simulators), *(one.said for one in opened.values())])
        master.run(pause_at=math.floor(loop.begin + (i + 1) * loop.period))
        after = np.concatenate([*_held(master, simulators), *heard])
        if len(after) != rows:
            raise UsageError("not as many messages are on their way after a period as before")
        result[:, i] = after
    if not np.isfinite(result).all():
        raise UsageError("what is small about the operating point has no finite derivative")
    return result


def _master(loop: AtRest, simulators: Mapping[str, Linear]) -> Master:
    """Of linear simulators, under the clock of the system, for as many periods as there may be numbers."""
    simulation = loop.simulation
    system = replace(
        simulation.system,
        stop_time=float(loop.begin + (LARGEST + 2) * loop.period) / NANOSECONDS,
        components={
            name: _in_step(component, loop.period) if simulation.instances[name].model.varies_step else component
            for name, component in simulation.system.components.items()
        },
        connections=tuple(replace(x, offset=0.0) for x in simulation.system.connections),
        sources={},
        criterion=Criterion(),
    )
    streams, models = Streams(system.seed, system.streams), {n: i.model for n, i in simulation.instances.items()}
    return Master(
        system,
        simulators,
        timetable=Timetable(system, streams, fixed_steps(system, models)),
        streams=streams,
        recorded=dict.fromkeys(simulators, ()),
        recorder=Nowhere(),
    )


def _in_step(component: Component, period: Fraction) -> Component:
    """With points of which a whole number makes a period, no farther apart: so every period is like the others."""
    if component.step is None:
        return component
    count = math.ceil(period / exact_nanoseconds(component.step))
    return replace(component, step=float(period / count) / NANOSECONDS)


def _held(master: Master, simulators: Mapping[str, Linear]) -> list[Floats]:
    """What goes through an instant, in place: the row but for its time, connections, and components."""
    parts = [master.board.row[1:]]
    for channel in master.channels:
        parts += channel.held()
    return [*parts, *(part for one in simulators.values() for part in (one.state, one.input))]


def _put(values: Floats, into: Sequence[Floats]) -> None:
    for part, value in zip(into, np.split(values, np.cumsum([len(part) for part in into])[:-1])):
        part[:] = value


class Nowhere(InMemory):
    """A recorder that keeps nothing."""

    def take(self, chunk: Chunk) -> None:
        """As `Recorder`."""


# -- what was done to an FMU last ------------------------------------------------------------------------------------


class Watched:
    """An FMU of which is known what was written to it, and when it was stepped last."""

    def __init__(self, fmu: Instance) -> None:
        self.fmu = fmu
        self.written: dict[str, float] = {}
        self.time = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.fmu, name)

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As `Simulator`."""
        write = self.fmu.writer(names, source)

        def transfer() -> None:
            write()
            self.written.update(zip(names, source.tolist()))

        return transfer

    def enter_initialization(self, start: float, stop: float) -> None:
        """As `Simulator`, without an end: from where this run has come to rest, others begin."""
        self.fmu.enter_initialization(start, math.inf)

    def step(self, t: float, h: float) -> None:
        """As `Simulator`."""
        self.fmu.step(t, h)
        self.time = t + h


def watching(instances: Instances) -> Loader:
    """Loads instances of which is known what was done to them last."""

    @contextmanager
    def load(path: Path, instance_name: str) -> Iterator[Instance]:
        with instances.load(path, instance_name) as fmu:
            yield cast(Instance, Watched(fmu))

    return load
