"""The structures that C and Python share, parsed from structures.h, and those of a system, for either loop in C."""

import ctypes
import functools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.simulation.engines.wiring_by_index import Wires

HEADER = Path(__file__).with_name("structures.h")
_SCALARS: Mapping[str, Any] = {
    "int": ctypes.c_int, "int32_t": ctypes.c_int32, "int64_t": ctypes.c_int64, "uint64_t": ctypes.c_uint64,
    "size_t": ctypes.c_size_t, "double": ctypes.c_double, "Lanes": ctypes.c_uint64, "void": None,
}  # fmt: skip
_STRUCTURE = re.compile(r"typedef struct \{(.*?)\} (\w+);", re.DOTALL)
_CONSTANTS = re.compile(r"enum \{(.*?)\};", re.DOTALL)
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_FUNCTION = re.compile(r"(\w+) \(\*(\w+)\)\((.*)\)")
_FIELDS = re.compile(r"(?:const )?(\w+) (.*)", re.DOTALL)
_FIELD = re.compile(r"(\**)(\w+)(?:\[(.*)\])?")


def address(array: npt.NDArray[Any]) -> int:
    """The address of the values of a contiguous array; the caller keeps the array alive."""
    return int(array.ctypes.data)


@functools.cache
def structures(lanes: int) -> Any:
    """The structures and constants of structures.h for a number of SIMD lanes, by name."""
    return SimpleNamespace(**constants(HEADER.read_text(encoding="utf-8")), **shared(lanes))


@functools.cache
def shared(lanes: int) -> Mapping[str, Any]:
    """The structures without the constants."""
    return declared(HEADER.read_text(encoding="utf-8"), lanes)


def constants(text: str) -> dict[str, int]:
    """The constants of the enumerations in a text of C, by name."""
    numbers: dict[str, int] = {}
    for enumeration in _CONSTANTS.findall(_COMMENT.sub("", text)):
        number = 0
        for each in enumeration.split(","):
            name, _, value = each.partition("=")
            number = int(value) if value else number
            numbers[name.strip()] = number
            number += 1
    return numbers


def declared(text: str, lanes: int = 1) -> dict[str, Any]:
    """The structures in a text of C, by name; a structure must be declared before it is used in another."""
    types: dict[str, Any] = {}
    for body, name in _STRUCTURE.findall(_COMMENT.sub("", text)):
        declarations = [part.strip() for part in body.split(";") if part.strip()]
        fields = [field for declaration in declarations for field in _fields(declaration, types, lanes)]
        types[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
    return types


def _fields(declaration: str, known: Mapping[str, Any], lanes: int) -> Iterator[tuple[str, Any]]:
    """Names and types of the fields of a declaration; any pointer is an address."""
    types = {**_SCALARS, **known}
    if function := _FUNCTION.fullmatch(declaration):
        result, name, arguments = function.groups()
        yield name, ctypes.CFUNCTYPE(types[result], *(types[each.strip()] for each in arguments.split(",")))
        return
    declarators = _FIELDS.fullmatch(declaration)
    assert declarators is not None, declaration
    for each in declarators[2].split(","):
        field = _FIELD.fullmatch(each.strip())
        assert field is not None, declaration
        stars, name, count = field.groups()
        kind = ctypes.c_void_p if stars else types[declarators[1]]
        sizes = [lanes if size == "L" else int(size) for size in count.split(" * ")] if count else []
        yield name, kind * math.prod(sizes) if sizes else kind


ONE_LANE = structures(1)
"""The structures and constants for FMUs that are called, one run at a time"""


def expect_same_sizes(library: ctypes.CDLL, types: Mapping[str, Any]) -> None:
    """Raise `QuadcosimError` naming the first of `types` that is missing in a library or has another size there."""
    size = ONE_LANE.Size
    sizes, place = {}, ctypes.addressof(size.in_dll(library, "sizes"))
    while (each := size.from_address(place)).name:
        sizes[ctypes.string_at(each.name).decode()] = each.size
        place += ctypes.sizeof(size)
    for name, structure in types.items():
        if sizes.get(name) != ctypes.sizeof(structure):
            raise QuadcosimError(
                f"structures.h: {name} has {sizes.get(name, 'no')} bytes in C: expected {ctypes.sizeof(structure)}, as "
                "in Python"
            )


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
