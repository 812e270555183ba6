"""Errors inside an FMU, worded for the person who wired it."""

import math
from collections.abc import Iterable


class FmuError(Exception):
    """An FMI call that is refused; the text names the variable, its value and what was expected."""


class DivergenceError(FmuError):
    """The closed loop has left the region where the equations have a finite solution."""


def require(condition: bool, name: str, value: object, expected: str) -> None:
    """Raise `FmuError` naming the variable, its value and what was expected, unless `condition` holds."""
    if not condition:
        raise FmuError(f"{name} = {value}: expected {expected}")


def require_finite_state(names: Iterable[str], values: Iterable[float]) -> None:
    """Raise `DivergenceError` naming the first value that is not finite."""
    for name, value in zip(names, values, strict=True):
        if not math.isfinite(value):
            raise DivergenceError(f"{name} = {value}: expected a finite value")
