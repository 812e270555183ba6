"""Confidence intervals and tests of shares, quantiles and means."""

import math
from collections.abc import Iterable, Sequence
from statistics import NormalDist, fmean
from typing import NamedTuple

from orchestration.foundation.basics.errors import UsageError


def wilson(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval for a share of which `successes` in `trials` were seen, as (low, high).

    Two-sided: the share lies below `low` and above `high` with (1 - confidence)/2 each. It stays in [0, 1]
    and has a width at 0 and at `trials` successes too. Raises `UsageError` for invalid numbers.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise UsageError(f"{successes} of {trials}: expected at least one trial and no more successes than trials")
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"confidence {confidence}: expected a number between 0 and 1")
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    share = successes / trials
    middle = share + z * z / (2.0 * trials)
    half = z * math.sqrt(share * (1.0 - share) / trials + z * z / (4.0 * trials * trials))
    scale = 1.0 + z * z / trials
    # At the ends the bound is exactly 0 or 1; rounding may miss it.
    low = 0.0 if successes == 0 else (middle - half) / scale
    high = 1.0 if successes == trials else (middle + half) / scale
    return low, high


def pair_correlation(both: int, only_one: int, only_other: int, neither: int) -> float:
    """The correlation of successes in pairs, from the numbers of pairs, corrected for continuity as Newcombe's.

    Newcombe, Statistics in Medicine 17 (1998) 2635-2650, method 10. It is 0 where one of both never varies.
    """
    one, other = (both + only_one, only_other + neither), (both + only_other, only_one + neither)
    product, spread = float(both * neither - only_one * only_other), math.prod(one + other)
    if product > 0.0:
        product = max(product - 0.5 * sum(one), 0.0)
    return product / math.sqrt(spread) if spread else 0.0


class Estimate(NamedTuple):
    """An estimated quantile, mean or share."""

    value: float
    low: float
    high: float
    """ends of its interval; infinite where there are too few values to bound it"""
    confidence: float
    """Confidence of the interval: at least the requested one, since it ends at observed values"""


def quantile(values: Sequence[float], share: float = 0.5, confidence: float = 0.95) -> Estimate:
    """A quantile, by default the median, with the interval between two order statistics.

    Distribution-free: of n values the number below the quantile is binomial. The ends are the innermost values
    beyond each of which the quantile lies with a probability of at most (1 - confidence)/2. Raises `UsageError` for
    no values or an invalid share.
    """
    if not len(values) or not (0.0 < share < 1.0 and 0.0 < confidence < 1.0):
        raise UsageError(f"quantile {share} of {len(values)} values: expected some, and shares between 0 and 1")
    ordered, n, tail = sorted(map(float, values)), len(values), 0.5 * (1.0 - confidence)
    below = above = 0.0
    first, last = -1, n
    while first + 1 < n and below + _binomial(first + 1, n, share) <= tail:
        first += 1
        below += _binomial(first, n, share)
    while last > 0 and above + _binomial(last, n, share) <= tail:
        above += _binomial(last, n, share)
        last -= 1
    place = share * (n - 1)
    lower, upper = ordered[math.floor(place)], ordered[math.ceil(place)]
    middle = lower if lower == upper else lower + (place - math.floor(place)) * (upper - lower)
    return Estimate(
        value=middle,
        low=ordered[first] if first >= 0 else -math.inf,
        high=ordered[last] if last < n else math.inf,
        confidence=1.0 - below - above,
    )


def mean(values: Sequence[float], confidence: float = 0.95) -> Estimate:
    """The mean, with Student's t interval, which is infinite of a single value; raises `UsageError` for no values."""
    from scipy.special import stdtrit

    if not len(values):
        raise UsageError("mean of 0 values: expected some")
    middle, n = fmean(values), len(values)
    apart = math.fsum((value - middle) ** 2 for value in values)
    half = float(stdtrit(n - 1, 0.5 + 0.5 * confidence)) * math.sqrt(apart / (n - 1) / n) if n > 1 else math.inf
    return Estimate(value=middle, low=middle - half, high=middle + half, confidence=confidence)


def _binomial(k: int, n: int, share: float) -> float:
    """The probability of k successes in n."""
    combinations = math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
    return math.exp(combinations + k * math.log(share) + (n - k) * math.log(1.0 - share))


def refutes(successes: int, trials: int, share: float, confidence: float) -> bool:
    """Whether `successes` in `trials` refute a success rate of `share`, by the exact binomial test at `confidence`.

    That is, at this rate so few or fewer would be observed with a probability of at most 1 - confidence.
    """
    tail = sum(_binomial(k, trials, share) for k in range(successes + 1))
    return tail <= 1.0 - confidence


def first_end(values: Iterable[float], holds: Iterable[bool]) -> float | None:
    """The last of rising `values` before the first at which `holds` is false; None if that is the first value."""
    end = None
    for value, here in zip(values, holds):
        if not here:
            break
        end = value
    return end
