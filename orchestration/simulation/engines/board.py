"""One row of all values that are exchanged or recorded; simulators and channels read and write parts of it in place."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.model import System
from orchestration.systems.system.variable_names import component_of, variable_of


class Board:
    """The current row, and the place of each column in it.

    Columns: `time`, then by component, in the order of the file, its connected inputs (of one in continuous
    time, as they are applied), its connected outputs, and what else is recorded of it.
    """

    def __init__(self, system: System, recorded: Mapping[str, Sequence[str]]) -> None:
        self.outputs: dict[str, tuple[str, ...]] = {}
        """the outputs that are read of each component"""
        self.connected: dict[str, int] = {}
        """the number of its outputs that are connected; these are the first"""
        columns = ["time"]
        for name, component in system.components.items():
            inputs = [end for x in system.connections for end in x.end if component_of(end) == name]
            starts = (start for x in system.connections for start in x.start if component_of(start) == name)
            connected = tuple(dict.fromkeys(variable_of(start) for start in starts))
            outputs = tuple(dict.fromkeys((*connected, *recorded[name])))
            shown = {variable_of(end) for end in inputs} if component.sampling is None else set()
            outputs = tuple(output for output in outputs if output not in shown)
            self.outputs[name], self.connected[name] = outputs, len(connected)
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
