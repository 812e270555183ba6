"""The linear maps of a loop from one period to the next: products of a few matrices and flows.

The events of a period are a *letter*: a message that arrives after τ, a message that is lost. Its map is a product of
matrices, and of exponentials exp(G t) with t affine in the letter's parameters τ, each of which is anywhere in an
interval. Modes determine which letters may follow one another: a letter moves from a mode to another.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestration.foundation.basics.simulator import Floats

MOST_CONDITION = 1e9
"""Condition number of a basis from which on rounding may count"""


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
    states: tuple[tuple[int, ...], ...] = ()
    """the coordinates of each component's state: combinations of them describe it as well"""

    @property
    def size(self) -> int:
        """The size of each matrix."""
        return len(next(iter(self.matrices.values())))

    def largest(self) -> list[float]:
        """The largest value of each parameter, over all letters."""
        return [max(high for _, high in ends) for ends in zip(*(letter.ranges for letter in self.letters))]

    def at(self, letter: Letter, point: Sequence[float] = ()) -> Floats:
        """The map of a letter at values of its parameters, of the kept coordinates."""
        from scipy.linalg import expm

        total = np.eye(self.size)[:, self.kept]
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
        places = {int(place): i for i, place in enumerate(used)}
        states = tuple(tuple(places[i] for i in state if i in places) for state in self.states)
        return replace(self, matrices=matrices, kept=tuple(places[i] for i in self.kept), states=states)

    def mixed(self) -> list[list[int]]:
        """The kept coordinates of each component's state, which may be combined, and each other coordinate alone."""
        own = [[i for i in state if i in self.kept] for state in self.states]
        return [*filter(None, own), *([i] for i in range(self.size) if not any(i in each for each in own))]

    def accepts(self, basis: Floats) -> bool:
        """Whether a basis combines coordinates of a component's state only, and has an inverse well above rounding."""
        if basis.shape != (self.size, self.size) or not np.linalg.cond(basis) < MOST_CONDITION:
            return False
        return not np.delete(basis.ravel(), [i * self.size + j for g in self.mixed() for i in g for j in g]).any()

    def in_basis(self, basis: Floats) -> "LoopFamily":
        """The family of the state basis · z, in which only coordinates of a component's state are combined.

        What copies or ignores a value does so exactly.
        """
        back, groups, matrices = np.linalg.inv(basis), self.mixed(), dict[str, Floats]()
        for name, M in self.matrices.items():
            found = basis @ M @ back
            for rows in groups:
                for columns in groups:
                    inside = np.ix_(rows, columns)
                    copies = rows == columns and np.array_equal(M[inside], np.eye(len(rows)))
                    if copies or not M[inside].any():
                        found[inside] = M[inside]
            matrices[name] = found
        return replace(self, matrices=matrices)
