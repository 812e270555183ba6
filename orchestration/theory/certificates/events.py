"""The events of a loop in which something varies from draw to draw, and the draws: times in nanoseconds."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

JITTER, DELAY, LOSS = "jitter", "delay_jitter", "loss"
SHIFT, LATENCY = "shift", "latency"
BOXES = 6
"""that cover two quantities with a limited sum"""


@dataclass(frozen=True)
class Varying:
    """A quantity that varies from draw to draw."""

    kind: str
    """`jitter` of a sampled component, which delays its messages, or its `shift`, which does not; the `latency` of all
    that it sends; `delay_jitter` or `loss` of a connection"""
    name: str
    """of the component or connection"""
    path: str


@dataclass(frozen=True)
class LoopEvent:
    """An event at `time` + `slopes` · parameters [ns]; events at one instant are in the order of `rank`."""

    time: Fraction
    slopes: tuple[int, ...]
    rank: tuple[int, ...]
    kind: str
    """measure, sample or arrive"""
    subject: str
    """a component or connection"""

    def later(self, by: Fraction) -> LoopEvent:
        """The event, later by a time [ns]."""
        return LoopEvent(self.time + by, self.slopes, self.rank, self.kind, self.subject)

    def at(self, point: Sequence[Fraction]) -> Fraction:
        """Its time at values of the parameters."""
        return self.time + sum((s * x for s, x in zip(self.slopes, point)), Fraction(0))


@dataclass(frozen=True)
class Draws:
    """The range of one draw: each quantity from 0 to its largest value, the sum of two at most `largest_sum` [ns]."""

    largest: Sequence[Fraction]
    largest_sum: Fraction

    def corners(self) -> list[tuple[Fraction, ...]]:
        """Points whose convex hull contains all draws."""
        if len(self.largest) < 2:
            return [*itertools.product(*((Fraction(0), J) for J in self.largest))]
        bend = min(max(self.largest_sum - self.largest[1], Fraction(0)), self.largest[0])
        return [(x, y) for x in (Fraction(0), bend, self.largest[0]) for y in (Fraction(0), self._largest_second(x))]

    def boxes(self) -> list[list[tuple[Fraction, Fraction]]]:
        """Boxes that cover all draws of two quantities."""
        first, second = self.largest
        count = 1 if self.largest_sum >= first + second else BOXES
        ends = [first * i / count for i in range(count + 1)]
        return [[(low, high), (Fraction(0), self._largest_second(low))] for low, high in itertools.pairwise(ends)]

    def _largest_second(self, first: Fraction) -> Fraction:
        """The largest value of the second quantity for one of the first."""
        return min(self.largest[1], self.largest_sum - first)


def first_time(group: Sequence[LoopEvent], corners: Sequence[Sequence[Fraction]]) -> Fraction:
    """The earliest time of an event of a group, over all draws."""
    return min(event.at(corner) for event in group for corner in corners)


def last_time(group: Sequence[LoopEvent], corners: Sequence[Sequence[Fraction]]) -> Fraction:
    """The latest time of an event of a group, over all draws, and 1 ns: others of its instant may come before it."""
    return max(event.at(corner) for event in group for corner in corners) + 1
