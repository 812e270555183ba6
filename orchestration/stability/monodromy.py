"""The sampled loop of any system about its operating point: the linear map of one period, from saved states.

Each component is put in place of itself as a `Tangent`; the master then exchanges what they do, under the clock of
the system. What goes through a period is what the components, the connections and the row hold; the map is found by
one period from each of these numbers.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats, Transfer
from orchestration.engines.master import Master
from orchestration.engines.wiring import fixed_steps
from orchestration.fmi.instance import Instance, Loader
from orchestration.fmi.reuse import Instances
from orchestration.recording.recording import Chunk, InMemory
from orchestration.runs.simulation import PreparedRun, prepared
from orchestration.schedule.streams import Streams
from orchestration.schedule.timetable import Timetable
from orchestration.stability.linearised_component import PULSE, Rest, Tangent
from orchestration.stability.operating_point import common_period, deterministic, exchanged, expect_rest, latest_offset
from orchestration.system.model import Component, Criterion, System, component_of, variable_of
from orchestration.system.times import NANOSECONDS, exact_nanoseconds

SETTLED = 6
"""periods of the run that comes to rest, after what is on its way has arrived"""
HELD = 2
"""messages that a first-order hold remembers"""
LARGEST = 400
"""of a loop: numbers that go through a period"""
RUNGS, FINEST = 12, 0.25
"""of the ladder of a component in continuous time: points, each twice the one before; the first by the period"""
RUNGS_OF_FIXED = 5
"""where a component takes short steps of one length only"""
RUNGS_OF_TASK = 32
"""of a sampled component: samples"""


def growth_of_loop(system: System, instances: Instances, pulse: float = PULSE) -> float:
    """The growth [1/s] of what is small about the operating point of `system`; negative: it decays.

    Raises `UsageError` where the system does not rest there, or cannot be put into a linear loop, saying why.
    """
    calm = deterministic(system)
    period = _expect_period(calm)
    delay = max((exact_nanoseconds(x.delay) for x in calm.connections), default=Fraction(0))
    begin = latest_offset(calm) + (math.ceil(delay / period) + HELD) * period
    calm = replace(calm, stop_time=float(begin + (SETTLED + 2) * period) / NANOSECONDS)
    with prepared(calm, load=_watching(instances)) as simulation:
        _expect_states(simulation)
        _come_to_rest(simulation, begin, period)
        tangents = {name: _tangent(simulation, name, period, pulse) for name in calm.components}
        matrix = _map_of(simulation, tangents, begin, period)
    if not np.isfinite(matrix).all():
        raise UsageError("what is small about the operating point has no finite derivative")
    radius = float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))
    return math.log(radius) / (float(period) / NANOSECONDS) if radius > 0.0 else -math.inf


# -- where it is taken -----------------------------------------------------------------------------------------------


def _expect_period(system: System) -> Fraction:
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


def _tangent(simulation: PreparedRun, name: str, period: Fraction, pulse: float) -> Tangent:
    fmu, system = cast("Watched", simulation.instances[name]), simulation.system
    given = {variable_of(end): 0.0 for x in system.connections for end in x.end if component_of(end) == name}
    inputs = tuple(end for end in given if fmu.model.variables[end].kind == "Real")
    taken = dict.fromkeys(variable_of(s) for x in system.connections for s in x.start if component_of(s) == name)
    rest = Rest(
        fmu=fmu.fmu,
        inputs=inputs,
        held=np.array([fmu.written[end] for end in inputs]),
        outputs=tuple(output for output in taken if fmu.model.variables[output].kind == "Real"),
        time=fmu.time,
    )
    component = system.components[name]
    if component.sampling is not None:
        return Tangent(rest, [component.sampling.period] * RUNGS_OF_TASK, pulse)
    first = FINEST * float(period) / NANOSECONDS
    if fmu.model.varies_step:
        return Tangent(rest, [first * 2 ** max(i - 1, 0) for i in range(RUNGS)], pulse)
    assert component.step is not None
    points = (round(first * 2**i / component.step) for i in range(RUNGS_OF_FIXED))
    counts = np.diff(sorted({0, *(max(1, point) for point in points)}))
    return Tangent(rest, [float(count * component.step) for count in counts], pulse, unit=component.step)


# -- the map of a period ---------------------------------------------------------------------------------------------


def _map_of(simulation: PreparedRun, tangents: dict[str, Tangent], begin: Fraction, period: Fraction) -> Floats:
    """d(what the loop holds after a period)/d(what it holds), at the instants of `begin` plus whole periods."""
    system = replace(
        simulation.system,
        stop_time=float(begin + (LARGEST + 2) * period) / NANOSECONDS,
        components={
            name: _in_step(component, period) if simulation.instances[name].model.varies_step else component
            for name, component in simulation.system.components.items()
        },
        connections=tuple(replace(x, offset=0.0) for x in simulation.system.connections),
        sources={},
        criterion=Criterion(),
    )
    streams, models = Streams(system.seed, system.streams), {n: i.model for n, i in simulation.instances.items()}
    master = Master(
        system,
        tangents,
        timetable=Timetable(system, streams, fixed_steps(system, models)),
        streams=streams,
        recorded=dict.fromkeys(tangents, ()),
        recorder=Nowhere(),
    )
    master.initialise()
    master.run(pause_at=math.floor(begin))
    size = sum(map(len, _held(master, tangents)))
    if size > LARGEST:
        raise UsageError(f"{size} numbers go through a period, more than {LARGEST}")
    result: Floats = np.zeros((size, size))
    for i, unit in enumerate(np.eye(size)):
        _put(unit, _held(master, tangents))
        master.run(pause_at=math.floor(begin + (i + 1) * period))
        after = np.concatenate(_held(master, tangents))
        if len(after) != size:
            raise UsageError("not as many messages are on their way after a period as before")
        result[:, i] = after
    return result


def _in_step(component: Component, period: Fraction) -> Component:
    """With points of which a whole number makes a period, no farther apart: so every period is like the others."""
    if component.step is None:
        return component
    count = math.ceil(period / exact_nanoseconds(component.step))
    return replace(component, step=float(period / count) / NANOSECONDS)


def _held(master: Master, tangents: dict[str, Tangent]) -> list[Floats]:
    """What goes through an instant, in place: the row but for its time, connections, and components."""
    parts = [master.board.row[1:]]
    for channel in master.channels:
        parts += channel.held()
    return [*parts, *(part for one in tangents.values() for part in (one.state, one.input))]


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


def _watching(instances: Instances) -> Loader:
    @contextmanager
    def load(path: Path, instance_name: str) -> Iterator[Instance]:
        with instances.load(path, instance_name) as fmu:
            yield cast(Instance, Watched(fmu))

    return load
