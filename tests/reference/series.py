"""Truncated Taylor series in time, so that no rate has to be written down.

A series is the list of its coefficients x(0), x'(0), x''(0)/2, ...; each is a number or an array.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Series = list[Any]


def from_derivatives(*derivatives: Any) -> Series:
    """The series of a function with these value, rate, second rate, ... at 0."""
    return [np.asarray(x) / math.factorial(k) for k, x in enumerate(derivatives)]


def derivatives(x: Series) -> list[Any]:
    """Value, rate, second rate, ... at 0."""
    return [c * math.factorial(k) for k, c in enumerate(x)]


def rate(x: Series) -> Series:
    """dx/dt, one term shorter."""
    return [k * c for k, c in enumerate(x)][1:]


def add(*terms: Series) -> Series:
    """The sum, as long as the shortest term."""
    return [sum(coefficients) for coefficients in zip(*terms)]


def scale(factor: Any, x: Series) -> Series:
    """A constant times `x`."""
    return [factor * c for c in x]


def product(of: Callable[[Any, Any], Any], a: Sequence[Any], b: Sequence[Any]) -> Series:
    """Any product that is linear in both factors: elementwise, dot, cross, matrix."""
    return [sum(of(a[i], b[k - i]) for i in range(k + 1)) for k in range(min(len(a), len(b)))]


def quotient(a: Series, b: Series) -> Series:
    """a / b for a `b` of numbers."""
    result: Series = []
    for k in range(min(len(a), len(b))):
        result.append((a[k] - sum(b[j] * result[k - j] for j in range(1, k + 1))) / b[0])
    return result


def power(x: Series, exponent: float) -> Series:
    """x ** exponent of a positive x, from x y' = exponent y x'."""
    result = [x[0] ** exponent]
    for k in range(1, len(x)):
        terms = ((exponent * j - (k - j)) * x[j] * result[k - j] for j in range(1, k + 1))
        result.append(sum(terms) / (k * x[0]))
    return result


def tanh(x: Series) -> Series:
    """Hyperbolic tangent, elementwise, from y' = (1 - y²) x'."""
    result = [np.tanh(x[0])]
    for k in range(1, len(x)):
        square = product(np.multiply, result, result)
        slope = [1.0 - square[0], *scale(-1.0, square[1:])]
        result.append(sum(j * x[j] * slope[k - j] for j in range(1, k + 1)) / k)
    return result
