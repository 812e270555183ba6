"""Time in integer nanoseconds, from the decimal form of seconds."""

import functools
import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, overload

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second"""
ROUNDED = 2**50
"""A time that is nearer to whole nanoseconds than its size over this is taken for them: a float's last digits, rounded
in a product or a sum, are up to four times finer"""


@overload
def seconds(nanoseconds: float) -> float: ...
@overload
def seconds(nanoseconds: "npt.NDArray[np.int64] | npt.NDArray[np.float64]") -> "npt.NDArray[np.float64]": ...
def seconds(
    nanoseconds: "float | npt.NDArray[np.int64] | npt.NDArray[np.float64]",
) -> "float | npt.NDArray[np.float64]":
    """Times [s] of times [ns], each correctly rounded."""
    return nanoseconds / NANOSECONDS


@functools.lru_cache(maxsize=4096)  # most times are common to the runs of a study
def exact_nanoseconds(seconds: float) -> Fraction:
    """The rational number that the decimal form of `seconds` means, in nanoseconds; 12 ms of 0.012000000000000002."""
    exact = Fraction(repr(float(seconds))) * NANOSECONDS
    whole = round(exact)
    return Fraction(whole) if abs(exact - whole) * ROUNDED <= abs(whole) else exact


def nanoseconds(seconds: float) -> int:
    """`seconds` rounded to the nanosecond, half to even."""
    return round(exact_nanoseconds(seconds))


def instants_of(times: "npt.NDArray[np.float64]") -> "npt.NDArray[np.int64]":
    """The instants [ns] of recorded times [s], each of which is the quotient of one and 10⁹."""
    import numpy as np  # not needed to read a system

    return np.round(times * NANOSECONDS).astype(np.int64)


def floor_to_nanoseconds(seconds: float) -> float:
    """A time [s] rounded down to a whole nanosecond [s]."""
    return math.floor(seconds * NANOSECONDS + 1e-6) / NANOSECONDS


def is_at_least(seconds: float, nanoseconds: float) -> bool:
    """Whether a time [s] is at least so many nanoseconds, by the decimal forms of both."""
    about = seconds * NANOSECONDS
    if abs(about - nanoseconds) > 1e-9 * nanoseconds:
        return about > nanoseconds
    return exact_nanoseconds(seconds) >= Fraction(repr(float(nanoseconds)))


def common_step(times: Iterable[Fraction]) -> Fraction:
    """The longest step of which all times are multiples."""
    given = [*times]
    scale = math.lcm(*(time.denominator for time in given))
    return Fraction(math.gcd(*(int(time * scale) for time in given)), scale)


class Grid:
    """The instants round(offset + k·period), k = 0, 1, …, in nanoseconds; from exact rationals, never accumulated."""

    def __init__(self, offset: Fraction, period: Fraction) -> None:
        self._denominator = math.lcm(offset.denominator, period.denominator)
        self._offset = int(offset * self._denominator)
        self._period = int(period * self._denominator)

    def __getitem__(self, k: int) -> int:
        if self._denominator == 1:
            return self._offset + k * self._period
        return _round_ratio(self._offset + k * self._period, self._denominator)

    def __iter__(self) -> Iterator[int]:
        if self._denominator == 1:
            return itertools.count(self._offset, self._period)
        return map(self.__getitem__, itertools.count())

    def from_(self, time: int) -> int:
        """The first instant of the grid that is not before `time` [ns]."""
        return self[self.index_from(time)]

    def index_from(self, time: int) -> int:
        """The index of that instant."""
        k = max(0, (time * self._denominator - self._offset) // self._period - 1)
        while self[k] < time:
            k += 1
        return k

    def in_parts(self) -> tuple[int, int, int, int, int] | None:
        """Offset and period, each as whole nanoseconds and a rest in parts of one, and how many parts one has.

        None if these do not fit into 62 bits.
        """
        if self._denominator >= 2**62:
            return None
        return *divmod(self._offset, self._denominator), *divmod(self._period, self._denominator), self._denominator

    def between(self, first: int, end: int) -> "npt.NDArray[np.int64]":
        """The instants with indices from `first` to before `end`, as an array."""
        import numpy as np  # not needed to read a system

        offset, offset_rest, period, rest, parts = self.in_parts() or (0, 0, 0, 0, 2**62)
        if max(abs(offset), period, parts) * (end + 2) >= 2**62:
            return np.array([self[k] for k in range(first, end)], dtype=np.int64)
        indices = np.arange(first, end, dtype=np.int64)
        instants = offset + indices * period
        if parts == 1:
            return instants
        more, rests = np.divmod(offset_rest + indices * rest, parts)
        instants += more
        twice = 2 * rests
        return np.asarray(instants + ((twice > parts) | ((twice == parts) & (instants % 2 == 1))))


@functools.lru_cache(64)  # most are common to the runs of a study
def clock_grid(offset: float, period: float, ratio: float) -> Grid:
    """The instants of a clock that counts `ratio` seconds per true second."""
    exact = Fraction(repr(float(ratio)))
    return Grid(exact_nanoseconds(offset) / exact, exact_nanoseconds(period) / exact)


def _round_ratio(numerator: int, denominator: int) -> int:
    """round(numerator / denominator), half to even, in integers."""
    quotient, rest = divmod(numerator, denominator)
    twice = 2 * rest
    return quotient + (twice > denominator or (twice == denominator and quotient % 2 == 1))


@dataclass(frozen=True)
class Constant:
    """A stream of numbers that are all the same, as of times that do not vary."""

    value: int

    def __call__(self, count: int) -> "npt.NDArray[np.int64]":
        """The next `count` of them."""
        import numpy as np  # not needed to read a system

        return np.full(count, self.value, dtype=np.int64)
