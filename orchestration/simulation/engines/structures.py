"""The structures that C and Python share, parsed from structures.h; those of one run, filled in for loop.c."""

import ctypes
import functools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.components.fmi.native import NativeInstance
from orchestration.components.fmi.transfers import TransferCall, range_of
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.simulation.engines.channel import Channel, of_each
from orchestration.simulation.engines.feeds import Feed
from orchestration.systems.system.connection import Connection

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


class RunStructures:
    """Builds the structures of one run, keeps what they point at, and finds the Python transfer of a call."""

    def __init__(self, instances: Sequence[NativeInstance]) -> None:
        self.instances = list(instances)
        self.calls: dict[int, tuple[str, Transfer]] = {}
        """the name of the function and the transfer of a `Part`, by its address"""
        self._kept: list[Any] = []

    def address(self, array: Any) -> int:
        """The address of the values of an array, which is kept alive."""
        self._kept.append(array)
        return address(array)

    def indices(self, items: Sequence[int]) -> Any:
        """Indices for C."""
        return ONE_LANE.List(items=self.address(np.array(items, dtype=np.int64)), count=len(items))

    def transfer(self, component: int, transfer: Transfer, array: Floats) -> Any:
        """The calls of a transfer between a component and an array."""
        calls = self.instances[component].calls_of(transfer)
        parts = (ONE_LANE.Part * len(calls))(*(self._part(component, call) for call in calls))
        self._kept.append(parts)
        for part, call in zip(parts, calls):
            self.calls[ctypes.addressof(part)] = (call.function, transfer)
        return ONE_LANE.Transfer(parts=ctypes.addressof(parts), count=len(calls), array=self.address(array))

    def component(self, index: int, read: Transfer, values: Floats, connected: int) -> Any:
        """The structure of a component, without the fields that its place in the system determines."""
        instance = self.instances[index]
        version = instance.model.version
        outputs = [ctypes.addressof(each) for each in instance.step_outputs] or [0, 0, 0, 0]
        event, ends, early, reached = outputs
        return ONE_LANE.Component(
            fmu=instance.handle,
            step=instance.address(f"fmi{version}DoStep"),
            version=version,
            foreign=instance.guard is not None,
            messages_waiting=ctypes.addressof(instance.messages_waiting),
            read=self.transfer(index, read, values),
            outputs=self.address(values),
            connected=connected,
            event=event,
            ends=ends,
            early=early,
            reached=reached,
        )

    def channel(self, x: Connection, channel: Channel, receiver: int, row: Floats, places: Sequence[int]) -> Any:
        """The structure of a connection, without messages in flight."""
        sigma, quantum = of_each(x, x.noise), of_each(x, x.quantisation)
        return ONE_LANE.Channel(
            write=self.transfer(receiver, channel.write, channel.received),
            sender=self.address(row),
            places=self.address(np.array(places, dtype=np.int64)),
            size=len(places),
            noisy=bool(sigma.any()),
            rounds=bool(quantum.any()),
            converts=x.converts,
            extrapolates=x.hold == "first",
            sigma=self.address(sigma),
            quantum=self.address(quantum),
            scale=self.address(np.array([x.scale])),
            offset=self.address(np.array([x.offset])),
            value=self.address(np.zeros(len(places))),
        )

    def feed(self, component: int, feed: Feed) -> Any:
        """The structure of a source."""
        return ONE_LANE.Feed(write=self.transfer(component, feed.transfer, feed.into), size=feed.size)

    def _part(self, component: int, call: TransferCall) -> Any:
        instance, part = self.instances[component], call.part
        kind = "boolean32" if part.type == "Boolean" and part.buffer.dtype != bool else part.buffer.dtype.name
        low, high = range_of(part.buffer.dtype) if part.buffer.dtype.kind in "iuf" else (0.0, 0.0)
        return ONE_LANE.Part(
            function=instance.address(call.function),
            fmu=instance.handle,
            references=self.address(np.array(part.references, dtype=np.uint32)),
            count=len(part.references),
            buffer=self.address(part.buffer),
            values=len(part.buffer),
            asked=None if call.in_place else self.address(part.array_places.astype(np.int64)),
            places=None if call.in_place else self.address(part.places.astype(np.int64)),
            size=len(part.array_places),
            type=getattr(ONE_LANE, kind.upper()),
            counts_values=instance.counts_values,
            low=low,
            high=high,
            component=component,
        )
