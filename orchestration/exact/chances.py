"""What is left to chance about a time, as values with probabilities: as they are, or by Gauss's rule for a density."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from orchestration.basics.simulator import Floats

Draw = tuple[int, float]
"""A value, and its probability"""
Kinks = Callable[[int, int], Sequence[int]]
"""The times strictly between two times at which what comes of an instant may bend"""


def no_kinks(low: int, high: int) -> Sequence[int]:
    """None."""
    return ()


@dataclass(frozen=True)
class Chance:
    """A random amount of time, in whole units of whoever uses it."""

    values: tuple[int, ...] = (0,)
    """all that there are, or the two ends of a density"""
    probabilities: tuple[float, ...] = (1.0,)
    """of the values; empty for a density"""
    deviation: float | None = None
    """of a density that is normal about its middle, cut to its ends; None: uniform"""

    @property
    def is_density(self) -> bool:
        """Whether there are more values than can be listed."""
        return not self.probabilities

    @property
    def lowest(self) -> int:
        """The least value."""
        return min(self.values)

    @property
    def highest(self) -> int:
        """The largest one."""
        return max(self.values)

    @property
    def is_certain(self) -> bool:
        """Whether there is one value only."""
        return self.lowest == self.highest

    def draws(self, base: int, kinks: Kinks, order: int) -> list[Draw]:
        """The values, with probabilities.

        Of a density as many as the order has in each part between the `kinks` of `base` plus the value: by these,
        integrals of what is smooth there are exact but for what falls off faster than any power of the order.
        """
        if self.is_certain:
            return [(self.lowest, 1.0)]
        if not self.is_density:
            return list(zip(self.values, self.probabilities))
        low, high = self.lowest, self.highest
        edges = [base + low, *kinks(base + low, base + high), base + high]
        found: list[Draw] = []
        for a, b in itertools.pairwise(edges):
            nodes, weights = self._rule((a - base - low) / (high - low), (b - base - low) / (high - low), order)
            found += [(a - base + round((b - a) * node), weight) for node, weight in zip(nodes, weights)]
        total = sum(weight for _, weight in found)
        return [(value, weight / total) for value, weight in found]

    def _rule(self, a: float, b: float, order: int) -> tuple[Sequence[float], Sequence[float]]:
        """Nodes, as shares of a part of [0, 1], the whole range, and their weights there."""
        if self.deviation is None:
            nodes, weights = _legendre(order)
            return nodes.tolist(), ((b - a) * weights).tolist()
        nodes, weights = _legendre(FINE)
        apart = (a + (b - a) * nodes - 0.5) * (self.highest - self.lowest) / self.deviation
        return gauss_of(nodes, (b - a) * weights * np.exp(-0.5 * apart**2), order)


FINE = 120
"""nodes by which a density is known from which those of its own rule are made"""


@functools.lru_cache(maxsize=64)
def _legendre(order: int) -> tuple[Floats, Floats]:
    """Nodes and weights over [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def gauss_of(values: Floats, weights: Floats, order: int) -> tuple[Sequence[float], Sequence[float]]:
    """As few nodes, with weights, as give the same integrals of polynomials up to degree 2 order - 1.

    By Lanczos: the nodes are the eigenvalues of what multiplication by the value is over the first polynomials.
    """
    total = float(weights.sum())
    root = np.sqrt(weights / total)
    basis, diagonal, beside = [root], list[float](), list[float]()
    for _ in range(order):
        raised = values * basis[-1]
        diagonal.append(float(raised @ basis[-1]))
        for each in (*basis, *basis):  # twice: what rounding leaves of the others
            raised = raised - (raised @ each) * each
        beside.append(float(np.linalg.norm(raised)))
        if beside[-1] < ALONE:
            break
        basis.append(raised / beside[-1])
    count = len(diagonal)
    nodes, vectors = np.linalg.eigh(
        np.diag(diagonal) + np.diag(beside[: count - 1], 1) + np.diag(beside[: count - 1], -1)
    )
    return nodes.tolist(), (total * vectors[0] ** 2).tolist()


ALONE = 1e-14
"""of a polynomial that is none: there are no more values than nodes"""

CERTAIN = Chance()
"""0"""


def uniform(low: int, high: int) -> Chance:
    """Any value between the two, each as likely."""
    return Chance((low, high), ()) if high > low else Chance((low,))


def cut_normal(low: int, high: int, deviation: float) -> Chance:
    """Normal about the middle, cut to the two."""
    return Chance((low, high), (), deviation) if high > low else Chance((low,))
