"""What is left to chance about one instant or one message: how late it is, and whether it is lost."""

import math
from collections.abc import Callable

import numpy as np

from orchestration.master.streams import cut_normal

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
