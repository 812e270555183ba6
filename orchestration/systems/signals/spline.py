"""Curves through points at given times: polynomials of degree nine, at rest at both ends.

Of all curves through the points that are at rest at both ends, up to the fourth derivative, the one with the least
∫ |d⁵P/dt⁵|² dt. Its first four derivatives are continuous by construction (neighbours share them), and so are the
fifth to the eighth, as the integral is least. It is the analogue for four derivatives of minimum snap, which is for
three (Mellinger and Kumar 2011).
"""

import functools
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.simulator import Floats

ORDERS = 5
"""The value and four derivatives"""
DEGREE = 2 * ORDERS - 1


@dataclass(frozen=True, kw_only=True)
class Spline:
    """Polynomials between knots (n + 1,) [s]; at rest before the first and after the last.

    `coefficients` (n, 10, 3) are by powers of the elapsed share of the time between two knots.
    """

    knots: Floats
    coefficients: Floats

    def at(self, t: Floats) -> Floats:
        """Position and its first four derivatives at times `t` (m,) [s], shape (m, 5, 3)."""
        piece = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.knots) - 2)
        spans = self.knots[piece + 1] - self.knots[piece]
        share = np.clip((t - self.knots[piece]) / spans, 0.0, 1.0)
        terms = self.coefficients[piece]
        moves = ((t > self.knots[0]) & (t < self.knots[-1])).astype(float)
        found = np.empty((len(t), ORDERS, 3))
        per_span = np.ones(len(t))
        for order in range(ORDERS):
            value = terms[:, -1]
            for power in range(terms.shape[1] - 2, -1, -1):
                value = value * share[:, None] + terms[:, power]
            found[:, order] = value * (per_span * (moves if order else 1.0))[:, None]
            terms = terms[:, 1:] * np.arange(1.0, terms.shape[1])[:, None]
            per_span = per_span / spans
        return found


def through(times: Floats, points: Floats) -> Spline:
    """The curve through `points` (n, 3) at increasing `times` (n,) [s], at rest at the first and the last."""
    spans: Floats = np.diff(times)
    scale = float(spans.mean())
    derivatives = _derivatives(spans / scale, points)
    powers = scale ** -np.arange(ORDERS)
    derivatives = derivatives * powers[:, None]
    return Spline(knots=times, coefficients=_coefficients(spans, derivatives))


def _coefficients(spans: Floats, derivatives: Floats) -> Floats:
    """The coefficients of the pieces between knots with these derivatives, shape (n + 1, 5, 3)."""
    scaled = derivatives[:-1] * spans[:, None, None] ** np.arange(ORDERS)[:, None]
    ends = derivatives[1:] * spans[:, None, None] ** np.arange(ORDERS)[:, None]
    begin = scaled[:, 0].copy()
    for each in (scaled, ends):
        each[:, 0] -= begin  # relative to its start, which loses no digits far from the origin
    result: Floats = np.einsum("ij,njk->nik", _exact_matrices()[0], np.concatenate([scaled, ends], axis=1))
    result[:, 0] += begin
    return result


def _derivatives(spans: Floats, points: Floats) -> Floats:
    """Position and derivatives at the knots, shape (n, 5, 3), by elimination from knot to knot.

    At each inner knot the integral is least where its derivatives by the four unknowns vanish: four equations in
    these and in those of both neighbours.
    """
    count = len(points)
    found = np.zeros((count, ORDERS, 3))
    found[:, 0] = points
    energies = [_energy(span) for span in spans]
    steps = np.diff(points, axis=0)
    inner, right = np.zeros((count, 4, 4)), np.zeros((count, 4, 3))
    for i in range(1, count - 1):
        before, behind = energies[i - 1], energies[i]
        block = before[6:, 6:] + behind[1:5, 1:5]
        value = -np.outer(before[6:, 5], steps[i - 1]) - np.outer(behind[1:5, 5], steps[i])
        if i > 1:
            block = block - before[6:, 1:5] @ inner[i - 1]
            value = value - before[6:, 1:5] @ right[i - 1]
        solved = np.linalg.solve(block, np.column_stack([behind[1:5, 6:], value]))
        inner[i], right[i] = solved[:, :4], solved[:, 4:]
    for i in range(count - 2, 0, -1):
        found[i, 1:] = right[i] - inner[i] @ found[i + 1, 1:]
    return found


def _energy(span: float) -> Floats:
    """∫ (d⁵p/dt⁵)² dt over a piece, as the matrix of the quadratic form in its derivatives at both ends."""
    weights = np.tile(span ** np.arange(ORDERS), 2)
    return np.asarray(_exact_matrices()[1] * weights[:, None] * weights * span ** -float(DEGREE))


@functools.cache
def _exact_matrices() -> tuple[Floats, Floats]:
    """Coefficients of a piece from its derivatives at 0 and 1, and the integral of its fifth derivative squared."""
    size = DEGREE + 1
    rows = [[Fraction(0)] * size for _ in range(size)]
    for order in range(ORDERS):
        for power in range(order, size):
            falling = 1
            for k in range(order):
                falling *= power - k
            rows[ORDERS + order][power] = Fraction(falling)
            if power == order:
                rows[order][power] = Fraction(falling)
    hermite = _inverse(rows)
    fifth = [0] * ORDERS + [n * (n - 1) * (n - 2) * (n - 3) * (n - 4) for n in range(ORDERS, size)]
    integral = [
        [Fraction(fifth[i] * fifth[j], i + j - DEGREE) if i >= ORDERS and j >= ORDERS else Fraction(0)
         for j in range(size)]
        for i in range(size)
    ]  # fmt: skip
    transposed = [list(column) for column in zip(*hermite)]
    energy = _product(_product(transposed, integral), hermite)
    return np.array(hermite, dtype=float), np.array(energy, dtype=float)


def _product(a: list[list[Fraction]], b: list[list[Fraction]]) -> list[list[Fraction]]:
    return [[sum((x * y for x, y in zip(row, column)), Fraction(0)) for column in zip(*b)] for row in a]


def _inverse(rows: list[list[Fraction]]) -> list[list[Fraction]]:
    """The inverse of a matrix by elimination, in fractions."""
    size = len(rows)
    work = [list(row) + [Fraction(int(i == j)) for j in range(size)] for i, row in enumerate(rows)]
    for i in range(size):
        pivot = next(k for k in range(i, size) if work[k][i])
        work[i], work[pivot] = work[pivot], work[i]
        work[i] = [value / work[i][i] for value in work[i]]
        for k in range(size):
            if k != i and work[k][i]:
                factor = work[k][i]
                work[k] = [a - factor * b for a, b in zip(work[k], work[i])]
    return [row[size:] for row in work]
