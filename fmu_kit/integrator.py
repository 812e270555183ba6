"""The classical fourth-order Runge-Kutta method, for any state with a `plus` along its rate."""

import math
from collections.abc import Callable
from typing import Any, Protocol, TypeVar


class Movable(Protocol):
    """A state or a rate: `x.plus(h, k)` is x + h k."""

    def plus(self, factor: float, rate: Any) -> Any:
        """self + factor * rate."""


X = TypeVar("X", bound=Movable)


def rk4_step(f: Callable[[float, X], X], t: float, x: X, h: float) -> X:
    """x(t + h) [s] from x(t) and dx/dt = f(t, x), with a local error of order h⁵."""
    half, sixth = 0.5 * h, h / 6.0
    k1 = f(t, x)
    k2 = f(t + half, x.plus(half, k1))
    k3 = f(t + half, x.plus(half, k2))
    k4 = f(t + h, x.plus(h, k3))
    slope: X = k1.plus(2.0, k2).plus(2.0, k3).plus(1.0, k4)
    result: X = x.plus(sixth, slope)
    return result


def internal_steps(h: float, largest: float) -> int:
    """The number of equal internal steps of at most `largest` [s] in a communication step `h` [s]."""
    return max(1, math.ceil(h / largest - 1e-6))
