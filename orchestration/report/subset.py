"""Which runs of a study get their signals into a report: those asked for, then evenly over the design."""

import math
from collections.abc import Iterator, Sequence

MOST = 1000
"""default number of runs whose signals are in a report"""
ALONE = 60
"""likewise where each is flown by its FMUs, one after the other"""
BYTES = 8_000_000
"""Characters that the signals of all of them may take"""
MOST_POINTS, LEAST_POINTS = 400, 40
"""of a run"""
_CODED = 2.0 * 4.0 / 3.0
"""Characters of a number"""


def evenly(count: int, wanted: int) -> Iterator[int]:
    """At most `wanted` of the places 0 to count - 1: the first is in, more of them leave those that are.

    By multiples of the golden ratio, so that no axis of a grid is hit in step.
    """
    step, found = (math.sqrt(5.0) - 1.0) / 2.0, set[int]()
    if wanted >= count:
        yield from range(count)
        return
    k = 0
    while len(found) < wanted:
        place = int(k * step % 1.0 * count)
        k += 1
        if place not in found:
            found.add(place)
            yield place


def chosen(indices: Sequence[int], first: Sequence[int], most: int) -> list[int]:
    """Of the runs with these indices in the design: those of `first`, then others up to `most`; in order."""
    found = dict.fromkeys(first)
    for place in evenly(len(indices), min(most, len(indices))):
        if len(found) >= max(most, len(first)):
            break
        found[indices[place]] = None
    return sorted(found)


def points_for(runs: int, columns: int) -> int:
    """How many points each of so many runs may have."""
    return int(min(MOST_POINTS, max(LEAST_POINTS, BYTES / _CODED / max(1, runs * columns))))
