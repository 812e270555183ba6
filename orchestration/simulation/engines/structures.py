"""The structures of structures.h, which C and Python share, and those of a system, for either loop in C."""

import ctypes
import functools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.c_structures import address, constants, declared
from orchestration.simulation.engines.wiring_by_index import Wires

HEADER = Path(__file__).with_name("structures.h")


@functools.cache
def structures(lanes: int) -> Any:
    """The structures and constants of structures.h for a number of SIMD lanes, by name."""
    return SimpleNamespace(**constants(HEADER.read_text(encoding="utf-8")), **shared(lanes))


@functools.cache
def shared(lanes: int) -> Mapping[str, Any]:
    """The structures without the constants."""
    return declared(HEADER.read_text(encoding="utf-8"), lanes)


ONE_LANE = structures(1)
"""The structures and constants for FMUs that are called, one run at a time"""


class SystemStructures:
    """Builds the structures of a system for a number of SIMD lanes."""

    def __init__(self, wires: Wires, lanes: int) -> None:
        self.types = structures(lanes)
        """Structures and constants of structures.h"""
        self._wires, self._kept = wires, list[Any]()

    def address(self, array: npt.NDArray[Any]) -> int:
        """The address of the values of an array, which is kept alive."""
        self._kept.append(array)
        return address(array)

    def table(self, kind: Any, items: Iterable[Any]) -> Any:
        """An array of structures of a kind, which is kept alive."""
        values = [*items]
        table = (kind * len(values))(*values)
        self._kept.append(table)
        return table

    def indices(self, items: Sequence[int]) -> Any:
        """Indices for C."""
        return self.types.List(items=self.address(np.array(items, dtype=np.int64)), count=len(items))

    def component(self, index: int, **of_engine: Any) -> Any:
        """A component with its place in the system."""
        name = self._wires.names[index]
        into = self._wires.into(name)
        return self.types.Component(
            rank=self._wires.rank(index), by_itself=self._wires.is_by_itself(name), held=self.indices(into.held),
            ahead=self.indices(into.ahead), behind=self.indices(into.behind), **of_engine,
        )  # fmt: skip

    def channel(self, index: int, **of_engine: Any) -> Any:
        """A connection with what it does to a message."""
        x = self._wires.system.connections[index]
        return self.types.Channel(
            size=len(x.start), noisy=any(x.noise.values()), rounds=any(x.quantisation.values()), converts=x.converts,
            extrapolates=x.hold == "first", read_ahead=index in self._wires.plan.read_ahead, **of_engine,
        )  # fmt: skip

    def fill(self, loop: Any, *, components: Any, channels: Any, tracks: Any, **of_engine: Any) -> None:
        """Set the fields of a loop over these components and connections."""
        wires = self._wires
        fields = {
            "components": ctypes.addressof(components), "channels": ctypes.addressof(channels),
            "channel_count": len(channels), "tracks": ctypes.addressof(tracks),
            "continuous": self.indices(wires.continuous), "sampled": self.indices(wires.sampled),
            "some_by_themselves": any(map(wires.is_by_itself, wires.names)), **of_engine,
        }  # fmt: skip
        for name, value in fields.items():
            setattr(loop, name, value)
