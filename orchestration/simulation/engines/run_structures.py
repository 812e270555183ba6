"""Components, connections and sources as structures of loop.c; keeps alive everything that C has an address of."""

import ctypes
from collections.abc import Sequence
from typing import Any

import numpy as np

from orchestration.components.fmi.native import NativeInstance
from orchestration.components.fmi.transfers import TransferCall, range_of
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.simulation.engines.channel import Channel, of_each
from orchestration.simulation.engines.feeds import Feed
from orchestration.simulation.engines.structures import ONE_LANE, address
from orchestration.systems.system.connection import Connection


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
