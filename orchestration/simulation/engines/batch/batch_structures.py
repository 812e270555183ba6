"""A batch as the structures of batch.c."""

import ctypes
from dataclasses import fields
from typing import Any

from orchestration.foundation.basics.c_structures import address
from orchestration.simulation.engines.batch.arrays import BatchArrays
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.structures import SystemStructures


class BatchStructures(SystemStructures):
    """The structures of a batch whose numbers are in `arrays`."""

    def __init__(self, shape: Shape, arrays: BatchArrays) -> None:
        super().__init__(shape.wires, shape.lanes)
        self._shape, self._arrays, c = shape, arrays, self.types
        self.channels = self.table(c.Channel, map(self._channel, range(len(shape.ends))))
        self.components = self.table(c.Component, map(self._component, range(len(shape.names))))
        self.tracks = self.table(c.Track, (c.Track(moving=address(each)) for each in arrays.moving))
        settles = any(x.held.count or x.behind.count or x.fed_count for x in self.components)
        kept = self.table(c.Kept, [c.Kept()] * len(shape.expressions.folds.kept))
        self.loop = c.Loop()
        self.fill(
            self.loop, components=self.components, channels=self.channels, tracks=self.tracks, settles=settles,
            stays=not (settles or any(x.ahead.count for x in self.components)),  # a source that jumps is fed
            seen_count=shape.seen_count, given_count=shape.given_count, kept=ctypes.addressof(kept),
            **{name: address(getattr(arrays, name))
               for name in ("seen", "given", "state", "constants", "numbers", "status")},
        )  # fmt: skip

    def _channel(self, index: int) -> Any:
        shape, x, ends = self._shape, self._shape.system.connections[index], self._shape.ends[index]
        sender, receiver = (self._arrays.memories[shape.names.index(name)] for name in (x.sender, x.receiver))
        plain, arrays = not x.converts and x.hold == "zero", self._arrays.channels[index]
        into = self.types.Inputs(
            memory=address(receiver), places=self.address(ends.end), kinds=self.address(ends.kinds),
            low=self.address(ends.low), high=self.address(ends.high),
            plain=plain, as_they_are=plain and not ends.kinds.any(),
        )  # fmt: skip
        numbers = {each.name: address(getattr(arrays, each.name)) for each in fields(arrays)}
        return self.channel(index, sender=address(sender), places=self.address(ends.start), into=into, **numbers)

    def _component(self, index: int) -> Any:
        shape, arrays, c, name = self._shape, self._arrays, self.types, self._shape.names[index]
        kernel = shape.kernels[name]
        changing = shape.fed[name] if shape.given_count else []
        fed = self.table(c.Fed, (c.Fed(source=source, place=place) for source, place in changing))
        return self.component(
            index, step=kernel.step, steps=kernel.steps, memory=address(arrays.memories[index]),
            places=self.address(shape.connected[name]), connected=len(shape.connected[name]),
            wanted=address(arrays.wanted[index]), ratio=address(arrays.ratios[index]),
            fed=ctypes.addressof(fed), fed_count=len(fed),
        )  # fmt: skip
