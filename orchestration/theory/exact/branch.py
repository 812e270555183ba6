"""A branch: one course of events of a loop up to a time, a linear map of its state, and the events that it plans."""

from __future__ import annotations

import bisect
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.exact.flows import Flow


@dataclass(frozen=True)
class Piece:
    """From a state z of n numbers to one of m: Z z + w, at the costs z'M z + c."""

    Z: Floats
    """shape (m, n)"""
    W: Floats
    """covariance of w, shape (m, m)"""
    M: Floats
    """shape (costs, n, n)"""
    c: Floats
    """shape (costs,)"""

    @staticmethod
    def start(size: int, costs: int) -> Piece:
        """The identity."""
        return Piece(np.eye(size), np.zeros((size, size)), np.zeros((costs, size, size)), np.zeros(costs))

    def flowed(self, flow: Flow) -> Piece:
        """After a flow of the first numbers of the state; the others, messages in transit, stay."""
        n = len(flow.change)
        head = self.Z[:n]
        Z, W = self.Z.copy(), self.W.copy()
        Z[:n] = flow.matrix @ head
        W[:n] = flow.matrix @ W[:n]
        W[:, :n] = W[:, :n] @ flow.matrix.T
        W[:n, :n] += flow.covariance
        c = self.c + np.einsum("kij,ij->k", flow.costs, self.W[:n, :n]) + flow.extra
        return Piece(Z, W, self.M + head.T @ flow.costs @ head, c)

    def mapped(self, change: Floats, covariance: Floats | None = None) -> Piece:
        """After a linear map of the state, which may change its size, and noise of a covariance."""
        W = change @ self.W @ change.T
        return replace(self, Z=change @ self.Z, W=W if covariance is None else W + covariance)

    def charged(self, Q: Floats) -> Piece:
        """With the costs z'Q z of the present state added, Q of its first numbers."""
        n = Q.shape[-1]
        head = self.Z[:n]
        return Piece(
            self.Z, self.W, self.M + head.T @ Q @ head, self.c + np.einsum("kij,ij->k", Q, self.W[:n, :n])
        )  # fmt: skip


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

    def later(self, by: int) -> BranchEvent:
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
