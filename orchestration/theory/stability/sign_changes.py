"""Where functions of one number pass zero."""

import math
from collections.abc import Callable, Mapping

import numpy as np

from orchestration.foundation.basics.simulator import Floats

HALVINGS = 60
ZERO = 1e-7
"""Size of a value, as the distance of a spectral radius from 1, that counts as 0"""
TRIALS = 80
"""Most points that are tried"""
SECANTS = 12
"""Points from which on a range is only halved, as it is where the function jumps"""
STANDS_OUT = 10.0
"""Factor on the error of a function, from which a value of it tells how steep it is"""


def roots(of: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Where continuous functions, evaluated together, pass 0, each between two points, by halves."""
    rising = of(high) > of(low)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        passed = (of(middle) > 0.0) == rising
        low, high = np.where(passed, low, middle), np.where(passed, middle, high)
    return 0.5 * (low + high)


def short(value: float, unit: str | None) -> float:
    """A value with few digits; a time in whole nanoseconds."""
    return round(value, 9) if unit == "s" else float(f"{value:.9g}")


def zero_between(
    of: Callable[[float], float],
    short: Callable[[float], float],
    low: tuple[float, float],
    high: tuple[float, float],
    zero: float = ZERO,
) -> tuple[float, float]:
    """Where a function passes 0 between two points (x, y) with y of opposite signs: by secants, later by halves.

    A point that stays counts half the next time (the Illinois rule). Two x: that of y below 0, then that above. They
    are one where the function is 0, neighbours where it jumps, and farther apart where it is NaN between them.
    """
    stays = False
    for trial in range(TRIALS):
        (a, below), (b, above) = low, high
        secant, half = short(a - below * (b - a) / (above - below)), short(0.5 * (a + b))
        middle = secant if trial <= SECANTS and a < secant < b else half
        if not a < middle < b:
            break
        value = of(middle)
        if math.isnan(value) and middle != half:
            middle, value = half, of(half)
        if math.isnan(value):
            break
        if abs(value) < zero:
            return middle, middle
        is_low = (value < 0.0) == (below < 0.0)
        share = 0.5 if trial and is_low == stays else 1.0
        low, high = ((middle, value), (b, share * above)) if is_low else ((a, share * below), (middle, value))
        stays = is_low
    inside, outside = sorted((low, high), key=lambda point: point[1])
    return inside[0], outside[0]


def uncertainty(points: Mapping[float, float], zero: float, error: float) -> float:
    """How far the zero of a function may lie from where it was found, as its values at `points` have this error.

    How steep it is, the nearest points to either side tell whose values stand out of the error.
    """
    telling = [(x, y) for x, y in points.items() if x != zero and abs(y) > STANDS_OUT * error]
    sides = [[point for point in telling if (point[0] > zero) == above] for above in (False, True)]
    nearest = (min(side, key=lambda point: abs(point[0] - zero)) for side in sides if side)
    return max((error * abs((x - zero) / y) for x, y in nearest), default=math.inf if error else 0.0)
