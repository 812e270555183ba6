"""The structures of structures.h, which C and Python share, and those of a system, for either loop in C."""

import ctypes
import functools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.transfers import TransferCall, range_of
from orchestration.foundation.basics.c_structures import address, constants, declared
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.simulation.engines.running_system import RunningSystem, SampledComponent
from orchestration.simulation.engines.sources import Feed
from orchestration.simulation.engines.wiring_by_index import Wires, of_each

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


class RunStructures(SystemStructures):
    """The structures of one run, whose components are called in this process."""

    def __init__(self, running: RunningSystem) -> None:
        super().__init__(running.wires, 1)
        self._running = running
        simulators = cast(Mapping[str, NativeInstance], running.simulators)
        self.instances = [simulators[name] for name in running.wires.names]
        self.calls: dict[int, tuple[str, Transfer]] = {}
        """Name of the function and transfer of a `Part`, by its address"""
        self.feeds = self.table(ONE_LANE.Feed, map(self._feed, running.feeds))
        self.channels = self.table(ONE_LANE.Channel, map(self._channel, range(len(running.channels))))
        self.components = self.table(ONE_LANE.Component, map(self._component, range(len(self.instances))))

    def _feed(self, feed: Feed) -> Any:
        receiver = self._wires.names.index(feed.component)
        return ONE_LANE.Feed(write=self._transfer(receiver, feed.transfer, feed.into), size=feed.size)

    def _channel(self, index: int) -> Any:
        """A connection, without messages in flight."""
        running, x = self._running, self._wires.system.connections[index]
        channel, places = running.channels[index], [running.board.place[start] for start in x.start]
        return self.channel(
            index,
            write=self._transfer(self._wires.names.index(x.receiver), channel.write, channel.received),
            sender=self.address(running.board.row),
            places=self.address(np.array(places, dtype=np.int64)),
            sigma=self.address(of_each(x, x.noise)),
            quantum=self.address(of_each(x, x.quantisation)),
            scale=self.address(np.array([x.scale])),
            offset=self.address(np.array([x.offset])),
            value=self.address(np.zeros(len(places))),
        )

    def _component(self, index: int) -> Any:
        running, instance, component = self._running, self.instances[index], self._running.component(index)
        outputs = running.outputs(self._wires.names[index])
        event, ends, early, reached = [ctypes.addressof(each) for each in instance.step_outputs] or [0, 0, 0, 0]
        return self.component(
            index,
            fmu=instance.handle,
            step=instance.address(instance.step_name),
            start_time=instance.start_time,
            version=3 if instance.step_outputs else 2,
            foreign=instance.guard is not None,
            messages_waiting=ctypes.addressof(instance.messages_waiting),
            read=self._transfer(index, component.read, outputs),
            outputs=self.address(outputs),
            connected=len(component.outputs),
            event=event,
            ends=ends,
            early=early,
            reached=reached,
            feeds=self.indices([running.feeds.index(feed) for feed in component.feeds]),
            ratio=self.address(np.array([component.ratio])) if isinstance(component, SampledComponent) else None,
        )

    def _transfer(self, component: int, transfer: Transfer, array: Floats) -> Any:
        """The calls of a transfer between a component and an array."""
        calls = self.instances[component].calls_of(transfer)
        parts = self.table(ONE_LANE.Part, (self._part(component, call) for call in calls))
        for part, call in zip(parts, calls):
            self.calls[ctypes.addressof(part)] = (call.function, transfer)
        return ONE_LANE.Transfer(parts=ctypes.addressof(parts), count=len(calls), array=self.address(array))

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
