"""Streams of times, lateness and losses, from numbers, distributions and traces; nothing is drawn for what is fixed."""

import math
from collections.abc import Callable
from itertools import accumulate
from statistics import NormalDist
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.foundation.basics.times import NANOSECONDS, Constant, nanoseconds
from orchestration.systems.schedule.streams import cut_normal
from orchestration.systems.system.choices import Spread
from orchestration.systems.system.distribution import Distribution, Varying

Stream = Callable[[], np.random.Generator]
"""Returns the generator; called only if something is drawn"""
Lateness = Callable[[int], Integers]
"""The next `count` times [ns]"""

_AWAY = 1e-3
"""Distance from a half [ns] beyond which a product of doubles is rounded as its decimal number"""
_BELOW_1 = math.nextafter(1.0, 0.0)

Values = TypeVar("Values", bound=np.generic)


def times(of: Varying, stream: Stream) -> Lateness:
    """The stream of times [ns] of a constant number or a distribution. Nothing is drawn for what is not random.

    Raises `UsageError` for a trace that cannot be read.
    """
    if not isinstance(of, Distribution):
        return Constant(nanoseconds(of))
    if of.order == "as recorded":
        return in_order(whole(of.table()))
    draw, value = stream().random, times_from(of)
    return lambda count: value(draw(count))


def times_from(of: Distribution) -> Callable[[Floats], Integers]:
    """The function from numbers u in [0, 1) to times [ns]; it increases, but for a table."""
    if of.uniform is not None:
        least, most = map(nanoseconds, of.uniform)
        return lambda u: least + (u * (most - least)).astype(np.int64)
    if of.normal is not None:
        return _cut_normal(of)
    values, index = whole(of.table()), index_from(of)
    return lambda u: values[index(u)]


def index_from(of: Distribution) -> Callable[[Floats], Integers]:
    """The function from numbers u in [0, 1) to indices of the table of a distribution."""
    if of.probabilities is None:
        count = len(of.table())
        return lambda u: np.floor(u * count).astype(np.int64)
    sums = np.array([*accumulate(of.probabilities)])
    last = max(i for i, share in enumerate(of.probabilities) if share > 0.0)
    return lambda u: np.minimum(np.searchsorted(sums, u, side="right"), last)


def in_order(values: npt.NDArray[Values]) -> Callable[[int], npt.NDArray[Values]]:
    """The stream of these values in order, beginning anew after the last."""
    past = 0

    def following(count: int) -> npt.NDArray[Values]:
        nonlocal past
        past += count
        return values[np.arange(past - count, past) % len(values)]

    return following


def _cut_normal(of: Distribution) -> Callable[[Floats], Integers]:
    assert of.normal is not None
    assert of.range is not None
    mean, deviation = of.normal
    low, high = map(of.share, of.range)
    least, most = map(nanoseconds, of.range)
    standard = NormalDist()

    def value(u: float) -> int:
        share = min(max(low + u * (high - low), math.ulp(0.0)), _BELOW_1)
        return min(max(math.floor((mean + deviation * standard.inv_cdf(share)) * NANOSECONDS), least), most)

    return lambda u: np.array([value(each) for each in u.tolist()], dtype=np.int64)


def whole(seconds: Floats) -> Integers:
    """Times in nanoseconds, rounded as `nanoseconds` does."""
    about = seconds * NANOSECONDS
    result = np.rint(about).astype(np.int64)
    for i in np.flatnonzero(np.abs(about - np.floor(about) - 0.5) < np.maximum(_AWAY, about * 1e-15)).tolist():
        result[i] = nanoseconds(float(seconds[i]))
    return result


Losses = Callable[[int], Booleans]
"""Whether each of the next `count` messages is lost"""


def lateness(jitter: Varying, spread: Spread, stream: Stream) -> Lateness:
    """The stream of latenesses [ns], up to a largest one or of a distribution; nothing is drawn if that is 0."""
    if isinstance(jitter, Distribution):
        return times(jitter, stream)
    largest = nanoseconds(jitter)
    if largest == 0:
        return Constant(0)
    draw = stream().random
    match spread:
        case "normal":
            return lambda count: np.array([math.floor(cut_normal(u) * largest) for u in draw(count).tolist()], np.int64)
        case "uniform":
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
