"""Looking for the first value that fails, by a scan upward and bisection."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

Fails = Callable[[float], bool]


class Bracket(NamedTuple):
    """Two values with the edge of what fails between them."""

    good: float | None
    """does not fail; None: the first value of the scan fails"""
    bad: float
    """fails"""


def first_failure(fails: Fails, values: Sequence[float], tolerance: float, *, parts: int = 1) -> Bracket | None:
    """The last value that does not fail and the first that does, at most `tolerance` apart; None if none fails.

    Goes up through `values`, up again in `parts` of the step before the first that fails, and bisects. The set
    that does not fail need not be an interval: what is narrower than these steps is not seen.
    """
    good = None
    for value in values:
        if not fails(value):
            good = value
            continue
        if good is None:
            return Bracket(None, value)
        low, step, bad = good, (value - good) / parts, value
        if step >= tolerance:
            for i in range(1, parts):
                finer = float(f"{low + i * step:.12g}")
                if fails(finer):
                    bad = finer
                    break
                good = finer
        return bisected(fails, good, bad, tolerance)
    return None


def bisected(fails: Fails, good: float, bad: float, tolerance: float) -> Bracket:
    """`good`, which does not fail, and `bad`, which does, brought together to `tolerance`."""
    while bad - good > tolerance:
        middle = 0.5 * (good + bad)
        if fails(middle):
            bad = middle
        else:
            good = middle
    return Bracket(good, bad)
