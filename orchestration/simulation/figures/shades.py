"""The range of values of a map's colours, and what else ranges leave out; a report follows the same rules."""

from dataclasses import dataclass

import numpy as np

from orchestration.foundation.basics.simulator import Floats

OUTER_SHARE = 0.02
"""Share of the values on each side that is excluded from the range if it would take up most of it"""
OUTLIER_RATIO = 2.5
"""ratio of the full range to that of the other values above which it does"""
MIN_RANGE = 0.05
"""smallest range as a share of the largest value, so that tiny differences do not look large"""
LOGARITHMIC_RATIO = 50.0
"""ratio of the largest to the smallest value above which colours and axes are logarithmic"""
OUTSIDE, CLIPPED = 0.015, 3.0
"""Share of the time that counts as a peak of a line, at most, and smallest ratio of its range to that of the rest"""


@dataclass(frozen=True, kw_only=True)
class Shades:
    """The values of the first and the last colour."""

    low: float
    high: float
    logarithmic: bool
    leaves_out: tuple[bool, bool]
    """whether there are values below, and above"""


def shades_of(values: Floats) -> Shades | None:
    """The range of the colours for the finite values; None if there are none."""
    known = np.sort(values[np.isfinite(values)])
    if not len(known):
        return None
    logarithmic = is_wide(known)
    scaled = np.log(known) if logarithmic else known
    low, high = (float(scaled[end]) for end in inner(scaled))
    middle, half = 0.5 * (low + high), 0.5 * MIN_RANGE * (1.0 if logarithmic else float(abs(known).max()))
    low, high = min(low, middle - half), max(high, middle + half)
    beyond = bool(scaled[0] < low), bool(scaled[-1] > high)
    ends = np.exp([low, high]) if logarithmic else (low, high)
    return Shades(low=float(ends[0]), high=float(ends[1]), logarithmic=logarithmic, leaves_out=beyond)


def inner(ordered: Floats) -> tuple[int, int]:
    """The indices of the smallest and the largest of some ordered values that are not outliers."""
    last = len(ordered) - 1
    low, high = (round(share * last) for share in (OUTER_SHARE, 1.0 - OUTER_SHARE))
    within = ordered[high] - ordered[low]
    return (low, high) if last >= 19 and ordered[-1] - ordered[0] > OUTLIER_RATIO * within > 0.0 else (0, last)


def is_wide(values: Floats) -> bool:
    """Whether the finite values are all positive and of different orders of magnitude."""
    known = values[np.isfinite(values)]
    return bool(len(known) and known.min() > 0.0 and known.max() > LOGARITHMIC_RATIO * known.min())
