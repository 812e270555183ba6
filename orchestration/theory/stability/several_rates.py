"""Periods beside others, of a loop that repeats where all rates meet, and where it ceases to be stable between them."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from orchestration.foundation.basics.bisection import Bracket
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.model import System
from orchestration.theory.stability.operating_point import (
    LONGEST_HYPERPERIOD,
    beside_others,
    hyperperiod,
    hyperperiod_of,
    periods_of,
)
from orchestration.theory.stability.periodic_schedule import begin_and_hyperperiod, instants

MOST_MULTIPLES = 120
"""Most multiples of the other periods that are tried beside the values of the scan"""
FEW = 2
"""Number of them at most after which the others meet it again: what takes longer takes long to examine"""
MOST_BETWEEN = 10_000
"""Most values between two others that are looked at, those of the simplest ratios"""
DIGITS, ROUNDING = 6, 1e-12
"""Digits of such a value at most, so that it is the one that is printed, and what is no difference from it, relative"""
MOST_UNKNOWN = 8
"""Most values that are left out between two, as nothing is known of them"""
NEAR = 1.0 / 64.0
"""Distance from a value, relative, within which another is sought first"""


@dataclass(frozen=True, kw_only=True)
class Commensurate:
    """Values at which a loop of several rates repeats: of one that varies, only there it has a spectral radius."""

    scan: list[float]
    """the scan's own that are, and multiples of the other periods, at which it may be unstable between stable ones; or
    one for each that was asked for, if not the same for two"""
    longest_first: list[float]
    """the same, the longest hyperperiod first: what is measured over a long one serves over shorter ones"""
    meetings: "Meetings"
    """all that are"""
    moved: int = 0
    """the number of values asked for at which the rates never meet, so that another is in their place"""


class Meetings:
    """All values of a period at which it meets others within `LONGEST_HYPERPERIOD` of the longest: by their ratios."""

    def __init__(self, others: Sequence[Fraction], unit: float) -> None:
        """The other periods [ns], and the value of the period by nanosecond."""
        self._others, self._whole, self._longest, self._unit = others, hyperperiod(others), max(others), unit

    def between(self, low: float, high: float) -> list[float]:
        """Those from one value to another, in rising order."""
        low, high = sorted((low, high))
        size, found = float(self._whole) * self._unit, set[float]()
        most = math.floor(LONGEST_HYPERPERIOD * self._longest / self._whole)  # of p, in a period that is p / q of all
        farthest = math.floor(LONGEST_HYPERPERIOD * float(self._longest) * self._unit / low)
        largest = min(MOST_BETWEEN, max(LONGEST_HYPERPERIOD, farthest))
        for q in range(1, largest + 1):
            first, last = (one * q / size for one in (low, high))
            every = range(math.ceil(first - ROUNDING * first), math.floor(last + ROUNDING * last) + 1)
            if q > LONGEST_HYPERPERIOD:
                every = range(every.start, min(every.stop, most + 1))
            for p in every[:: math.ceil(len(every) / MOST_BETWEEN) or 1]:
                value = float(f"{size * p / q:.{DIGITS}g}")
                if math.isclose(value, size * p / q, rel_tol=ROUNDING):
                    found.add(value)
            if len(found) > MOST_BETWEEN:
                break
        return sorted(found)

    def instead(self, values: Sequence[float], k: int) -> float:
        """The one that takes the place of value `k` of some in rising order.

        Within half of the way to its neighbours it is the multiple of the most others, at one phase of these, of such
        that of the simplest ratio; else the nearest; NaN: none.
        """
        value, (first, last) = values[k], (values[0], values[-1])
        below, above = (0.5 * (value + values[min(max(0, each), len(values) - 1)]) for each in (k - 1, k + 1))
        if near := self.between(below, above):
            return min(near, key=lambda one: (*self._ratio_of(one), abs(one - value)))
        share = NEAR
        while not near and share < last / first:
            near = self.between(max(first, value / (1.0 + share)), min(last, value * (1.0 + share)))
            share *= 2.0
        return min(near, key=lambda one: abs(one - value), default=math.nan)

    def has(self, value: float) -> bool:
        """Whether a value is one."""
        return self.period_with(value) <= LONGEST_HYPERPERIOD * max(self._longest, self._period_of(value))

    def period_with(self, value: float) -> Fraction:
        """The hyperperiod of a value and the others [ns]."""
        return hyperperiod([self._whole, self._period_of(value)])

    def few_of(self, values: Sequence[float]) -> list[float]:
        """Those, `MOST_MULTIPLES` at most, whose hyperperiod with the others is `FEW` of them at most."""
        found = [value for value in values if self.period_with(value) <= FEW * self._period_of(value)]
        return found[:: math.ceil(len(found) / MOST_MULTIPLES) or 1]

    def _ratio_of(self, value: float) -> tuple[int, Fraction]:
        period = self._period_of(value)
        return sum(period % other != 0 for other in self._others), self.period_with(value)

    def _period_of(self, value: float) -> Fraction:
        return Fraction(f"{value / self._unit:.12g}")


def commensurate(
    at: Callable[[float], System], values: Sequence[float], *, also: Sequence[float] = (), instead: bool = False
) -> Commensurate | None:
    """The values at which a loop of several rates repeats; None: it has one rate, or the quantity is no period.

    `also`: values that are taken as multiples of the others are, if they meet these soon. `instead`: one in the place
    of each value, and no multiples of the others between them. Of what shares a processor
    or a network others are all that does.
    """
    is_shared = instants(at(values[0])) != instants(at(values[-1]))
    if not instead and beside_others(at, values[0], values[-1]) is None:
        return None
    beside = beside_others(at, values[0], values[-1], _with_shared if is_shared else periods_of)
    if beside is None:
        return None
    others, unit = beside
    meetings, first, last = Meetings(others, unit), values[0], values[-1]

    def multiples(period: Fraction) -> list[float]:
        step = float(period) * unit
        return [float(f"{k * step:.12g}") for k in range(math.ceil(first / step), math.floor(last / step) + 1)]

    def repeating(some: Iterable[float]) -> dict[float, Fraction]:
        each = {
            value: hyperperiod_of(system)
            for value in sorted(some)
            for system in [at(value)]
            if not is_shared or ((instead or meetings.has(value)) and _is_scheduled(system))
        }
        return {value: period for value, period in each.items() if period is not None}

    if instead:
        given = repeating(values)
        instead_of = {meetings.instead(values, k) for k, one in enumerate(values) if one not in given}
        known = repeating({*given, *filter(math.isfinite, instead_of)})
        moved = len(values) - len(given)
    else:
        added = sorted({*also, *(value for period in others for value in multiples(period))})
        known, moved = repeating({*values, *meetings.few_of(added)}), 0
    longest_first = sorted(known, key=known.__getitem__, reverse=True)
    return Commensurate(scan=[*known], longest_first=longest_first, meetings=meetings, moved=moved)


def _with_shared(system: System) -> list[Fraction]:
    return [*periods_of(system), *(period for _, period in instants(system))]


def _is_scheduled(system: System) -> bool:
    """Whether what shares a processor or a network repeats soon enough to be followed."""
    try:
        begin_and_hyperperiod(instants(system))
    except UsageError:
        return False
    return True


def narrowed(grows: Callable[[float], bool | None], bracket: Bracket, rates: Commensurate) -> Bracket:
    """The bracket bisected by all values in it at which the rates meet, until that before its good end is good, too.

    So has to be the one of the simplest ratio that it has passed by, where a loop is most often unstable by itself.
    Between values at which it is unstable, a loop may be stable at one, as at a multiple of another period. A value at
    which it is not known whether it is, None, is left out: the next is that of the simplest ratio, and after
    `MOST_UNKNOWN` the bracket stays.
    """
    good, bad = bracket
    assert good is not None
    down = bad < good
    scan, unknown = sorted(rates.scan, reverse=down), 0

    def before(values: list[float], end: float) -> list[float]:
        return [x for x in values if (x > end if down else x < end)]

    while True:
        begin = (before(scan, good) or [good])[-1]
        fine = sorted(rates.meetings.between(begin, bad), reverse=down)
        start, between = good, [x for x in before(fine, bad) if before([good], x)]
        is_bad: bool | None = False
        while between and unknown < MOST_UNKNOWN:
            half = len(between) // 2
            if is_bad is None:
                half = between.index(min(between, key=rates.meetings.period_with))
            is_bad = grows(between[half])
            if is_bad is None:
                between.pop(half)
                unknown += 1
            elif is_bad:
                bad, between = between[half], between[:half]
            else:
                good, between = between[half], between[half + 1 :]
        passed = before(fine, good)
        simplest = sorted((x for x in passed if before([start], x)), key=rates.meetings.period_with)[:1]
        unstable = next((x for x in (*simplest, *passed[-1:]) if grows(x)), None)
        nearest = reversed([] if unstable is None else before(scan, unstable))
        stable = next((x for x in nearest if grows(x) is False), None)
        if unstable is None or stable is None:
            return Bracket(good, bad)
        good, bad = stable, unstable
