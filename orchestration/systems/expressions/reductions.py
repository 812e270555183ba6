"""The functions over a run, such as max, integral and settling_time, computed span by span.

Integrals are exact for signals that are held.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from orchestration.foundation.basics import unit_algebra as units
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import Rule


class Course:
    """The course of an expression over the rows of a span. `ends` and `middles` are computed when first used."""

    def __init__(
        self,
        time: Floats,
        values: Floats,
        ends: Callable[[], Floats],
        middles: Callable[[], Floats | None],
        *,
        sampled: bool,
        first: int,
    ) -> None:
        """`values` are at the rows, shape (n,); `sampled`: whether they are samples, with nothing between them;
        `first`: the first row that is not in the span before.
        """
        self.time, self.values, self.sampled, self.first = time, values, sampled, first
        self._ends, self._middles = ends, middles

    @cached_property
    def ends(self) -> Floats:
        """Just before the row after each, shape (n - 1,)."""
        return self._ends()

    @cached_property
    def middles(self) -> Floats | None:
        """Half-way between rows, for expressions of held signals only; None: linear between rows."""
        return self._middles()

    def integral(self) -> float:
        """By Simpson's rule over held signals, exact up to their third powers; else by the trapezoidal rule."""
        starts, ends = self.values[:-1], self.ends
        mean = 0.5 * (starts + ends) if self.middles is None else (starts + 4.0 * self.middles + ends) / 6.0
        return float((mean * np.diff(self.time)).sum())

    def map(self, function: Callable[[Floats], Floats]) -> "Course":
        """The course of a function of the values."""
        return self._of(
            function(self.values),
            lambda: function(self.ends),
            lambda: None if self.middles is None else function(self.middles),
        )

    def held(self, values: Floats) -> "Course":
        """The course of values that hold from their row to the next."""
        return self._of(values, lambda: values[:-1], lambda: values[:-1])

    def _of(self, values: Floats, ends: Callable[[], Floats], middles: Callable[[], Floats | None]) -> "Course":
        return Course(self.time, values, ends, middles, sampled=self.sampled, first=self.first)


class Fold(ABC):
    """A number of a whole run, computed span by span."""

    def __init__(self, function: str) -> None:
        self.function = function

    @abstractmethod
    def add(self, x: Course, *numbers: float | None) -> None:
        """Add the next span; `numbers` are the further arguments of the function."""

    @abstractmethod
    def value(self) -> float | None:
        """The number; None if there is none."""


class _Extreme(Fold):
    """max and min: the largest or smallest value, also just before a held signal changes."""

    def __init__(self, function: str) -> None:
        super().__init__(function)
        self._sign = 1.0 if function == "max" else -1.0
        self._best = -math.inf

    def add(self, x: Course, *numbers: float | None) -> None:
        self._best = max(
            self._best, (self._sign * x.values).max(initial=-math.inf), (self._sign * x.ends).max(initial=-math.inf)
        )

    def value(self) -> float | None:
        return self._sign * self._best


class _Integral(Fold):
    """integral, and mean, rms and share by it; of a sampled signal the mean of its values."""

    _sum, _span, _first, _count, _sampled = 0.0, 0.0, math.nan, 0, False

    def add(self, x: Course, *numbers: float | None) -> None:
        if self.function == "rms":
            x = x.map(np.square)
        elif self.function == "share":  # a condition holds from its row to the next
            x = x.held((x.values != 0.0).astype(float))
        if not self._count and len(x.values):
            self._first = float(x.values[0])
        self._sampled, new = x.sampled, x.values[x.first :]
        self._count += len(new)
        self._sum += float(new.sum()) if x.sampled else x.integral()
        self._span += float(x.time[-1] - x.time[0]) if len(x.time) else 0.0

    def value(self) -> float | None:
        if not self._count:
            return None
        if self.function == "integral":
            return self._sum
        mean = self._sum / self._count if self._sampled else self._sum / self._span if self._span else self._first
        return math.sqrt(mean) if self.function == "rms" else mean


class _Edge(Fold):
    """first and last."""

    _values: Sequence[float] = ()

    def add(self, x: Course, *numbers: float | None) -> None:
        new = x.values[x.first :]
        if len(new):
            self._values = [*self._values[:1], float(new[0]), float(new[-1])]

    def value(self) -> float | None:
        return None if not self._values else self._values[0 if self.function == "first" else -1]


class _PeakTime(Fold):
    """peak_time: when the largest value occurs first."""

    _best = -math.inf
    _time: float | None = None

    def add(self, x: Course, *numbers: float | None) -> None:
        if len(x.values) and x.values.max() > self._best:
            place = int(x.values.argmax())
            self._best, self._time = float(x.values[place]), float(x.time[place])

    def value(self) -> float | None:
        return self._time


class _SettlingTime(Fold):
    """settling_time: the time from which |x| stays within the band."""

    _inside_from: float | None = None

    def add(self, x: Course, *numbers: float | None) -> None:
        time, values = x.time[x.first :], x.values[x.first :]
        outside = np.flatnonzero(~(np.abs(values) <= (math.nan if numbers[0] is None else numbers[0])))
        place = int(outside[-1]) + 1 if len(outside) else 0
        if len(outside):
            self._inside_from = None
        if self._inside_from is None and place < len(time):
            self._inside_from = float(time[place])

    def value(self) -> float | None:
        return self._inside_from


class _TotalVariation(Fold):
    """total_variation: the sum of all changes of x, including jumps."""

    _sum = 0.0

    def add(self, x: Course, *numbers: float | None) -> None:
        self._sum += float(np.abs(x.ends - x.values[:-1]).sum() + np.abs(x.values[1:] - x.ends).sum())

    def value(self) -> float | None:
        return self._sum


class _GrowthShare(Fold):
    """growth_share: of the steps from one value to the next, the share that grows and ends above the floor."""

    _last: float | None = None
    _grown = _steps = 0

    def add(self, x: Course, *numbers: float | None) -> None:
        values = x.values[x.first :]
        if self._last is not None:
            values = np.concatenate([[self._last], values])
        if len(values) and numbers[0] is not None:
            self._last = float(values[-1])
            self._grown += int(np.count_nonzero((np.diff(values) > 0.0) & (values[1:] > numbers[0])))
            self._steps += len(values) - 1

    def value(self) -> float | None:
        return self._grown / self._steps if self._steps else None


@dataclass(frozen=True, kw_only=True)
class Reduction:
    """One function over a run. In SIMD lanes those alone that `engines/batch/folds.py` writes in C."""

    arguments: tuple[int, int] = (1, 1)
    """the fewest and most"""
    fold: type[Fold]
    unit: Rule = units.first


REDUCTIONS: dict[str, Reduction] = {
    "min": Reduction(arguments=(1, 99), fold=_Extreme),
    "max": Reduction(arguments=(1, 99), fold=_Extreme),
    "mean": Reduction(fold=_Integral),
    "rms": Reduction(fold=_Integral),
    "last": Reduction(fold=_Edge),
    "first": Reduction(fold=_Edge),
    "integral": Reduction(fold=_Integral, unit=units.over_time),
    "peak_time": Reduction(fold=_PeakTime, unit=units.second),
    "settling_time": Reduction(arguments=(2, 2), fold=_SettlingTime, unit=units.settled),
    "total_variation": Reduction(fold=_TotalVariation),
    "share": Reduction(fold=_Integral, unit=units.none),
    "growth_share": Reduction(arguments=(2, 2), fold=_GrowthShare, unit=units.none),
}
"""Functions over a run, by name; `min` and `max` of several arguments are of values at one instant."""
