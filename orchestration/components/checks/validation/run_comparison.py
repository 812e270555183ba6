"""Comparison of runs that should be equal."""

import struct
from collections.abc import Iterator

from orchestration.components.checks.validation.finding import Note
from orchestration.components.checks.validation.instance import Row, Value

TOLERANCE = 1e-4
"""Difference allowed between runs of an FMU that is not ours, relative to the largest value of a variable in the run"""


def deviations(found: list[Row], expected: list[Row], text: str, *, is_ours: bool) -> Iterator[str]:
    """The first deviation of a run from one that should be equal, put into `text`.

    Of an FMU that is not ours a small one is a note: FMI requires that a simulation can go on, not the same last bit.
    """
    exact = difference(found, expected)
    if exact is None:
        return
    large = exact if is_ours else difference(found, expected, TOLERANCE)
    if large is not None:
        yield text.format(large)
    else:
        yield Note(f"{text.format(exact)}: less than {TOLERANCE:g} of the largest value in the run")


def difference(found: list[Row], expected: list[Row], tolerance: float = 0.0) -> str | None:
    """The first difference of two runs: step, variable and both values; None if they are equal.

    Equal to the last bit, or within `tolerance` of the largest value of a variable in the run.
    """
    if len(found) != len(expected):
        return f"the run ends after {len(found)} steps, expected {len(expected)}"
    largest: dict[str, float] = {}
    for row in expected if tolerance else ():
        for name, value in row.items():
            if isinstance(value, float):
                largest[name] = max(largest.get(name, 0.0), abs(value))
    for k, (a, b) in enumerate(zip(found, expected)):
        for name, value in a.items():
            if not (same(value, b[name]) or _near(value, b[name], tolerance * largest.get(name, 0.0))):
                return f"{name} = {value!r} after step {k + 1} of {len(found)}, expected {b[name]!r}"
    return None


def same(a: Value, b: Value) -> bool:
    """Whether two values have the same bits."""
    if isinstance(a, float) and isinstance(b, float):
        return struct.pack("d", a) == struct.pack("d", b)
    return a == b


def _near(a: Value, b: Value, distance: float) -> bool:
    return isinstance(a, float) and isinstance(b, float) and abs(a - b) <= distance and distance > 0.0
