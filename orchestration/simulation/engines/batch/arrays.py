"""The numbers of a batch, which Python and C share; the last axis of an array is that of the SIMD lanes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.c_structures import address
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.simulation.engines.batch.shape import Shape

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
