"""The wiring of a system, for any engine: by index, the connections into a component and when they are carried out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import seconds
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System


class Board:
    """The current row, and the place of each column in it.

    Columns: `time`, then by component, in the order of the file, its connected inputs (of one in continuous
    time, as they are applied), its connected outputs, and what else is recorded of it.
    """

    def __init__(self, system: System, recorded: Mapping[str, Sequence[str]]) -> None:
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
        self.row: Floats = np.zeros(len(columns))
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

    def __init__(self, system: System, recorded: Mapping[str, Sequence[str]]) -> None:
        self.system, self.plan = system, Plan(system)
        self.board = Board(system, recorded)
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
