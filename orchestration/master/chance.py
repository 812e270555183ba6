"""What is left to chance about one instant or one message: how late it is, and whether it is lost."""

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from orchestration.master.streams import cut_normal

Integers: TypeAlias = npt.NDArray[np.int64]
Flags: TypeAlias = npt.NDArray[np.bool_]

Lateness = Callable[[], int]
"""The next random lateness [ns]"""
Stream = Callable[[], np.random.Generator]
"""Gives the generator; called only if something is drawn"""
Losses = Callable[[], bool]
"""Whether the next message is lost"""


def lateness(largest: int, distribution: str, stream: Stream) -> Lateness | None:
    """Latenesses in [0, `largest`] ns; None if that is 0."""
    if largest == 0:
        return None
    draw = stream().random
    if distribution == "normal":
        return lambda: math.floor(cut_normal(draw()) * largest)
    return lambda: math.floor(draw() * largest)


def losses(probability: float, burst_length: float | None, stream: Stream) -> Losses | None:
    """Losses, independent or in bursts of a mean length (Gilbert-Elliott); None if nothing is ever lost."""
    if probability == 0.0:
        return None
    draw = stream().random
    if burst_length is None or probability == 1.0:
        return lambda: draw() < probability
    to_end, to_begin = 1.0 / burst_length, probability / (burst_length * (1.0 - probability))
    in_burst: bool | None = None

    def lost() -> bool:
        nonlocal in_burst
        share = draw()
        stationary = in_burst is None  # the chain starts in its stationary distribution
        in_burst = share < probability if stationary else share >= to_end if in_burst else share < to_begin
        return in_burst

    return lost


# -- the same numbers, many at a time ---------------------------------------------------------------------------------

Latenesses = Callable[[int], Integers]
"""The next so many latenesses [ns]"""
LossesOfMany = Callable[[int], Flags]
"""Whether the next so many messages are lost"""


def latenesses(largest: int, distribution: str, stream: Stream) -> Latenesses:
    """As `lateness`; zeros without it."""
    if largest == 0:
        return lambda count: np.zeros(count, dtype=np.int64)
    draw = stream().random
    if distribution == "normal":
        return lambda count: np.array(
            [math.floor(cut_normal(uniform) * largest) for uniform in draw(count).tolist()], dtype=np.int64
        )
    return lambda count: np.floor(draw(count) * largest).astype(np.int64)


def losses_of_many(probability: float, burst_length: float | None, stream: Stream) -> LossesOfMany:
    """As `losses`; none without it."""
    lost = losses(probability, burst_length, stream)
    if lost is None:
        return lambda count: np.zeros(count, dtype=np.bool_)
    if burst_length is None or probability == 1.0:
        draw = stream().random
        return lambda count: draw(count) < probability
    return lambda count: np.array([lost() for _ in range(count)], dtype=np.bool_)
