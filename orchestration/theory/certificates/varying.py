"""The quantities that vary from draw to draw, and their draws: times in attoseconds."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

JITTER, DELAY, LOSS = "jitter", "delay_jitter", "loss"
SHIFT, LATENCY = "shift", "latency"
BOXES = 6
"""Boxes that cover two quantities with a limited sum"""

Point = tuple[int, ...]
"""A value of each quantity"""


@dataclass(frozen=True)
class Varying:
    """A quantity that varies from draw to draw."""

    kind: str
    """`jitter` of a sampled component, which delays its messages, or its `shift`, which does not; the `latency` of all
    that it sends; `delay_jitter` or `loss` of a connection"""
    name: str
    """Name of the component or connection"""
    path: str


@dataclass(frozen=True)
class Draws:
    """The range of one draw: each quantity from 0 to its largest value, the sum of two at most `largest_sum`."""

    largest: Sequence[int]
    largest_sum: int

    def corners(self) -> list[Point]:
        """Points whose convex hull contains all draws."""
        if len(self.largest) < 2:
            return [*itertools.product(*((0, J) for J in self.largest))]
        bend = min(max(self.largest_sum - self.largest[1], 0), self.largest[0])
        return [(x, y) for x in (0, bend, self.largest[0]) for y in (0, self._largest_second(x))]

    def boxes(self) -> list[tuple[tuple[int, int], ...]]:
        """The ends, along each quantity, of boxes that cover all draws of two of them."""
        first, second = self.largest
        count = 1 if self.largest_sum >= first + second else BOXES
        ends = [first * i // count for i in range(count + 1)]
        return [((low, high), (0, self._largest_second(low))) for low, high in itertools.pairwise(ends)]

    def _largest_second(self, first: int) -> int:
        """The largest value of the second quantity for one of the first."""
        return min(self.largest[1], self.largest_sum - first)
