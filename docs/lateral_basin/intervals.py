"""Arrays of intervals: a result contains the exact results for all values in its arguments.

Sums, products, quotients and roots of floats are exact to half a unit in the last place; every bound is then moved
outward by at least one unit. For tanh, sine, cosine and powers numpy gives no such guarantee: they are assumed to be
exact to `FUNCTIONS`, 64 units in the last place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Floats

ROUNDING = 2.0**-52
"""relative: a unit in the last place or more"""
TINY = 1e-300
"""absolute, added to it: small products may have fewer digits"""
FUNCTIONS = 2.0**-46
"""relative, of tanh, sine, cosine and powers"""


class Intervals:
    """Arrays of bounds; operations are elementwise and broadcast."""

    __slots__ = ("high", "low")

    def __init__(self, low: Floats, high: Floats) -> None:
        self.low, self.high = low, high

    @classmethod
    def of(cls, numbers: Floats) -> Intervals:
        """Intervals of single numbers."""
        return cls(numbers, numbers)

    @classmethod
    def joined(cls, *parts: Intervals) -> Intervals:
        """The parts concatenated along the first axis."""
        return cls(np.concatenate([part.low for part in parts]), np.concatenate([part.high for part in parts]))

    @classmethod
    def symmetric(cls, size: Floats) -> Intervals:
        """The numbers no larger than `size`."""
        return cls(-size, size)

    @property
    def size(self) -> Floats:
        """The largest absolute value in each."""
        return np.maximum(-self.low, self.high)

    @property
    def least_size(self) -> Floats:
        """The smallest absolute value in each."""
        return np.maximum(np.maximum(self.low, -self.high), 0.0)

    def __getitem__(self, index: Any) -> Intervals:
        return Intervals(self.low[index], self.high[index])

    def __neg__(self) -> Intervals:
        return Intervals(-self.high, -self.low)

    def __add__(self, other: Intervals | float) -> Intervals:
        if isinstance(other, Intervals):
            return _outward(self.low + other.low, self.high + other.high)
        return _outward(self.low + other, self.high + other)

    def __sub__(self, other: Intervals) -> Intervals:
        return _outward(self.low - other.high, self.high - other.low)

    def __mul__(self, other: Intervals | float) -> Intervals:
        if isinstance(other, Intervals):
            a, b = self.low * other.low, self.low * other.high
            c, d = self.high * other.low, self.high * other.high
            return _outward(_least(_least(a, b), _least(c, d)), _most(_most(a, b), _most(c, d)))
        a, b = self.low * other, self.high * other
        return _outward(a, b) if other >= 0.0 else _outward(b, a)

    def __truediv__(self, other: float) -> Intervals:
        a, b = self.low / other, self.high / other
        return _outward(a, b) if other >= 0.0 else _outward(b, a)

    def reciprocal(self) -> Intervals:
        """The reciprocals; no interval may contain 0."""
        _expect((self.low > 0.0) | (self.high < 0.0), self, "a divisor that is not 0")
        return _outward(1.0 / self.high, 1.0 / self.low)

    def sqrt(self) -> Intervals:
        """The roots of positive numbers."""
        _expect(self.low > 0.0, self, "a positive number")
        return _outward(np.sqrt(self.low), np.sqrt(self.high))

    def power(self, exponent: float) -> Intervals:
        """Positive numbers to a power."""
        _expect(self.low > 0.0, self, "a positive number")
        a, b = self.low**exponent, self.high**exponent
        return _outward(_least(a, b), _most(a, b), FUNCTIONS)

    def tanh(self) -> Intervals:
        """The hyperbolic tangent."""
        return _outward(np.tanh(self.low), np.tanh(self.high), FUNCTIONS)

    def sin(self) -> Intervals:
        """The sine of angles within ±1.5 rad."""
        _expect(self.size <= 1.5, self, "an angle within 1.5 rad")
        return _outward(np.sin(self.low), np.sin(self.high), FUNCTIONS)

    def cos(self) -> Intervals:
        """The cosine of angles within ±1.5 rad."""
        _expect(self.size <= 1.5, self, "an angle within 1.5 rad")
        return _outward(np.cos(self.size), np.cos(self.least_size), FUNCTIONS)

    def hull(self, other: Intervals) -> Intervals:
        """The smallest intervals that contain both."""
        return Intervals(_least(self.low, other.low), _most(self.high, other.high))

    def intersection(self, other: Intervals) -> Intervals:
        """The intersections."""
        return Intervals(_most(self.low, other.low), _least(self.high, other.high))

    def sum(self) -> Intervals:
        """The sums along the first axis."""
        slack = ROUNDING * len(self.low)
        below, above = np.abs(self.low).sum(axis=0) * slack, np.abs(self.high).sum(axis=0) * slack
        return Intervals(self.low.sum(axis=0) - (below + TINY), self.high.sum(axis=0) + (above + TINY))


class OutOfReachError(ArithmeticError):
    """An operation that is undefined for intervals this wide."""


_least: Callable[[Floats, Floats], Floats] = np.minimum
_most: Callable[[Floats, Floats], Floats] = np.maximum


def _outward(low: Floats, high: Floats, by: float = ROUNDING) -> Intervals:
    """Intervals with these bounds moved outward, in place."""
    for bound, move in ((low, np.subtract), (high, np.add)):
        slack = np.abs(bound)
        slack *= by
        slack += TINY
        move(bound, slack, out=bound)
    return Intervals(low, high)


def _expect(holds: Any, values: Intervals, expected: str) -> None:
    if not np.all(holds):
        raise OutOfReachError(f"{np.min(values.low):g} to {np.max(values.high):g}: expected {expected}")
