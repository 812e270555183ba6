"""The map of a linear loop over a period, under the clock of the system.

The master exchanges values between tangents. The state of the loop is what components, connections and the row of
signals hold; its map is found by a period from each of these numbers, many together, and, where a component is
replaced by an open port, from each of the numbers that the port sends.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.foundation.recording.recording import Chunk, InMemory
from orchestration.simulation.engines.master import Master
from orchestration.simulation.engines.resolved import fixed_steps
from orchestration.simulation.engines.running_system import RunningSystem
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.component import Component
from orchestration.systems.system.connection import Connection
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
    ports = ports or {}
    ports = {name: port.abreast(ABREAST) for name, port in ports.items()}
    simulators = {**{name: one.abreast(ABREAST) for name, one in loop.tangents.items()}, **ports}
    system = loop.simulation.system
    if connections is not None:
        system = replace(system, connections=tuple(connections))
    begin = begin_of(system, loop.period)
    master = _master(loop, system, begin, simulators)
    master.initialise()
    master.run(pause_at=round(begin))
    for one in simulators.values():
        one.sample = 0
    places = [*_state_parts(master, simulators), *(port.sent for port in ports.values())]
    received = [port.received for port in ports.values()]
    columns, rows = sum(map(len, places)), sum(map(len, [*_state_parts(master, simulators), *received]))
    if columns > MAX_STATES:
        raise UsageError(f"the loop has {columns} states, more than {MAX_STATES}")
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


def _master(loop: AtRest, system: System, begin: Fraction, simulators: Mapping[str, LinearSimulator]) -> Master:
    """A master of linear simulators, under the clock of the system, for a period for each possible state."""
    simulation = loop.simulation
    system = replace(
        system,
        stop_time=float(begin + (MAX_STATES // ABREAST + 2) * loop.period) / NANOSECONDS,
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
    timetable, recorded = Timetable(system, streams, fixed_steps(system, models)), dict.fromkeys(simulators, ())
    running = RunningSystem(
        system, simulators, timetable=timetable, streams=streams, recorded=recorded, runs=(ABREAST,)
    )
    return Master(running, NullRecorder())


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
