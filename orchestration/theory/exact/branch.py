"""A branch: one course of events of a loop up to a time, and the events that it plans. Times are whole attoseconds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from orchestration.theory.exact.pieces import Piece


class BranchEvent(NamedTuple):
    """A future event; events are ordered by these fields."""

    time: int
    phase: int
    rank: int
    birth: int
    kind: str
    of: int
    token: int
    """of its message; -1: it has none"""
    place: int = 0
    """of a sample or a posted message: its index among the offsets of a period"""


ARRIVES, POSTS, MEASURES, SAMPLES = 1, 2, 3, 4
"""Phases of an instant"""
NEVER = 10**40
"""Time of an event that waits for the next sample of its sender"""


@dataclass(frozen=True)
class Branch:
    """One course of events up to a time."""

    time: int
    events: tuple[BranchEvent, ...]
    """future ones, in order"""
    in_transit: tuple[tuple[int, int], ...]
    """messages in the order of their numbers in the state: token and size"""
    bursts: tuple[bool, ...]
    holds: tuple[tuple[int, int | None], ...]
    """by link: the time of the last arrival, and its gap to the one before"""
    born: int
    """count of events and messages so far"""
    probability: float
    piece: Piece


Mode = tuple[
    tuple[tuple[int, int, int, str, int, int, int], ...],
    tuple[int, ...],
    tuple[bool, ...],
    tuple[tuple[int, int | None], ...],
]
"""What is known at a cut of the future: events without `birth`, sizes of messages, bursts, holds"""
