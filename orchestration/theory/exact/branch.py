"""A branch: one course of events of a loop up to a time, and the events that it plans. Times are whole attoseconds."""

import bisect
from dataclasses import dataclass
from typing import NamedTuple

from orchestration.theory.exact.pieces import Piece

ARRIVES, POSTS, MEASURES, SAMPLES, SETTLES = 1, 2, 3, 4, 5
"""Phases of an instant; what arrives at a component in continuous time acts on its outputs only after the samples"""
NEVER = 10**40
"""Time of an event that waits for the next sample of its sender"""


class BranchEvent(NamedTuple):
    """A future event; events are in the order of time, phase and rank, then in that in which they were planned."""

    time: int
    phase: int
    rank: int
    kind: str
    of: int
    """its task or link"""
    size: int = 0
    """numbers of the message that arrives; 0: it brings none"""
    place: int = 0
    """Index among the offsets of a period, of a sample or a posted message; of a measurement: the time until its sample
    """

    def later(self, by: int) -> "BranchEvent":
        """The event, later by a time."""
        return self if self.time == NEVER else self._replace(time=self.time + by)


Events = tuple[BranchEvent, ...]
"""Events in order; the numbers of messages in transit are in the state in this order, too"""


def place_in(events: Events, event: BranchEvent) -> int:
    """The index at which an event is inserted."""
    return bisect.bisect(events, event[:3], key=lambda one: one[:3])


def in_transit(events: Events) -> list[int]:
    """The links of the messages in transit, in order."""
    return [event.of for event in events if event.size]


@dataclass(frozen=True)
class Branch:
    """One course of events up to a time."""

    time: int
    events: Events
    """future ones"""
    bursts: tuple[bool, ...]
    """Flags by link: whether the last message was lost, in a burst"""
    holds: tuple[tuple[int, int | None], ...]
    """Times by link: that of the last arrival, and its gap to the one before"""
    piece: Piece
    probability: float = 1.0


Mode = tuple[Events, tuple[bool, ...], tuple[tuple[int, int | None], ...]]
"""Things known at a cut of the future: events, bursts and holds, in times from the cut"""
