"""The flow of a linear system over a time, with its costs: exponentials and their integrals, by doubling.

Van Loan's block exponential contains e^(-At), which overflows for stiff plants; here the series over a short time is
doubled, in which decaying terms only decay.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from orchestration.foundation.basics.simulator import Floats

SHORT = 0.25
"""norm of F h up to which the series is used"""
TERMS = 18
"""Terms of the series: the next one is below rounding, also for the covariance, whose rate is twice that of the state
"""


@dataclass(frozen=True)
class Flow:
    """z' = F z + w over a time, w white of covariance R, and the integrals of z'Q z for some Q."""

    change: Floats
    """e^(Ft) - I, which keeps digits of slow modes that e^(Ft) loses"""
    covariance: Floats
    """Covariance of the noise added"""
    costs: Floats
    """M, shape (costs, n, n): the integral of each z'Q z is z(0)'M z(0) plus `extra`"""
    extra: Floats
    """shape (costs,): due to the noise"""

    @functools.cached_property
    def matrix(self) -> Floats:
        """e^(Ft)"""
        return np.eye(len(self.change)) + self.change

    def doubled(self) -> "Flow":
        """The flow over twice the time."""
        change, matrix = self.change, self.matrix
        return Flow(
            change=2.0 * change + change @ change,
            covariance=self.covariance + matrix @ self.covariance @ matrix.T,
            costs=self.costs + matrix.T @ self.costs @ matrix,
            extra=2.0 * self.extra + _traces(self.costs, self.covariance),
        )


class Flows:
    """The flows of one system over any times, each computed once."""

    def __init__(self, F: Floats, R: Floats, Q: Floats) -> None:
        """`F` and `R` of shape (n, n), `Q` of shape (costs, n, n)."""
        self._F, self._R, self._Q = F, R, Q
        size = np.abs(F).sum(axis=1).max(initial=0.0)
        self._rate = min(float(size), float(np.abs(F).sum(axis=0).max(initial=0.0)))
        self._known: dict[float, Flow] = {}

    def over(self, time: float) -> Flow:
        """The flow over `time` [s]."""
        if time not in self._known:
            doublings = max(0, math.ceil(math.log2(self._rate * time / SHORT))) if self._rate * time > 0.0 else 0
            flow = self._series(time / 2**doublings)
            for _ in range(doublings):
                flow = flow.doubled()
            self._known[time] = flow
        return self._known[time]

    def _series(self, h: float) -> Flow:
        F, Q = self._F * h, self._Q
        change, term = np.zeros_like(F), np.eye(len(F))
        covariance, grown = np.zeros_like(F), self._R * h
        costs, summand = np.zeros_like(Q), Q * h
        extra = np.zeros(len(Q))
        for k in range(1, TERMS + 1):
            term = F @ term / k
            change = change + term
            covariance, costs = covariance + grown, costs + summand
            extra = extra + _traces(Q, grown) * h / (k + 1)
            grown = (F @ grown + grown @ F.T) / (k + 1)
            summand = (F.T @ summand + summand @ F) / (k + 1)
        return Flow(change, covariance, costs, extra)


def _traces(costs: Floats, covariance: Floats) -> Floats:
    return np.asarray(np.einsum("kij,ij->k", costs, covariance))
