"""The linear maps of a loop from one period to the next: products of a few matrices and flows.

The events of a period are a *letter*: a message that arrives after τ, a message that is lost. Its map is a product of
matrices, and of exponentials exp(G t) with t affine in the letter's parameters τ, each of which is anywhere in an
interval. Modes determine which letters may follow one another: a letter moves from a mode to another.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestration.foundation.basics.simulator import Floats


@dataclass(frozen=True, kw_only=True)
class Factor:
    """One factor of a product: the matrix of that name, or exp(matrix · t)."""

    matrix: str
    times: tuple[float, ...] | None = None
    """t = times[0] + times[1] τ₁ + …; None: the matrix itself"""

    def lasts(self, point: Sequence[float]) -> float:
        """t at values of the parameters."""
        assert self.times is not None
        return self.times[0] + sum(c * x for c, x in zip(self.times[1:], point))


@dataclass(frozen=True, kw_only=True)
class Letter:
    """The possible events of a period."""

    name: str
    moves: tuple[tuple[int, int], ...] = ((0, 0),)
    """Moves from a mode to another"""
    product: tuple[Factor, ...]
    """Factors in the order in which they are applied"""
    ranges: tuple[tuple[float, float], ...] = ()
    """Ranges of each parameter"""


@dataclass(frozen=True, kw_only=True)
class LoopFamily:
    """All letters, with their matrices."""

    matrices: Mapping[str, Floats]
    """Matrices by name, all of one size"""
    kept: tuple[int, ...]
    """the coordinates that matter from one period to the next; nothing depends on earlier values of the others"""
    letters: tuple[Letter, ...]

    def largest(self) -> list[float]:
        """The largest value of each parameter, over all letters."""
        return [max(high for _, high in ends) for ends in zip(*(letter.ranges for letter in self.letters))]

    def at(self, letter: Letter, point: Sequence[float] = ()) -> Floats:
        """The map of a letter at values of its parameters, of the kept coordinates."""
        from scipy.linalg import expm

        size = len(next(iter(self.matrices.values())))
        total = np.eye(size)[:, self.kept]
        for factor in letter.product:
            matrix = self.matrices[factor.matrix]
            total = (matrix if factor.times is None else expm(matrix * factor.lasts(point))) @ total
        return total[list(self.kept)]

    def without_idle(self) -> "LoopFamily":
        """The family without coordinates on whose values at the beginning of a period nothing depends."""
        samples = [abs(self.at(x, [low + share * (high - low) for low, high in x.ranges]))
                   for x in self.letters for share in (0.0, 0.37, 1.0)]  # fmt: skip
        total = np.sum(samples, axis=0)
        alive = np.arange(len(self.kept))
        while len(used := alive[(total[np.ix_(alive, alive)] > 0.0).any(axis=0)]) < len(alive):
            alive = used
        return replace(self, kept=tuple(self.kept[i] for i in alive))._without_unused()

    def _without_unused(self) -> "LoopFamily":
        """The family without coordinates that no kept one depends on, not even within a period."""
        acts, used = np.sum([abs(M) for M in self.matrices.values()], axis=0) > 0.0, np.zeros(0, dtype=int)
        then = np.array(self.kept)
        while len(then) > len(used):
            used, then = then, np.union1d(then, np.flatnonzero(acts[then].any(axis=0)))
        matrices = {name: M[np.ix_(used, used)] for name, M in self.matrices.items()}
        return replace(self, matrices=matrices, kept=tuple(np.searchsorted(used, self.kept).tolist()))
