"""The numbers of a batch, which Python and C share; the last axis of an array is that of the SIMD lanes."""

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.c_structures import address
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.structures import SystemStructures

_ALIGNED = 64
"""Size of the largest vector registers and of cache lines [byte]"""


def aligned(*shape: int) -> Floats:
    """Zeros at an address for vector registers."""
    count = math.prod(shape)
    whole: Floats = np.zeros(count + _ALIGNED // 8)
    first = (-address(whole) // 8) % (_ALIGNED // 8)
    return whole[first : first + count].reshape(shape)


@dataclass(frozen=True, kw_only=True)
class ChannelArrays:
    """The numbers of a connection; those of a message have a row for each of its variables."""

    sigma: Floats
    quantum: Floats
    scale: Floats
    offset: Floats
    value: Floats
    """Message that is being passed on"""
    applied: Floats
    """Last two messages that were applied, for a first-order hold"""


@dataclass(frozen=True, kw_only=True)
class BatchArrays:
    """The numbers of the runs of a batch."""

    memories: Sequence[Floats]
    """Memory of each component, shape (places, lanes)"""
    wanted: Sequence[Booleans]
    """Whether each variable of a component is read, by what runs have in common or by the current ones"""
    ratios: Sequence[Floats]
    """Rate of the own time of each component"""
    channels: Sequence[ChannelArrays]
    moving: Integers
    """Components that are stepped to an instant, of each track"""
    seen: Floats
    """Values of sources that expressions read"""
    given: Floats
    """Values of sources that inputs get"""
    state: Floats
    """States of the expressions, which change from row to row"""
    constants: Floats
    """Values of expressions that are the same in all of a run"""
    numbers: Floats
    """Parameters, the stop time and reductions inside others that expressions name"""
    reductions: Floats
    """Values of the reductions at the end"""
    status: npt.NDArray[np.int32]
    """Result of a step of a component, by lane"""

    @classmethod
    def of(cls, shape: Shape) -> "BatchArrays":
        """Arrays for the runs of a shape; raises `UsageError` naming a component that has no code for lanes."""

        def rows(count: int) -> Floats:
            return aligned(max(count, 1), shape.lanes)

        writer, sizes = shape.expressions.folds.writer, [len(x.start) for x in shape.system.connections]
        return cls(
            memories=[rows(kernel.places) for kernel in shape.kernels.values()],
            wanted=[shape.read(name) for name in shape.names],
            ratios=[rows(1) for _ in shape.names],
            channels=[
                ChannelArrays(sigma=rows(size), quantum=rows(size), scale=rows(1), offset=rows(1),
                              value=rows(size), applied=rows(2 * size))
                for size in sizes
            ],
            moving=np.zeros((shape.lanes, len(shape.wires.continuous)), dtype=np.int64),
            seen=rows(shape.seen_count), given=rows(shape.given_count),
            state=rows(len(writer.states)), constants=rows(len(writer.constants)),
            numbers=rows(len(shape.numbers) + 1 + len(shape.inner)),
            reductions=rows(len(shape.expressions.folds.values)),
            status=np.zeros(shape.lanes, dtype=np.int32),
        )  # fmt: skip


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
