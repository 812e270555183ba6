"""Search for the first value that fails: a scan upward, then bisection."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

Fails = Callable[[float], bool]
ReportRemaining = Callable[[int], None]
"""Called before each trial with the largest number of trials that can follow it."""


class Bracket(NamedTuple):
    """Two values between which the edge of failure lies."""

    good: float | None
    """does not fail; None: the first value of the scan fails"""
    bad: float
    """fails"""


@dataclass(frozen=True, kw_only=True)
class Range:
    """How a quantity is scanned: `before`, then from `first` in steps to `last`; then bisected to `tolerance`."""

    before: tuple[float, ...] = ()
    first: float
    step: float
    last: float
    tolerance: float
    unit: str = " s"

    def values(self) -> list[float]:
        """The values of the scan, in rising order."""
        count = math.floor((self.last - self.first) / self.step + 1e-9)
        steps = (float(f"{self.first + i * self.step:.12g}") for i in range(count + 1))
        return [*(value for value in self.before if value < self.first), *steps]


def first_failure(
    fails: Fails,
    values: Sequence[float],
    tolerance: float,
    *,
    parts: int = 1,
    remaining: ReportRemaining = lambda most: None,
) -> Bracket | None:
    """The last value that does not fail and the first that does, at most `tolerance` apart; None if none fails.

    Scans `values` upward, then `parts` of the step before the first that fails, and bisects. The set of values that
    do not fail need not be an interval: gaps narrower than these steps are not seen.
    """
    good = None
    widest = max((b - a for a, b in pairwise(values)), default=0.0)
    for i, value in enumerate(values, start=1):
        remaining(len(values) - i + _most_trials(widest, tolerance, parts))
        if not fails(value):
            good = value
            continue
        if good is None:
            return Bracket(None, value)
        low, step, bad = good, (value - good) / parts, value
        if step >= tolerance:
            for i in range(1, parts):
                finer = float(f"{low + i * step:.12g}")
                remaining(parts - 1 - i + _halvings(step, tolerance))
                if fails(finer):
                    bad = finer
                    break
                good = finer
        return bisected(fails, good, bad, tolerance, remaining=remaining)
    return None


def bisected(
    fails: Fails, good: float, bad: float, tolerance: float, *, remaining: ReportRemaining = lambda most: None
) -> Bracket:
    """Bisect between `good`, which does not fail, and `bad`, which does, down to `tolerance`."""
    while bad - good > tolerance:
        middle = 0.5 * (good + bad)
        remaining(_halvings(middle - good, tolerance))
        if fails(middle):
            bad = middle
        else:
            good = middle
    return Bracket(good, bad)


def _most_trials(width: float, tolerance: float, parts: int) -> int:
    """The largest number of trials in an interval of this width whose upper end fails."""
    if width / parts < tolerance:
        return _halvings(width, tolerance)
    return parts - 1 + _halvings(width / parts, tolerance)


def _halvings(width: float, tolerance: float) -> int:
    return max(0, math.ceil(math.log2(width / tolerance))) if width > 0.0 else 0
