"""Periods beside others, of a loop that repeats where all rates meet, and where it ceases to be stable between them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from orchestration.foundation.basics.bisection import Bracket
from orchestration.systems.system.model import System
from orchestration.theory.stability.operating_point import (
    LONGEST_HYPERPERIOD,
    beside_others,
    hyperperiod,
    hyperperiod_of,
)

MOST_MULTIPLES = 200
"""Most multiples of the other periods that are tried beside the values of the scan"""


@dataclass(frozen=True, kw_only=True)
class Commensurate:
    """Values at which a loop of several rates repeats: of one that varies, only there it has a spectral radius."""

    scan: list[float]
    """the scan's own that are, and multiples of the other periods, at which it may be unstable between stable ones"""
    longest_first: list[float]
    """the same, the longest hyperperiod first: what is measured over a long one serves over shorter ones"""
    fine: list[float]
    """candidates between them"""


def commensurate(at: Callable[[float], System], values: Sequence[float]) -> Commensurate | None:
    """The values at which a loop of several rates repeats; None: it has one rate, or the quantity is no period."""
    beside = beside_others(at, values[0], values[-1])
    if beside is None:
        return None
    others, unit = beside

    def multiples(period: Fraction) -> list[float]:
        step = float(period) * unit
        counts = range(math.ceil(values[0] / step), math.floor(values[-1] / step) + 1)
        return [float(f"{k * step:.12g}") for k in counts]

    added = sorted({value for period in others for value in multiples(period)})
    few = added[:: math.ceil(len(added) / MOST_MULTIPLES)] if added else added
    repeats = {value: hyperperiod_of(at(value)) for value in sorted({*values, *few})}
    known = {value: period for value, period in repeats.items() if period is not None}
    longest_first = sorted(known, key=known.__getitem__, reverse=True)
    fine = multiples(hyperperiod(others) / LONGEST_HYPERPERIOD)
    return Commensurate(scan=[*known], longest_first=longest_first, fine=fine)


def narrowed(grows: Callable[[float], bool], bracket: Bracket, rates: Commensurate) -> Bracket:
    """The bracket bisected by the values of `fine` within it, until that before its good end is good, too.

    Between values at which it is unstable, a loop may be stable at one, as at a multiple of another period.
    """
    good, bad = bracket
    assert good is not None
    down = bad < good
    fine, scan = (sorted(values, reverse=down) for values in (rates.fine, rates.scan))

    def before(values: list[float], end: float) -> list[float]:
        return [x for x in values if (x > end if down else x < end)]

    while True:
        between = [x for x in before(fine, bad) if before([good], x)]
        while between:
            half = len(between) // 2
            if grows(between[half]):
                bad, between = between[half], between[:half]
            else:
                good, between = between[half], between[half + 1 :]
        beside = before(fine, good)[-1:]
        if not beside or not grows(beside[0]):
            return Bracket(good, bad)
        stable = next((x for x in reversed(before(scan, beside[0])) if not grows(x)), None)
        if stable is None:
            return Bracket(good, bad)
        good, bad = stable, beside[0]
