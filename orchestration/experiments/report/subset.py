"""The runs of a study whose signals are in a report: those required, then others spread evenly over the design."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

MAX_IN_BATCHES = 1000
"""default number of runs whose signals are in a report"""
MAX_SINGLY = 60
"""likewise if runs cannot be simulated in SIMD batches"""
BYTES = 8_000_000
"""Limit on the characters of all signals"""
MAX_POINTS, MIN_POINTS = 400, 40
"""Most and fewest points of a run"""
_CODED = 2.0 * 4.0 / 3.0
"""Characters of a number"""


Progress = Callable[[float], None]
"""Receives the share of the reruns that is done"""


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """The runs of a study whose signals a report is to include."""

    required: Sequence[int] = ()
    """Indices of runs that are included in any case"""
    most: int | None = None
    """Largest number of runs; None: that of the engine"""
    progress: Progress | None = None


def evenly(count: int, number: int) -> Iterator[int]:
    """At most `number` of the places 0 to count - 1, beginning with 0; a larger number adds to those of a smaller one.

    They are multiples of the golden ratio, which resonate with no axis of a grid.
    """
    step, taken = (math.sqrt(5.0) - 1.0) / 2.0, set[int]()
    if number >= count:
        yield from range(count)
        return
    k = 0
    while len(taken) < number:
        place = int(k * step % 1.0 * count)
        k += 1
        if place not in taken:
            taken.add(place)
            yield place


def select(indices: Sequence[int], required: Sequence[int], most: int) -> list[int]:
    """Indices of runs in the design: those `required`, then others up to `most`; in order."""
    selected = dict.fromkeys(required)
    for place in evenly(len(indices), min(most, len(indices))):
        if len(selected) >= max(most, len(required)):
            break
        selected[indices[place]] = None
    return sorted(selected)


def points_for(runs: int, columns: int) -> int:
    """The number of points that each of `runs` tracks may have."""
    return int(min(MAX_POINTS, max(MIN_POINTS, BYTES / _CODED / max(1, runs * columns))))
