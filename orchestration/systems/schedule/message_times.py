"""Random lateness of instants and messages, and random losses."""

import math
from collections.abc import Callable

import numpy as np

from orchestration.foundation.basics.simulator import Booleans
from orchestration.foundation.basics.times import nanoseconds
from orchestration.systems.computers.parts import Constant
from orchestration.systems.schedule.drawing import Lateness, Stream, in_order, index_from, times
from orchestration.systems.schedule.streams import cut_normal
from orchestration.systems.system.distribution import Distribution, Varying

Losses = Callable[[int], Booleans]
"""Whether each of the next `count` messages is lost"""


def lateness(jitter: Varying, spread: str, stream: Stream) -> Lateness:
    """The stream of latenesses [ns], up to a largest one or of a distribution; nothing is drawn if that is 0."""
    if isinstance(jitter, Distribution):
        return times(jitter, stream)
    largest = nanoseconds(jitter)
    if largest == 0:
        return Constant(0)
    draw = stream().random
    if spread == "normal":
        return lambda count: np.array([math.floor(cut_normal(u) * largest) for u in draw(count).tolist()], np.int64)
    return lambda count: np.floor(draw(count) * largest).astype(np.int64)


def losses(probability: Varying, burst_length: float | None, stream: Stream) -> Losses:
    """The stream of losses, independent or in bursts of a mean length (Gilbert-Elliott), or of values 0 and 1.

    Nothing is drawn for the probability 0.
    """
    if isinstance(probability, Distribution):
        return _recorded_losses(probability, stream)
    if probability == 0.0:
        return lambda count: np.zeros(count, dtype=np.bool_)
    draw = stream().random
    if burst_length is None or probability == 1.0:
        return lambda count: draw(count) < probability
    to_end, to_begin = 1.0 / burst_length, probability / (burst_length * (1.0 - probability))
    in_burst: bool | None = None

    def lost(share: float) -> bool:
        nonlocal in_burst
        stationary = in_burst is None  # the chain starts in its stationary distribution
        in_burst = share < probability if stationary else share >= to_end if in_burst else share < to_begin
        return in_burst

    return lambda count: np.array([lost(share) for share in draw(count).tolist()], dtype=np.bool_)


def _recorded_losses(of: Distribution, stream: Stream) -> Losses:
    lost = of.table() != 0.0
    if of.order == "as recorded":
        return in_order(lost)
    draw, index = stream().random, index_from(of)
    return lambda count: lost[index(draw(count))]
