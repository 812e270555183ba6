"""The wiring of a system, for any engine: its row by index, the connections into a component, and what they pass on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.basics.times import seconds
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.connection import Connection, component_of, variable_of
from orchestration.systems.system.model import System


class Board:
    """The current row, and the place of each column in it.

    Columns: `time`, then by component, in the order of the file, its connected inputs (of one in continuous
    time, as they are applied), its connected outputs, and what else is recorded of it.
    """

    def __init__(self, system: System, recorded: Mapping[str, Sequence[str]], runs: tuple[int, ...] = ()) -> None:
        """`runs` is the shape of the runs that are carried out together, each with a number in every column."""
        self.outputs: dict[str, tuple[str, ...]] = {}
        """the outputs that are read of each component"""
        self.connected: dict[str, int] = {}
        """the number of its outputs that are connected, and so have to be finite; these are the first. Where nothing is
        connected all are looked at, and have to be."""
        columns = ["time"]
        for name, component in system.components.items():
            inputs = [end for x in system.connections for end in x.end if component_of(end) == name]
            starts = (start for x in system.connections for start in x.start if component_of(start) == name)
            connected = tuple(dict.fromkeys(variable_of(start) for start in starts))
            outputs = tuple(dict.fromkeys((*connected, *recorded[name])))
            shown = {variable_of(end) for end in inputs} if component.sampling is None else set()
            outputs = tuple(output for output in outputs if output not in shown)
            self.outputs[name] = outputs
            self.connected[name] = len(connected if system.connections else outputs)
            columns += [*(inputs if component.sampling is None else ()), *(f"{name}.{output}" for output in outputs)]
        self.columns = tuple(columns)
        self.row: Floats = np.zeros((len(columns), *runs))
        self.place = {column: i for i, column in enumerate(columns)}

    def of(self, columns: Sequence[str]) -> Floats:
        """A view of the part of the row with these columns, which are adjacent."""
        first = self.place[columns[0]] if columns else 0
        return self.row[first : first + len(columns)]

    def places(self, columns: Sequence[str]) -> slice | npt.NDArray[np.intp]:
        """The indices of these columns; a slice if they are adjacent."""
        places = [self.place[column] for column in columns]
        if places == list(range(places[0], places[0] + len(places))):
            return slice(places[0], places[0] + len(places))
        return np.array(places)


@dataclass(frozen=True, kw_only=True)
class Into:
    """Connections into a component."""

    held: tuple[int, ...]
    """Connections with a first-order hold"""
    ahead: tuple[int, ...]
    """wires from components that are stepped before it, which carry their new values"""
    behind: tuple[int, ...]
    """wires from other components, which carry the values at the beginning of its step"""


class Wires:
    """The wiring that follows from the structure of a system, and from what is recorded of it."""

    def __init__(self, system: System, recorded: Mapping[str, Sequence[str]], runs: tuple[int, ...] = ()) -> None:
        self.system, self.plan = system, Plan(system)
        self.board = Board(system, recorded, runs)
        self.names = tuple(system.components)

    @cached_property
    def continuous(self) -> tuple[int, ...]:
        """Components in continuous time, in the order of an instant."""
        return tuple(map(self.names.index, self.plan.continuous))

    @cached_property
    def sampled(self) -> tuple[int, ...]:
        """Sampled components, in the order of an instant."""
        return tuple(map(self.names.index, self.plan.sampled))

    def into(self, name: str) -> Into:
        """The connections into a component."""
        connections, order = self.system.connections, self.plan.continuous
        wires = [i for i in self.plan.wires if connections[i].receiver == name]
        ahead = [
            i
            for i in wires
            if connections[i].order == "gauss-seidel" and order.index(connections[i].sender) < order.index(name)
        ]
        held = [i for i, x in enumerate(connections) if x.receiver == name and x.hold == "first"]
        return Into(held=tuple(held), ahead=tuple(ahead), behind=tuple(i for i in wires if i not in ahead))

    def rank(self, index: int) -> int:
        """The place of a component among those of its kind in the order of an instant."""
        return (self.continuous if index in self.continuous else self.sampled).index(index)

    def connected(self, name: str) -> tuple[str, ...]:
        """The connected outputs of a component, in the order of the row."""
        return tuple(f"{name}.{output}" for output in self.board.outputs[name][: self.board.connected[name]])

    def is_by_itself(self, name: str) -> bool:
        """Whether a component has its own clock and is stepped at every instant."""
        sampling = self.system.components[name].sampling
        return sampling is not None and sampling.clock == "fmu"

    def table(self, connection: int) -> str:
        """The table of a schedule with the messages of a connection, at the times at which they take their values."""
        if connection in self.plan.posted:
            return "posted"
        return "measured" if connection in self.plan.read_ahead else "exchanged"


def clock_of(system: System, name: str, first_samples: Mapping[str, int]) -> tuple[float, float]:
    """The rate of a component's own time, and its first sample [s]; 0 for one that is stepped from the start.

    `first_samples` are in [ns]. In FMI the first step begins at the time of initialisation.
    """
    sampling = system.components[name].sampling
    if sampling is None or sampling.clock == "fmu":
        return 1.0, 0.0
    return sampling.clock_ratio, seconds(first_samples.get(name, 0))


Indices: TypeAlias = npt.NDArray[np.intp]


class Channel:
    """One connection of a run: takes values from the board, and sets the receiver's inputs."""

    def __init__(
        self,
        connection: Connection,
        *,
        row: Floats,
        places: slice | Indices,
        received: Floats,
        write: Transfer,
        noise: np.random.Generator,
    ) -> None:
        self.received = received
        """the values that the receiver has, in place"""
        self._row, self._places = row, places
        self.write = write
        """sets the receiver's inputs"""
        self._sigma = of_each(connection, connection.noise)
        self._quantum = of_each(connection, connection.quantisation)
        self._noisy = bool(self._sigma.any())
        self._rounded = np.flatnonzero(self._quantum)
        self._quantum = self._quantum[self._rounded]
        self._rounds = len(self._rounded) > 0
        self._noise: Floats = np.zeros(len(connection.start))
        self.stream = noise
        """Stream of the noise"""
        self._scale, self._offset = connection.scale, connection.offset
        self._plain = not connection.converts
        self._extrapolates = connection.hold == "first"
        self.in_flight: dict[int, Floats] = {}
        """messages on their way"""
        self.applied: list[tuple[int, Floats]] = []
        """the last two values of a first-order hold, with their times [ns]"""
        self._received, self._sent = received.data, None
        is_as_sent = self._plain and not (self._noisy or self._rounds or self._extrapolates)
        if isinstance(places, slice) and is_as_sent and row.ndim == 1:
            self._sent = row[places].data  # a view of what is sent, which arrives unchanged

    def pass_on(self) -> None:
        """Pass the current values of the sender on to the receiver: at initialisation, and over a plain wire."""
        self.received[:] = self._row[self._places]
        if not self._plain:
            self._convert(self.received)
        self.write()

    def start(self) -> None:
        """Take the value of initialisation as the first that was applied."""
        self.applied = [(0, self.received.copy())]

    def take(self) -> Floats:
        """A message with the current values of the sender."""
        value: Floats = self._row[self._places].copy()
        if self._noisy:
            self.skip()
            self._noise *= self._sigma
            value += self._noise
        if self._rounds:
            multiples = value[self._rounded] / self._quantum
            np.rint(multiples, out=multiples)
            value[self._rounded] = multiples * self._quantum
        if not self._plain:
            self._convert(value)
        return value

    def hand_over(self, time: int, *, lost: bool) -> None:
        """Send a message that, unless it is lost, arrives at the time at which it is sent [ns]."""
        if lost:
            self.skip()
        elif self._sent is not None:
            self._received[:] = self._sent
            self.write()
        else:
            self.apply(self.take(), time)

    def skip(self, messages: int = 1) -> None:
        """Draw the noise of lost messages too, so that losses do not shift the random numbers of other messages."""
        if self._noisy:
            for _ in range(messages):
                self.stream.standard_normal(out=self._noise)

    def send(self, k: int, *, lost: bool) -> None:
        """Keep message `k` until it arrives."""
        if lost:
            self.skip()
        else:
            self.in_flight[k] = self.take()

    def deliver(self, k: int, time: int) -> None:
        """Deliver message `k` at `time` [ns]."""
        self.apply(self.in_flight.pop(k), time)

    def apply(self, value: Floats, time: int) -> None:
        """Set the receiver's inputs; of several messages at one time the last one counts."""
        if self._extrapolates:
            before = [past for past in self.applied if past[0] < time]
            self.applied = [*before[-1:], (time, value)]
        self.received[:] = value
        self.write()

    def extrapolate(self, time: int) -> None:
        """First-order hold: the line through the last two values that arrived, held over the receiver's next step."""
        if len(self.applied) < 2:
            return
        (t0, before), (t1, last) = self.applied
        if t0 == t1 or time == t1:
            return
        share = (time - t1) / (t1 - t0)
        self.received[:] = last + share * (last - before)
        self.write()

    def held(self) -> list[Floats]:
        """The values that determine later ones, in place: received, in flight, and of the hold."""
        past = [value for _, value in self.applied] if self._extrapolates else []
        return [self.received, *self.in_flight.values(), *past]

    def state(self) -> dict[str, Any]:
        """The state in JSON types, without that of the noise."""
        return {
            "received": self.received.tolist(),
            "in_flight": [(k, value.tolist()) for k, value in self.in_flight.items()],
            "applied": [(time, value.tolist()) for time, value in self.applied],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue where `state` was taken."""
        self.received[:] = state["received"]
        self.in_flight = {k: np.array(value) for k, value in state["in_flight"]}
        self.applied = [(time, np.array(value)) for time, value in state["applied"]]

    def _convert(self, value: Floats) -> None:
        value *= self._scale
        value += self._offset


def of_each(connection: Connection, values: Mapping[str, float]) -> Floats:
    """One value for each variable of a message, 0 by default; the name of a vector applies to all its components."""
    result = np.zeros(len(connection.start))
    for name, value in values.items():
        result[connection.places(name)] = value
    return result
