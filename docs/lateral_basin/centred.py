"""Numbers over boxes: over a box about c, f(x) = f(c) + slopes · (x - c), all three known within intervals.

Laws and dynamics of this project are evaluated on them like on floats: a `Centred` has the operators, `OPS` has the
functions. The uncertainty of f(c) remains in a small box; that of the slopes vanishes with the square of the box. Many
boxes are evaluated together. A float is the same in every box, and 0.0 costs nothing.

Where a condition holds only in a part of a box, the number is the union of both branches: a wide f(c), no slopes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from docs.lateral_basin.intervals import Intervals
from fmu_kit.scalar import FLOAT, ScalarOps
from orchestration.foundation.basics.simulator import Floats


class Condition(NamedTuple):
    """A condition: the boxes in which it holds everywhere, and those in which it holds somewhere."""

    surely: Any
    possibly: Any

    def __and__(self, other: Condition) -> Condition:
        return Condition(self.surely & other.surely, self.possibly & other.possibly)


class Centred:
    """A number over each of many boxes."""

    __slots__ = ("_values", "radius", "rows")

    def __init__(self, rows: Intervals, radius: Floats) -> None:
        """Rows: the value anywhere in the box, the value at the centre, a slope along each coordinate.

        `radius` is that of the boxes, shape (coordinates, boxes).
        """
        self.rows, self.radius = rows, radius
        self._values: Intervals | None = None

    @classmethod
    def linear(cls, weights: Floats, centre: Floats, radius: Floats) -> Centred:
        """The weighted sum of the coordinates; `centre` and `radius` are those of the boxes."""
        at_centre = (Intervals.of(centre) * Intervals.of(weights[:, None])).sum()[None]
        anywhere = at_centre + Intervals.symmetric((np.abs(weights)[:, None] * radius).sum(axis=0) * (1.0 + 1e-14))
        slopes = Intervals.of(np.broadcast_to(weights[:, None], radius.shape))
        return cls(Intervals.joined(anywhere, at_centre, slopes), radius)

    @classmethod
    def any_of(cls, values: Intervals, radius: Floats) -> Centred:
        """A number that may be any of these values anywhere in the box."""
        none = Intervals.of(np.zeros_like(radius))
        return cls(Intervals.joined(values[None], values[None], none), radius)

    @property
    def values(self) -> Intervals:
        """The value anywhere in the box, and at the centre, shape (2, boxes)."""
        if self._values is None:
            by_slopes = self.rows[1] + Intervals.symmetric(Intervals.of(self.slopes.size * self.radius).sum().high)
            self._values = Intervals.joined(self.rows[0].intersection(by_slopes)[None], self.rows[1:2])
        return self._values

    @property
    def slopes(self) -> Intervals:
        """Shape (coordinates, boxes)."""
        return self.rows[2:]

    @property
    def anywhere(self) -> Intervals:
        """The value anywhere in the box."""
        return self.values[0]

    def like(self, values: Intervals, slopes: Intervals) -> Centred:
        """Another number over the same boxes."""
        return Centred(Intervals.joined(values, slopes), self.radius)

    def __neg__(self) -> Centred:
        return Centred(-self.rows, self.radius)

    def __add__(self, other: Any) -> Centred:
        if isinstance(other, Centred):
            return Centred(self.rows + other.rows, self.radius)
        if other == 0.0:
            return self
        return self.like(self.rows[:2] + other, self.slopes)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Centred:
        return self.__add__(-other)

    def __rsub__(self, other: float) -> Centred:
        return (-self).__add__(other)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Centred):
            slopes = self.slopes * other.anywhere + other.slopes * self.values[1]
            return self.like(self.values * other.values, slopes)
        if not isinstance(other, float):
            return NotImplemented  # vectors multiply each of their components
        return 0.0 if other == 0.0 else Centred(self.rows * other, self.radius)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Centred):
            return self * other._reciprocal()
        return Centred(self.rows / other, self.radius)

    def __rtruediv__(self, other: float) -> Any:
        return other * self._reciprocal()

    def _reciprocal(self) -> Centred:
        inverse = self.values.reciprocal()
        return self.like(inverse, -self.slopes * (inverse[0] * inverse[1]))

    def __pow__(self, exponent: float) -> Centred:
        return self.like(self.values.power(exponent), self.slopes * self._hull().power(exponent - 1.0) * exponent)

    def __abs__(self) -> Centred:
        values, sign = self.values, _sign(self._hull())
        return self.like(Intervals(values.least_size, values.size), self.slopes * sign)

    def __ge__(self, bound: float) -> Condition:
        return Condition(self.anywhere.low >= bound, self.anywhere.high >= bound)

    def _hull(self) -> Intervals:
        """The hull of its values in the box and at the centre."""
        return self.values[0].hull(self.values[1])


def _sign(values: Intervals) -> Intervals:
    """The slope of |x|, which is its sign; for 0, any number within ±1."""
    return Intervals(np.where(values.low > 0.0, 1.0, -1.0), np.where(values.high < 0.0, -1.0, 1.0))


def _sqrt(x: Any) -> Any:
    if not isinstance(x, Centred):
        return FLOAT.sqrt(x)
    roots = x.values.sqrt()
    return x.like(roots, x.slopes * (roots[0] + roots[1]).reciprocal())


def _tanh(x: Any) -> Any:
    """The hyperbolic tangent; its slopes lie between its smallest and largest derivatives."""
    if not isinstance(x, Centred):
        return FLOAT.tanh(x)
    between = x._hull()
    steepest, flattest = Intervals.of(between.least_size).tanh(), Intervals.of(between.size).tanh()
    slope = Intervals((-(flattest * flattest) + 1.0).low, (-(steepest * steepest) + 1.0).high)
    return x.like(x.values.tanh(), x.slopes * slope)


def _sin(x: Any) -> Any:
    return x.like(x.values.sin(), x.slopes * x._hull().cos()) if isinstance(x, Centred) else FLOAT.sin(x)


def _cos(x: Any) -> Any:
    return x.like(x.values.cos(), -(x.slopes * x._hull().sin())) if isinstance(x, Centred) else FLOAT.cos(x)


def _signum(x: Any) -> Any:
    return Centred.any_of(_sign(x.anywhere), x.radius) if isinstance(x, Centred) else FLOAT.sign(x)


def _maximum(x: Any, floor: float) -> Any:
    """The larger of a number and a float."""
    if not isinstance(x, Centred):
        return FLOAT.maximum(x, floor)
    between = x._hull()
    share = Intervals(np.where(between.low > floor, 1.0, 0.0), np.where(between.high <= floor, 0.0, 1.0))
    return x.like(Intervals(np.maximum(x.values.low, floor), np.maximum(x.values.high, floor)), x.slopes * share)


def _where(condition: Any, a: Any, b: Any) -> Any:
    if not isinstance(condition, Condition):
        return FLOAT.where(condition, a, b)
    radius = next(x.radius for x in (a, b) if isinstance(x, Centred))
    first, second = _as_centred(a, radius), _as_centred(b, radius)
    either = Centred.any_of(first.anywhere.hull(second.anywhere), radius)
    pick = [condition.surely, ~condition.possibly]
    rows = [first.rows, second.rows, either.rows]
    low, high = (np.where(pick[0], x, np.where(pick[1], y, z)) for x, y, z in zip(*([r.low, r.high] for r in rows)))
    return Centred(Intervals(low, high), radius)


def _as_centred(x: Any, radius: Floats) -> Centred:
    if isinstance(x, Centred):
        return x
    return Centred.any_of(Intervals.of(np.full(radius.shape[1], float(x))), radius)


def _surely(condition: Any) -> bool:
    return bool(np.all(condition.surely)) if isinstance(condition, Condition) else bool(condition)


def _unknown(*arguments: Any) -> Any:
    raise NotImplementedError("atan2 over boxes: expected a law without it")


OPS = ScalarOps(
    sqrt=_sqrt,
    tanh=_tanh,
    sin=_sin,
    cos=_cos,
    atan2=_unknown,
    sign=_signum,
    maximum=_maximum,
    where=_where,
    all=_surely,
)
"""The functions of floats and of `Centred`."""
