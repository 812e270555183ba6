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
DECADE = 10.0
"""Ratio of the ends of a range from which on its values are by equal factors"""

ROUNDING = 1e-9
"""Share of a tolerance that is not a difference of two values, but rounding"""

Fails = Callable[[float], bool]
ReportRemaining = Callable[[int], None]
"""Called before each trial with the largest number of trials that can follow it."""


def is_wide(first: float, last: float) -> bool:
    """Whether the ends of a range are of one sign, and more than a decade apart."""
    return first * last > 0.0 and not 1.0 / DECADE <= last / first <= DECADE


def step_in_words(step: float, unit: str | None, *, geometric: bool) -> str:
    """The step of a scan: a factor, or a difference in its unit."""
    return f"a factor of {step:.2g}" if geometric else quantity(step, unit, DIGITS)


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
    """How a quantity is scanned: `before`, then from `first` in steps to `last`; then bisected to `tolerance`.

    Of a `geometric` one, whose ends are of one sign, `step` is a factor above 1 and `tolerance` a share of the value.
    """

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
    geometric: bool = False

    def text(self, value: float) -> str:
        """A value of the quantity in its unit."""
        return quantity(value, self.unit, DIGITS)

    @property
    def step_text(self) -> str:
        """The step of the scan, in words."""
        return step_in_words(self.step, self.unit, geometric=self.geometric)

    def tolerance_at(self, value: float) -> float:
        """The tolerance at a value of the quantity, in its unit."""
        return self.tolerance * abs(value) if self.geometric else self.tolerance

    def _steps(self) -> list[float]:
        if self.geometric:
            count = round(_apart(self.first, self.last, geometric=True) / math.log(self.step))
            between = (self.first * (self.last / self.first) ** (i / count) for i in range(1, count))
            return [self.first, *(float(f"{value:.3g}") for value in between), self.last]
        count = math.floor((self.last - self.first) / self.step + 1e-9)
        steps = [float(f"{self.first + i * self.step:.12g}") for i in range(count + 1)]
        if self.last - steps[-1] > self.tolerance:  # the last step is shorter
            steps.append(self.last)
        return steps

    def values(self) -> list[float]:
        """The values of the scan, in rising order, the last one included."""
        steps = self._steps()
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
    geometric: bool = False,
    parts: int = 1,
    remaining: ReportRemaining = lambda most: None,
) -> Ends:
    """The ends of the values that do not fail around `own`, by `first_failure` in both directions.

    Without `own`, or where that fails, the search goes up from the first of `values`, and there is no lower end.
    """
    once = cache(fails)

    def most_trials(values: Sequence[float]) -> int:
        return _most_trials(_widest(values, geometric=geometric), tolerance, parts)

    def search(fails: Fails, values: Sequence[float], remaining: ReportRemaining) -> Bracket | None:
        return first_failure(fails, values, tolerance, geometric=geometric, parts=parts, remaining=remaining)

    remaining(len(values) + 2 * most_trials(values))
    if own is None or once(own):
        return Ends(None, search(once, values, remaining))
    above = [own, *(value for value in values if value > own)]
    below = [-own, *(-value for value in reversed(values) if value < own)]
    down = len(below) + most_trials(below)
    upper = search(once, above, lambda most: remaining(most + down))
    lower = search(lambda value: once(-value), below, remaining)
    return Ends(None if lower is None or lower.good is None else Bracket(-lower.good, -lower.bad), upper)


def first_failure(
    fails: Fails,
    values: Sequence[float],
    tolerance: float,
    *,
    geometric: bool = False,
    parts: int = 1,
    remaining: ReportRemaining = lambda most: None,
) -> Bracket | None:
    """The last value that does not fail and the first that does, at most `tolerance` apart; None if none fails.

    Scans `values` upward, then `parts` of the step before the first that fails, and bisects. The set of values that
    do not fail need not be an interval: gaps narrower than these steps are not seen. `geometric`: by equal factors,
    and to a share of the value.
    """
    good = None
    widest = _widest(values, geometric=geometric)
    for i, value in enumerate(values, start=1):
        remaining(len(values) - i + _most_trials(widest, tolerance, parts))
        if not fails(value):
            good = value
            continue
        if good is None:
            return Bracket(None, value)
        low, bad = good, value
        width = _apart(low, value, geometric=geometric) / parts
        if width >= (1.0 - ROUNDING) * tolerance:
            for i in range(1, parts):
                part = low * (value / low) ** (i / parts) if geometric else low + i * ((value - low) / parts)
                finer = float(f"{part:.12g}")
                remaining(parts - 1 - i + _halvings(width, tolerance))
                if fails(finer):
                    bad = finer
                    break
                good = finer
        return bisected(fails, good, bad, tolerance, geometric=geometric, remaining=remaining)
    return None


def bisected(
    fails: Fails,
    good: float,
    bad: float,
    tolerance: float,
    *,
    geometric: bool = False,
    remaining: ReportRemaining = lambda most: None,
) -> Bracket:
    """Bisect between `good`, which does not fail, and `bad`, which does, down to `tolerance`."""
    while _apart(good, bad, geometric=geometric) > tolerance:
        middle = math.copysign(math.sqrt(good * bad), bad) if geometric else 0.5 * (good + bad)
        remaining(_halvings(_apart(good, middle, geometric=geometric), tolerance))
        if fails(middle):
            bad = middle
        else:
            good = middle
    return Bracket(good, bad)


def _apart(a: float, b: float, *, geometric: bool) -> float:
    """How far a value is above another: the difference, or the size of the logarithm of their ratio."""
    return abs(math.log(b / a)) if geometric else b - a


def _widest(values: Sequence[float], *, geometric: bool) -> float:
    return max((_apart(a, b, geometric=geometric) for a, b in pairwise(values)), default=0.0)


def _most_trials(width: float, tolerance: float, parts: int) -> int:
    """The largest number of trials in an interval of this width whose upper end fails."""
    if width / parts < tolerance:
        return _halvings(width, tolerance)
    return parts - 1 + _halvings(width / parts, tolerance)


def _halvings(width: float, tolerance: float) -> int:
    return max(0, math.ceil(math.log2(width / tolerance))) if width > 0.0 else 0
