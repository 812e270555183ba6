"""How far a function of mathematics.h is from the exact result, over its range and where it is hard."""

import ctypes
import math
from collections.abc import Callable, Iterator

import mpmath
import numpy as np
from mpmath import mp, mpf

from tests.fmu_kit.compiler.compiled import Floats, results

Arguments = tuple[Floats, ...]
MANTISSA, MIN_EXPONENT = 53, -1074  # bits of a double; the exponent of the smallest one
SEED = 11

STATED: dict[str, float] = {
    "sqrt": 0.5,
    "tanh": 0.6,
    "asin": 0.7,
    "acos": 0.7,
    "expm1": 0.75,
    "exp": 0.8,
    "pow": 0.8,
    "hypot": 0.8,
    "log": 0.85,
    "sin": 0.85,
    "cos": 0.85,
    "atan": 0.9,
    "atan2": 0.9,
    "tan": 0.95,
}
"""No error is larger, in units of the last place."""

EXACT: dict[str, Callable[..., mpf]] = {
    **{name: getattr(mpmath, name) for name in STATED if name not in ("pow", "hypot")},
    "pow": mpmath.power,
    "hypot": lambda x, y: mpmath.sqrt(x * x + y * y),
}


class Samples:
    """Random arguments that are the same in each run."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.random = np.random.default_rng(SEED)

    def even(self, low: float, high: float) -> Floats:
        """Evenly between two bounds."""
        return self.random.uniform(low, high, self.count)

    def sizes(self, low: float, high: float) -> Floats:
        """Positive, of exponents of two evenly between two bounds."""
        return np.exp2(self.even(low, high))

    def signed(self, low: float, high: float) -> Floats:
        """The same with either sign."""
        return self.sizes(low, high) * self.random.choice([-1.0, 1.0], self.count)

    def quarter_turns(self, largest: float) -> Floats:
        """The doubles next to whole multiples of pi/2, where sine or cosine cancels."""
        return np.round(self.even(-largest, largest)) * (math.pi / 2)


def arguments(name: str, count: int) -> Iterator[Arguments]:
    """Sets of arguments of a function, `count` in each: over its range, about 1, of any size, and where it is hard."""
    s = Samples(count)
    ranges: dict[str, list[Arguments]] = {
        "sqrt": [(s.sizes(-1074, 1023),)],
        "exp": [(s.even(-708, 709),), (s.even(-1, 1),), (s.even(-745, -708),), (s.signed(-60, 9),)],
        "expm1": [(s.even(-40, 709),), (s.even(-1, 1),), (s.signed(-1074, 6),), (s.even(-0.4, 1.5),)],
        "tanh": [(s.even(-3, 3),), (s.even(-25, 25),), (s.signed(-1074, 5),), (s.even(-0.3, 0.3),)],
        "log": [(s.sizes(-1074, 1023),), (s.even(0.5, 2),), (1 + s.signed(-53, -1),), (s.even(0.7, 1.5),)],
        "asin": [(s.even(-1, 1),), (s.signed(-1074, 0),), (1 - s.sizes(-53, -1),), (s.even(0.4, 0.6),)],
        "acos": [(s.even(-1, 1),), (s.signed(-60, 0),), (1 - s.sizes(-53, -1),), (s.sizes(-53, -1) - 1,)],
        "atan": [(s.even(-3, 3),), (s.signed(-1074, 1023),), (s.signed(-5, 5),), (s.even(0.4, 0.45),)],
        "atan2": [
            (s.even(-3, 3), s.even(-3, 3)),
            (s.signed(-1074, 1023), s.signed(-1074, 1023)),
            (s.signed(-1074, -1000), s.signed(-1074, -1000)),
            (s.signed(1000, 1023), s.signed(1000, 1023)),
            (s.signed(-1074, -1000), s.even(-1, 1)),
            (s.even(0.3, 0.6), s.even(0.9, 1.1)),
        ],
        "pow": [
            (s.even(0, 10), s.even(-50, 50)),
            (s.sizes(-1000, 1000), s.signed(-10, 3)),
            (1 + s.signed(-50, -1), s.signed(0, 60)),
            (s.even(0.5, 2), s.even(-1000, 1000)),
            (s.sizes(-1074, -1022), s.even(-1, 1)),
        ],
        "hypot": [
            (s.even(-3, 3), s.even(-3, 3)),
            (s.signed(-1074, 1023), s.signed(-1074, 1023)),
            (s.signed(-1074, -1000), s.signed(-1074, -1000)),
            (s.signed(1000, 1022), s.signed(1000, 1022)),
        ],
    }
    angles = [(s.even(-10, 10),), (s.even(-1.6e6, 1.6e6),), (s.signed(-60, 20),)]
    far = [(s.signed(20, 1023),), (s.quarter_turns(1e6),)]
    yield from ranges.get(name) or [*angles, *far]


def last_place(exact: mpf) -> mpf:
    """The distance of the doubles about an exact number."""
    return mpf(2) ** max(mp.frexp(exact)[1] - MANTISSA, MIN_EXPONENT) if exact else mpf(2) ** MIN_EXPONENT


def largest_error(loops: ctypes.CDLL, name: str, count: int) -> tuple[float, tuple[float, ...]]:
    """The largest error in units of the last place, and where; of results that a double can hold."""
    worst, where = 0.0, ()
    with mp.workprec(150):
        for chosen in arguments(name, count):
            for result, *at in zip(results(loops, name, *chosen).tolist(), *(argument.tolist() for argument in chosen)):
                exact = EXACT[name](*map(mpf, at))
                if math.isfinite(result) or abs(exact) < mpf(2) ** 1024:
                    error = abs(result - exact) / last_place(exact)
                    if not error <= worst:
                        worst, where = float(error), tuple(at)
    return worst, where
