"""The map of a linear loop over a period, under the clock of the system.

The master exchanges values between tangents. The state of the loop is what components, connections and the row of
signals hold; its map is found by a period from each of these numbers, many together, and, where a component is
replaced by an open port, from each of the numbers that the port sends.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds, instants_of
from orchestration.foundation.recording.recording import Chunk, InMemory
from orchestration.simulation.engines.master import Master
from orchestration.simulation.engines.resolved import fixed_steps
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.component import Component
from orchestration.systems.system.connection import Connection, component_of, variable_of
from orchestration.systems.system.model import Criterion, System
from orchestration.theory.stability.linear_simulator import LinearSimulator, OpenPort
from orchestration.theory.stability.loop_at_rest import AtRest, KnownTangents, begin_of, whole_at_rest

MAX_STATES = 1000
"""states of a loop"""
ABREAST = 64
"""Numbers from each of which a period is run together"""
OTHER_PULSE = 0.25
"""Factor of the second pulse, whose growth is compared"""


def period_map(
    loop: AtRest, ports: Mapping[str, OpenPort] | None = None, connections: Sequence[Connection] | None = None
) -> Floats:
    """The derivatives of the state of a loop after a period and, below, of the values received by open `ports` in it.

    By the state before, at the begin of a period, and to the right by the values the ports send. Other `connections`
    than those of the loop at rest may carry the signals, as later ones.
    """
    ports = {name: port.abreast(ABREAST) for name, port in (ports or {}).items()}
    simulators = {**{name: one.abreast(ABREAST) for name, one in loop.tangents.items()}, **ports}
    system = loop.simulation.system
    if connections is not None:
        system = replace(system, connections=tuple(connections))
    master, begin = _begun(loop, system, simulators, NullRecorder(), runs=(ABREAST,))
    places = [*_state_parts(master, simulators), *(port.sent for port in ports.values())]
    received = [port.received for port in ports.values()]
    columns, rows = sum(map(len, places)), sum(map(len, [*_state_parts(master, simulators), *received]))
    _expect_few(columns)
    result: Floats = np.zeros((rows, columns))
    for k, first in enumerate(range(0, columns, ABREAST), 1):
        units = np.eye(columns, ABREAST, -first)
        _assign(units, [*_state_parts(master, simulators), *(port.sent for port in ports.values())])
        master.run(pause_at=round(begin + k * loop.period))
        after = np.concatenate([*_state_parts(master, simulators), *received])
        if len(after) != rows:
            raise UsageError("the number of messages in transit changes over a period")
        result[:, first : first + ABREAST] = after[:, : columns - first]
    if not np.isfinite(result).all():
        raise UsageError("the loop has no finite derivative at the operating point")
    return result


@dataclass(frozen=True, kw_only=True)
class StepMap:
    """A loop while 1 is added to some inputs, over a period: x⁺ = A x + b, and an output y = C x + d at its rows."""

    A: Floats
    b: Floats
    C: Floats
    d: Floats
    x: Floats
    """The state as the step begins, with what is sampled at that instant."""
    y: float
    """The output then."""
    times: Floats
    """Times of the rows from the begin of the period on [s]."""


def step_map(loop: AtRest, inputs: Sequence[str], output: str) -> StepMap:
    """What 1 that is added to `inputs` does to an output, both of them signals of the loop.

    It begins as the instant does in which all rates meet.
    """
    simulators, system, recorder = loop.tangents, loop.simulation.system, InMemory()
    recorded = {component_of(output): (variable_of(output),)}
    master, begin = _begun(loop, system, simulators, recorder, recorded)
    sampled = [end for end in inputs if system.components[component_of(end)].sampling is not None]
    size, place = sum(map(len, _state_parts(master, simulators))), master.board.place[output]
    _expect_few(size)
    periods = ((round(begin + i * loop.period), round(begin + (i + 1) * loop.period)) for i in itertools.count())

    def after(state: Floats, added: Sequence[str], at: int = 0) -> Floats:
        """The state after a period, with 1 added to inputs from a time in it on [ns]."""
        start, end = next(periods)
        _assign(state, _state_parts(master, simulators))
        if at:
            master.run(pause_at=start + at)
        with _added(simulators, added):
            master.run(pause_at=end)
        return np.concatenate(_state_parts(master, simulators))

    moved = np.column_stack([after(unit, ()) for unit in np.eye(size)] + [after(np.zeros(size), inputs)])
    rows = np.vstack([chunk.rows for chunk in (*recorder.chunks(), master.pending())])
    ends = [round(begin + i * loop.period) for i in range(size + 2)]
    each = np.split(rows, np.searchsorted(instants_of(rows[:, 0]), ends, side="right"))[1:-1]
    if len({len(one) for one in each}) > 1 or not np.isfinite(moved).all():
        raise UsageError("the loop has no finite derivative at the operating point, or its periods differ")
    instants = [0, *(instants_of(each[0][:, 0]) - ends[0]).tolist()]
    first = after(np.zeros(size), sampled, max(each for each in instants if each < ends[1] - ends[0]))
    seen, is_state = np.column_stack([one[:, place] for one in each]), _moves(system, simulators, size)
    return StepMap(
        A=moved[np.ix_(is_state, np.append(is_state, False))], b=moved[is_state, -1],
        C=seen[:, np.append(is_state, False)], d=seen[:, -1],
        x=first[is_state], y=float(master.board.row[place]), times=np.array(instants[1:]) / NANOSECONDS,
    )  # fmt: skip


@contextmanager
def _added(simulators: Mapping[str, LinearSimulator], inputs: Sequence[str]) -> Iterator[None]:
    """1 added to inputs."""
    places = [(one := simulators[component_of(end)], one.inputs.index(variable_of(end))) for end in inputs]
    for one, place in places:
        one.added[place] = 1.0
    try:
        yield
    finally:
        for one, place in places:
            one.added[place] = 0.0


def _moves(system: System, simulators: Mapping[str, LinearSimulator], size: int) -> npt.NDArray[np.bool_]:
    """Which parts of the state may move: not the inputs that no connection brings."""
    connected = {end for x in system.connections for end in x.end}
    of_simulators = [
        is_moved
        for name, one in simulators.items()
        for is_moved in (*(True for _ in one.state), *(f"{name}.{end}" in connected for end in one.inputs))
    ]
    return np.array([True] * (size - len(of_simulators)) + of_simulators)


def growth_of_loop(
    system: System, instances: Instances, factor: float = 1.0, known: KnownTangents | None = None
) -> float:
    """The growth rate [1/s] of small deviations from the operating point of `system`; negative: they decay.

    Tangents are kept in `known`, as by `at_rest`; the pulses that measure them are multiplied by `factor`. Raises
    `UsageError` where the system does not rest there, or has no linear loop, saying why.
    """
    with whole_at_rest(system, instances, known=known) as loop:
        if factor != 1.0:
            loop = replace(loop, begun={name: one.with_pulse(factor) for name, one in loop.tangents.items()})
        radius = float(np.abs(np.linalg.eigvals(period_map(loop))).max(initial=0.0))
        return math.log(radius) / (float(loop.period) / NANOSECONDS) if radius > 0.0 else -math.inf


def _begun(
    loop: AtRest,
    system: System,
    simulators: Mapping[str, LinearSimulator],
    recorder: InMemory,
    recorded: Mapping[str, Sequence[str]] | None = None,
    runs: tuple[int, ...] = (),
) -> tuple[Master, Fraction]:
    """A master of linear simulators, under the clock of the system, for a period for each possible state.

    It is at the begin of one [ns]; `runs` as of `RunningSystem`.
    """
    simulation, begin = loop.simulation, begin_of(system, loop.period)
    system = replace(
        system,
        stop_time=float(begin + (MAX_STATES // math.prod(runs) + 3) * loop.period) / NANOSECONDS,
        components={
            name: _with_even_steps(component, loop.period)
            if simulation.instances[name].model.varies_step
            else component
            for name, component in system.components.items()
        },
        connections=tuple(replace(x, offset=0.0) for x in system.connections),
        sources={},
        criterion=Criterion(),
    )
    streams, models = Streams(system.seed, system.streams), {n: i.model for n, i in simulation.instances.items()}
    timetable = Timetable(system, streams, fixed_steps(system, models))
    recorded = {**dict.fromkeys(simulators, ()), **(recorded or {})}
    running = RunningSystem(system, simulators, timetable=timetable, streams=streams, recorded=recorded, runs=runs)
    master = Master(running, recorder)
    master.initialise()
    master.run(pause_at=round(begin))
    for one in simulators.values():
        one.sample = 0
    return master, begin


def _expect_few(states: int) -> None:
    if states > MAX_STATES:
        raise UsageError(f"the loop has {states} states, more than {MAX_STATES}")


def _with_even_steps(component: Component, period: Fraction) -> Component:
    """The component with a step that divides the period, no longer than its own: so all periods are alike."""
    if component.step is None:
        return component
    count = math.ceil(period / exact_nanoseconds(component.step))
    return replace(component, step=float(period / count) / NANOSECONDS)


def _state_parts(master: Master, simulators: Mapping[str, LinearSimulator]) -> list[Floats]:
    """The state at an instant, in place: the row without its time, connections, and components."""
    parts = [master.board.row[1:]]
    for channel in master.running.channels:
        parts += channel.held()
    return [*parts, *(part for one in simulators.values() for part in (one.state, one.input))]


def _assign(values: Floats, into: Sequence[Floats]) -> None:
    for part, value in zip(into, np.split(values, np.cumsum([len(part) for part in into])[:-1])):
        part[:] = value


class NullRecorder(InMemory):
    """A recorder that keeps nothing."""

    def take(self, chunk: Chunk) -> None:
        """As `Recorder`."""
