"""Search for the first value that fails, or for both ends of the good values: a scan, then bisection."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import NamedTuple

from orchestration.foundation.basics.unit_algebra import quantity

DIGITS = 6
"""Significant digits of a value in a sentence"""

ROUNDING = 1e-9
"""Share of a tolerance that is not a difference of two values, but rounding"""

Fails = Callable[[float], bool]
ReportRemaining = Callable[[int], None]
"""Called before each trial with the largest number of trials that can follow it."""


class Bracket(NamedTuple):
    """Two values between which the edge of failure lies."""

    good: float | None
    """does not fail; None: the first value of the scan fails"""
    bad: float
    """fails"""


class Ends(NamedTuple):
    """The ends of the values that do not fail; None: no value fails there."""

    lower: Bracket | None
    upper: Bracket | None


@dataclass(frozen=True, kw_only=True)
class Range:
    """How a quantity is scanned: `before`, then from `first` in steps to `last`; then bisected to `tolerance`."""

    own: float | None = None
    """the value that the system itself has, from which the search goes up and down; None: it goes up from the first"""
    before: tuple[float, ...] = ()
    also: tuple[float, ...] = ()
    """further values, as those at which runs fail, near which small deviations may grow"""
    first: float
    step: float
    last: float
    tolerance: float
    unit: str | None = "s"

    def text(self, value: float) -> str:
        """A value of the quantity in its unit."""
        return quantity(value, self.unit, DIGITS)

    def values(self) -> list[float]:
        """The values of the scan, in rising order, the last one included."""
        count = math.floor((self.last - self.first) / self.step + 1e-9)
        steps = [float(f"{self.first + i * self.step:.12g}") for i in range(count + 1)]
        if self.last - steps[-1] > self.tolerance:  # the last step is shorter
            steps.append(self.last)
        values = sorted({*(value for value in self.before if value < self.first), *steps, *self.also})
        if self.own is None:
            return values
        return sorted([self.own, *(value for value in values if not math.isclose(value, self.own))])


def ends_of_good(
    fails: Fails,
    values: Sequence[float],
    own: float | None,
    tolerance: float,
    *,
    parts: int = 1,
    remaining: ReportRemaining = lambda most: None,
) -> Ends:
    """The ends of the values that do not fail around `own`, by `first_failure` in both directions.

    Without `own`, or where that fails, the search goes up from the first of `values`, and there is no lower end.
    """
    once = cache(fails)
    most = len(values) + 2 * _most_trials(_widest(values), tolerance, parts)
    remaining(most)
    if own is None or once(own):
        return Ends(None, first_failure(once, values, tolerance, parts=parts, remaining=remaining))
    above = [own, *(value for value in values if value > own)]
    below = [-own, *(-value for value in reversed(values) if value < own)]
    down = len(below) + _most_trials(_widest(below), tolerance, parts)
    upper = first_failure(once, above, tolerance, parts=parts, remaining=lambda most: remaining(most + down))
    lower = first_failure(lambda value: once(-value), below, tolerance, parts=parts, remaining=remaining)
    return Ends(None if lower is None or lower.good is None else Bracket(-lower.good, -lower.bad), upper)


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
    widest = _widest(values)
    for i, value in enumerate(values, start=1):
        remaining(len(values) - i + _most_trials(widest, tolerance, parts))
        if not fails(value):
            good = value
            continue
        if good is None:
            return Bracket(None, value)
        low, step, bad = good, (value - good) / parts, value
        if step >= (1.0 - ROUNDING) * tolerance:
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


def _widest(values: Sequence[float]) -> float:
    return max((b - a for a, b in pairwise(values)), default=0.0)


def _most_trials(width: float, tolerance: float, parts: int) -> int:
    """The largest number of trials in an interval of this width whose upper end fails."""
    if width / parts < tolerance:
        return _halvings(width, tolerance)
    return parts - 1 + _halvings(width / parts, tolerance)


def _halvings(width: float, tolerance: float) -> int:
    return max(0, math.ceil(math.log2(width / tolerance))) if width > 0.0 else 0
