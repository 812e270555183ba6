"""Second moments of a jump-linear system: their growth over a period, their stationary values, and the costs.

The mode of the system is a Markov chain, over modes that may differ from stage to stage of a period; the size of the
state may differ from mode to mode. A passage leads from a mode to one of the next stage with a probability, by a
`Piece`.
"""

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.theory.exact.branch import Piece
from orchestration.theory.exact.krylov import SIZE, Map, solve_fixed_point, spectral_radius_of
from orchestration.theory.stability.sign_changes import zero_between

MAX_MOMENTS = 100_000
"""numbers in the second moments of all modes together"""
MAX_FOURTH_PRODUCTS = 1e8
"""products to propagate fourth moments over a period"""
MOST_DOUBLINGS = 60
"""Most doublings of the number of periods in a sum"""
MOST_PERIODS, SUMMED = 1000, 1e-14
"""Periods in a sum, and the share of it at which what they add ends"""
PASSES, MOST_VECTORS = 4, 400
"""Vectors of a Krylov basis by the size of the state, and at most"""
DENSE = 1200
"""numbers up to which an operator is made a matrix"""
GROWTH = 1e-10
"""share of a growth factor's distance from that of the mean, to which it is found"""
GROWN = 30
"""periods after which moments are near those that grow longest, by which states are scaled"""


@dataclass(frozen=True)
class Passage:
    """From a mode of one stage to one of the next."""

    begin: int
    end: int
    probability: float
    piece: Piece


Stage = Sequence[Passage]


