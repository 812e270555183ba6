"""Over which values the colours of a map go; the maps of a report follow the same rules (`report/page/map.js`)."""

from dataclasses import dataclass

import numpy as np

from orchestration.basics.simulator import Floats

OUTER = 0.02
"""Share of the values to each side that is left out of the colours, if it would take most of them"""
MOST = 2.5
"""times the range of the others: more than that is most"""
LEAST = 0.05
"""of the largest value: so much at least all colours stand for, so that next to nothing does not look like much"""
WIDE = 50.0
"""times the least value: from there on colours and axes go by the logarithm"""


@dataclass(frozen=True, kw_only=True)
class Shades:
    """What the first colour and the last stand for."""

    low: float
    high: float
    logarithmic: bool
    leaves_out: tuple[bool, bool]
    """whether there are values below, above"""


def shades_of(values: Floats) -> Shades | None:
    """The colours for values, as far as they are finite; None if none is."""
    known = np.sort(values[np.isfinite(values)])
    if not len(known):
        return None
    logarithmic = is_wide(known)
    scaled = np.log(known) if logarithmic else known
    low, high = (float(scaled[end]) for end in inner(scaled))
    middle, half = 0.5 * (low + high), 0.5 * LEAST * (1.0 if logarithmic else float(abs(known).max()))
    low, high = min(low, middle - half), max(high, middle + half)
    beyond = bool(scaled[0] < low), bool(scaled[-1] > high)
    ends = np.exp([low, high]) if logarithmic else (low, high)
    return Shades(low=float(ends[0]), high=float(ends[1]), logarithmic=logarithmic, leaves_out=beyond)


def inner(ordered: Floats) -> tuple[int, int]:
    """The places of the least and the largest of some ordered values that are no outliers."""
    last = len(ordered) - 1
    low, high = (round(share * last) for share in (OUTER, 1.0 - OUTER))
    within = ordered[high] - ordered[low]
    return (low, high) if last >= 19 and ordered[-1] - ordered[0] > MOST * within > 0.0 else (0, last)


def is_wide(values: Floats) -> bool:
    """Whether values are of different orders of magnitude, all above zero; what is not finite does not count."""
    known = values[np.isfinite(values)]
    return bool(len(known) and known.min() > 0.0 and known.max() > WIDE * known.min())
