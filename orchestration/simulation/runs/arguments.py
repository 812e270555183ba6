"""Arguments of Python functions that are no request: values by path, names, times, functions: refused in a line."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from orchestration.foundation.basics.errors import UsageError, shown

Function = TypeVar("Function", bound=Callable[..., Any])


def values_by_path(values: Any, what: str) -> dict[str, Any]:
    """Values by path; raises `UsageError` that begins with `what` they are (`values =`) for anything else."""
    if hasattr(values, "keys"):  # a table of pandas too
        values = dict(values)
    if not isinstance(values, Mapping):
        raise UsageError(f"{what} {shown(repr(values))}: expected a dictionary of values by path, as {{'seed': 1}}")
    for path in values:
        if not isinstance(path, str):
            raise UsageError(f"{what} {shown(repr(values))}: expected paths as text, not {shown(repr(path))}")
    return {**values}


def names_in(names: Any, argument: str) -> tuple[str, ...]:
    """Names in a list; raises `UsageError` for anything else, as a name alone."""
    listed = (names,) if isinstance(names, str) or not isinstance(names, Iterable) else tuple(names)
    if isinstance(names, str) or not all(isinstance(name, str) for name in listed):
        raise UsageError(f"{argument} = {shown(repr(names))}: expected a list of names")
    return listed


def window_within(window: Any, end: float, given: str) -> tuple[float, float]:
    """A span of time [s]; raises `UsageError` that begins with what was `given` unless it begins before `end`."""
    try:
        first, last = map(float, window)
    except (TypeError, ValueError):
        first = last = math.nan
    if not 0.0 <= first < last < math.inf or first >= end:
        raise UsageError(f"{given}: expected 0 <= from < to, and from before the end at {end:g} s")
    return first, last


def function_in(function: Function, argument: str, of: str) -> Function:
    """A function; raises `UsageError` that states what it is `of` for anything that cannot be called."""
    if not callable(function):
        raise UsageError(f"{argument} = {shown(repr(function))}: expected a function of {of}")
    return function