class JumpLinear:
    """A jump-linear system over one period of stages; the last one leads to the modes of the first."""

    def __init__(self, stages: Sequence[Stage], sizes: Sequence[Sequence[int]]) -> None:
        """`sizes` are those of the state, by stage and by mode before the stage."""
        self._stages, self._sizes = _without_transient_modes(stages, sizes)
        self._begin_where_smallest()
        self._stages, self._sizes = _without_unused_numbers(self._stages, self._sizes)
        self._basis = _SymmetricBasis(self._sizes[0])
        self.numbers = self._basis.count
        """Numbers in the second moments where the period begins"""
        if self.numbers > MAX_MOMENTS:
            raise UsageError(
                f"{len(self._sizes[0])} modes with {self.numbers} second moments, more than {MAX_MOMENTS}: "
                "expected fewer messages in transit, or states"
            )

    def _begin_where_smallest(self) -> None:
        """Rotate the stages so that the period begins where the second moments are fewest: least to solve for."""
        counts = [sum(n * n for n in sizes) for sizes in self._sizes]
        first = counts.index(min(counts))
        self._stages = [*self._stages[first:], *self._stages[:first]]
        self._sizes = [*self._sizes[first:], *self._sizes[:first]]

    @functools.cached_property
    def stationary_probabilities(self) -> list[Floats]:
        """The stationary probabilities of the modes, by stage."""
        count = len(self._sizes[0])
        chain: Floats = np.eye(count)
        for i in range(len(self._stages)):
            chain = self._step_of_chain(i) @ chain
        system = np.vstack([chain - np.eye(count), np.ones(count)])
        found: list[Floats] = [np.linalg.lstsq(system, np.append(np.zeros(count), 1.0), rcond=None)[0]]
        for i in range(len(self._stages) - 1):
            found.append(self._step_of_chain(i) @ found[-1])
        return found

    def _step_of_chain(self, i: int) -> Floats:
        found: Floats = np.zeros((len(self._sizes[(i + 1) % len(self._sizes)]), len(self._sizes[i])))
        for passage in self._stages[i]:
            found[passage.end, passage.begin] += passage.probability
        return found

    def _zero_moments(self, i: int) -> list[Floats]:
        return [np.zeros((n, n)) for n in self._sizes[i % len(self._sizes)]]

    @functools.cached_property
    def _batched_stages(self) -> list["_BatchedStage"]:
        return [
            _BatchedStage(
                [(p.begin, p.end, p.probability, p.piece.Z) for p in stage], self._sizes[(i + 1) % len(self._sizes)]
            )
            for i, stage in enumerate(self._stages)
        ]

    def _propagate(self, numbers: Floats) -> Floats:
        """Second moments a period later, without noise."""
        now = self._basis.matrices(numbers)
        for batches in self._batched_stages:
            now = batches.of(now)
        return self._basis.numbers(now)

    @functools.cached_property
    def radius(self) -> float:
        """The mean-square radius: the growth factor of second moments over a period."""
        if self._deterministic_map is not None:
            return _spectral_radius(self._deterministic_map) ** 2
        if self.numbers > DENSE and len(self._sizes[0]) == 1:
            return self._radius_beside_mean()
        return _radius(self._propagate, self._basis)

    @functools.cached_property
    def _mean_map(self) -> Floats:
        """The mean of the maps of the state over a period, where that begins in one mode."""
        now = [np.eye(self._sizes[0][0])]
        for i, stage in enumerate(self._stages):
            later = [np.zeros((n, len(now[0].T))) for n in self._sizes[(i + 1) % len(self._sizes)]]
            for p in stage:
                later[p.end] += p.probability * p.piece.Z @ now[p.begin]
            now = later
        return now[0]

    def _by_chance(self, growth: float) -> Map:
        """The moments that chance adds to those of the mean map in all periods, each counted less by a growth.

        The sum over the mean map is by doubling: a delay line of n messages, in which powers of the map end late, costs
        log n steps. What chance adds has few dimensions, those of the messages that are lost or not.
        """
        mean, only = self._mean_map, self._basis.matrices

        def added(numbers: Floats) -> Floats:
            ((before,), (after,)) = only(numbers), only(self._propagate(numbers))
            by_chance = (after - mean @ before @ mean.T) / growth
            return self._basis.numbers([_geometric_sum(mean / math.sqrt(growth), by_chance)])

        return added

    def _radius_beside_mean(self) -> float:
        """The radius: that growth at which what chance adds in all periods is as much as there was.

        The radius of what is added falls, from infinity or less at the growth of the mean map.
        """
        least = _spectral_radius(self._mean_map) ** 2
        scales = [np.diag(np.linalg.norm(root, axis=1)) for root in _scales(self._propagate, self._basis)]

        @functools.cache
        def below(growth: float) -> float:
            added = spectral_radius_of(_scaled(self._by_chance(growth), self._basis, scales), self._basis.identity)
            return 1.0 / added - 1.0 if added > 0.0 else math.inf

        high = max(1.0, 2.0 * least)
        while below(high) < 0.0:
            high *= 2.0
        low = high
        while below(low) >= 0.0:
            high, low = low, least + 0.25 * (low - least)
            if low - least <= 1e-12 * max(least, 1e-12):
                return least
        found, _ = zero_between(below, lambda value: value, (low, below(low)), (high, below(high)), GROWTH)
        return found

    @functools.cached_property
    def _deterministic_map(self) -> Floats | None:
        """The map of the state over a period, where only noise is random; None: more is."""
        if any(len(stage) != 1 for stage in self._stages):
            return None
        found: Floats = np.eye(self._sizes[0][0])
        for (passage,) in self._stages:
            found = passage.piece.Z @ found
        return found

    def stationary(self) -> list[Floats]:
        """The stationary second moments, by mode where the period begins; they exist where the radius is below 1."""
        first = self._after_period(self._zero_moments(0))[0]
        if self._deterministic_map is not None:
            return [_geometric_sum(self._deterministic_map, first[0])]
        added = self._basis.numbers(first)
        if self.numbers > DENSE and len(first) == 1:
            of_mean = self._basis.numbers([_geometric_sum(self._mean_map, first[0])])
            return self._basis.matrices(solve_fixed_point(self._by_chance(1.0), of_mean))
        if self.numbers > DENSE:
            return self._basis.matrices(self._sum_over_periods(added))
        operator = np.array([self._propagate(unit) for unit in np.eye(self.numbers)]).T
        return self._basis.matrices(np.linalg.solve(np.eye(self.numbers) - operator, added))

    def _sum_over_periods(self, added: Floats) -> Floats:
        """The moments that are added in each period, after all periods: by their sum, or near a radius of 1 solved for.

        In a Krylov basis they need not converge where a plant has states of very different sizes; the sum does.
        """
        if self.radius**MOST_PERIODS > SUMMED:
            return solve_fixed_point(self._propagate, added, _vectors(self._basis))
        found = added
        while np.linalg.norm(added) > SUMMED * (1.0 - self.radius) * np.linalg.norm(found):
            added = self._propagate(added)
            found = found + added
        return found

    def costs(self) -> Floats:
        """The stationary costs of a period, shape (costs,)."""
        return self._after_period(self.stationary())[1]

    def _after_period(self, moments: Sequence[Floats]) -> tuple[list[Floats], Floats]:
        """Second moments, by mode weighted by its probability, a period later, and the costs of the period."""
        now, costs = list(moments), np.zeros(len(self._stages[0][0].piece.c))
        for i, stage in enumerate(self._stages):
            later = self._zero_moments(i + 1)
            for p in stage:
                piece, share = p.piece, self.stationary_probabilities[i][p.begin]
                costs += p.probability * (np.einsum("kij,ij->k", piece.M, now[p.begin]) + share * piece.c)
                later[p.end] += p.probability * (piece.Z @ now[p.begin] @ piece.Z.T + share * piece.W)
            now = later
        return now, costs

    @property
    def _halves(self) -> list[list[int]]:
        """The numbers in the symmetric squares of the states, by stage and mode."""
        return [[n * (n + 1) // 2 for n in sizes] for sizes in self._sizes]

    @property
    def _fourth_products(self) -> int:
        """The number of products that propagate fourth moments over a period."""
        halves = self._halves
        return sum(halves[i][p.begin] ** 3 for i, stage in enumerate(self._stages) for p in stage)

    @property
    def fourth_moment_work(self) -> int:
        """The number of products that find the growth factor of fourth moments."""
        if self._deterministic_map is not None:
            return 0
        return self._fourth_products * int(_SymmetricBasis(self._halves[0]).count)

    @functools.cached_property
    def fourth_moment_radius(self) -> float | None:
        """The growth factor of fourth moments over a period; None where they are more than `DENSE`."""
        if self._deterministic_map is not None:
            return _spectral_radius(self._deterministic_map) ** 4
        halves, basis = self._halves, _SymmetricBasis(self._halves[0])
        if self._fourth_products > MAX_FOURTH_PRODUCTS:
            return None
        if basis.count > DENSE:  # by Krylov's method their rounding may grow faster than they do
            return None
        stages = [
            _BatchedStage(
                [(p.begin, p.end, p.probability, _symmetric_square(p.piece.Z)) for p in stage],
                halves[(i + 1) % len(halves)],
            )
            for i, stage in enumerate(self._stages)
        ]

        def propagate(numbers: Floats) -> Floats:
            now = basis.matrices(numbers)
            for batches in stages:
                now = batches.of(now)
            return basis.numbers(now)

        return _dense_radius(propagate, basis)


def _spectral_radius(matrix: Floats) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def _geometric_sum(turn: Floats, added: Floats) -> Floats:
    """The sum of Φᵏ W Φᵏᵀ over all k, by doubling; the powers of Φ decay."""
    found = added
    for _ in range(MOST_DOUBLINGS):
        more = turn @ found @ turn.T
        found, turn = found + more, turn @ turn
        if np.abs(more).max(initial=0.0) <= 1e-17 * np.abs(found).max(initial=0.0):
            break
    return found


def _radius(propagate: Map, basis: "_SymmetricBasis") -> float:
    if basis.count > SIZE:
        try:
            scaled = _scaled(propagate, basis, _scales(propagate, basis))
            return spectral_radius_of(scaled, basis.identity, _vectors(basis))
        except UsageError:
            if basis.count > DENSE:
                raise
    return _dense_radius(propagate, basis)


def _vectors(basis: "_SymmetricBasis") -> int:
    """Vectors of a Krylov basis: more than a message on its way needs to pass all others, for a part of it each."""
    return min(MOST_VECTORS, max(SIZE, PASSES * max(basis.sizes)))


def _dense_radius(propagate: Map, basis: "_SymmetricBasis") -> float:
    return _spectral_radius(
        np.array([propagate(unit) for unit in np.eye(basis.count)]).reshape(basis.count, basis.count)
    )


def _scales(propagate: Map, basis: "_SymmetricBasis") -> list[Floats]:
    """The roots of the moments that grow longest, by mode: coordinates in which these are near those of independent
    states of size 1.

    In others, as those of a fast plant beside a slow one, eigenvalues of a map in a Krylov basis may be far off.
    """
    grown = basis.identity
    for _ in range(GROWN):
        grown = propagate(grown)
        grown /= max(float(np.linalg.norm(grown)), 1e-300)
    roots = []
    for moments in basis.matrices(grown):
        sizes = np.sqrt(np.maximum(np.diag(moments), max(1e-20 * np.diag(moments).max(initial=0.0), 1e-300)))
        roots.append(sizes[:, None] * np.linalg.cholesky(moments / np.outer(sizes, sizes) + 1e-12 * np.eye(len(sizes))))
    return roots


def _scaled(of: Map, basis: "_SymmetricBasis", roots: Sequence[Floats]) -> Map:
    """A map in the coordinates of `_scales`."""
    inverses = [np.asarray(np.linalg.inv(root)) for root in roots]

    def turned(numbers: Floats, by: Sequence[Floats]) -> Floats:
        return basis.numbers([root @ each @ root.T for root, each in zip(by, basis.matrices(numbers))])

    return lambda numbers: turned(of(turned(numbers, roots)), inverses)


class _BatchedStage:
    """The passages of a stage, batched by the shapes of their matrices."""

    def __init__(self, passages: Sequence[tuple[int, int, float, Floats]], sizes: Sequence[int]) -> None:
        self._sizes = sizes
        shapes: dict[tuple[int, ...], list[tuple[int, int, float, Floats]]] = {}
        for passage in sorted(passages, key=lambda one: one[1]):
            shapes.setdefault(passage[3].shape, []).append(passage)
        self._parts = []
        for listed in shapes.values():
            begins = [begin for begin, _, _, _ in listed]
            ends, first = np.unique([end for _, end, _, _ in listed], return_index=True)
            weighted = np.array([p * Z for _, _, p, Z in listed])
            self._parts.append((begins, weighted, np.array([Z.T for _, _, _, Z in listed]), ends.tolist(), first))

    def of(self, moments: Sequence[Floats]) -> list[Floats]:
        """The moments after the stage."""
        found: list[Floats] = [np.zeros((n, n)) for n in self._sizes]
        for begins, weighted, transposed, ends, first in self._parts:
            each = weighted @ np.array([moments[begin] for begin in begins]) @ transposed
            for end, summed in zip(ends, np.add.reduceat(each, first, axis=0)):
                found[end] += summed
        return found


class _SymmetricBasis:
    """Symmetric matrices of given sizes as one row of numbers: their upper triangles."""

    def __init__(self, sizes: Sequence[int]) -> None:
        self._triangles = [np.triu_indices(n) for n in sizes]
        self.sizes = sizes
        self._cuts = np.cumsum([len(rows) for rows, _ in self._triangles]).tolist()
        self.count = self._cuts[-1]
        self.identity = self.numbers([np.eye(n) for n in sizes])

    def matrices(self, numbers: Floats) -> list[Floats]:
        """The matrices of a row."""
        found = []
        for n, (rows, columns), part in zip(self.sizes, self._triangles, np.split(numbers, self._cuts)):
            matrix = np.zeros((n, n))
            matrix[rows, columns] = part
            matrix[columns, rows] = part
            found.append(matrix)
        return found

    def numbers(self, matrices: Sequence[Floats]) -> Floats:
        """The row of matrices."""
        return np.concatenate([each[rows, columns] for each, (rows, columns) in zip(matrices, self._triangles)])


def _symmetric_square(Z: Floats) -> Floats:
    """The map z z' -> Z z z' Z' as a matrix over upper triangles: (i, j) by (k, m)."""
    (i, j), (k, m) = np.triu_indices(Z.shape[0]), np.triu_indices(Z.shape[1])
    found: Floats = Z[np.ix_(i, k)] * Z[np.ix_(j, m)]
    off_diagonal = k != m
    found[:, off_diagonal] += (Z[np.ix_(i, m)] * Z[np.ix_(j, k)])[:, off_diagonal]
    return found


def _without_transient_modes(
    stages: Sequence[Stage], sizes: Sequence[Sequence[int]]
) -> tuple[list[Stage], list[Sequence[int]]]:
    """The stages without transient modes."""
    count = len(sizes[0])
    reach = np.eye(count, dtype=bool)
    for i, stage in enumerate(stages):
        step = np.zeros((len(sizes[(i + 1) % len(sizes)]), len(sizes[i])), dtype=bool)
        for p in stage:
            step[p.end, p.begin] |= p.probability > 0.0
        reach = (step.astype(int) @ reach.astype(int)) > 0
    closure = reach | np.eye(count, dtype=bool)
    for _ in range(max(1, math.ceil(math.log2(count + 1)))):
        closure = (closure.astype(int) @ closure.astype(int)) > 0
    stays = np.array([all(closure[m, k] for k in np.flatnonzero(closure[:, m])) for m in range(count)])
    return _restricted(stages, sizes, [stays])


def _restricted(
    stages: Sequence[Stage], sizes: Sequence[Sequence[int]], first: list[Booleans]
) -> tuple[list[Stage], list[Sequence[int]]]:
    """The stages with only the modes kept in the first, and those that they lead to."""
    kept = first
    for i, stage in enumerate(stages[:-1]):
        later = np.zeros(len(sizes[i + 1]), dtype=bool)
        for p in stage:
            later[p.end] |= bool(kept[i][p.begin]) and p.probability > 0.0
        kept.append(later)
    places = [np.cumsum(keep) - 1 for keep in kept]
    found: list[Stage] = []
    for i, stage in enumerate(stages):
        then = places[(i + 1) % len(stages)]
        found.append(
            [
                Passage(int(places[i][p.begin]), int(then[p.end]), p.probability, p.piece)
                for p in stage
                if kept[i][p.begin] and p.probability > 0.0
            ]
        )
    return found, [[n for n, keep in zip(stage, keeps) if keep] for stage, keeps in zip(sizes, kept)]


def _without_unused_numbers(
    stages: Sequence[Stage], sizes: Sequence[Sequence[int]]
) -> tuple[list[Stage], list[Sequence[int]]]:
    """The stages without numbers of the state on which nothing later depends."""
    live = [[np.ones(n, dtype=bool) for n in stage] for stage in sizes]
    changed = True
    while changed:
        changed = False
        for i in reversed(range(len(stages))):
            then = live[(i + 1) % len(stages)]
            used = [np.zeros(n, dtype=bool) for n in sizes[i]]
            for p in stages[i]:
                used[p.begin] |= p.piece.Z[then[p.end]].any(axis=0) | p.piece.M.any(axis=(0, 1))
            for keep, use in zip(live[i], used):
                if (keep & ~use).any():
                    keep &= use
                    changed = True
    found: list[Stage] = []
    for i, stage in enumerate(stages):
        then = live[(i + 1) % len(stages)]
        found.append(
            [
                Passage(p.begin, p.end, p.probability, _restricted_piece(p.piece, live[i][p.begin], then[p.end]))
                for p in stage
            ]
        )
    return found, [[int(keep.sum()) for keep in stage] for stage in live]


def _restricted_piece(piece: Piece, before: Booleans, after: Booleans) -> Piece:
    return Piece(
        piece.Z[np.ix_(after, before)], piece.W[np.ix_(after, after)], piece.M[:, before][:, :, before], piece.c
    )
