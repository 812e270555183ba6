"""A running system as the structures of loop.c, and the Python transfer of each call of an FMU."""

import ctypes
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from orchestration.components.fmi.native_instance import NativeInstance
from orchestration.components.fmi.transfers import TransferCall, range_of
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.simulation.engines.connection_hold import of_each
from orchestration.simulation.engines.feeds import Feed
from orchestration.simulation.engines.running_system import RunningSystem, SampledComponent
from orchestration.simulation.engines.structures import ONE_LANE, SystemStructures


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
