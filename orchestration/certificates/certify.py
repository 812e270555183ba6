"""A certificate for a family: cells, labels and coordinates are chosen, forms looked for, and the checker asked."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestration.basics.simulator import Floats
from orchestration.certificates.certificate import Cells, Certificate
from orchestration.certificates.checker import NotProven, proven
from orchestration.certificates.family import Family
from orchestration.certificates.search import forms_for, inequalities_of

RADIUS = 1e-6
"""relative, of what is measured"""
LADDER = ((1, 0), (2, 1), (2, 2), (2, 3), (2, 4), (3, 3))
"""labels of each letter with a parameter, and how many of those to come a form depends on: tried in turn"""
LARGEST = 1000
"""inequalities of a search: steps of the ladder that ask for more are left out"""
SEARCHED = 12
"""cells in which forms are looked for; of two parameters the square root of that along each"""
FINER = {1: (2, 4, 8), 2: (2, 4)}
"""times as many, by how many parameters there are, in which they are proved: cells are refined first, forms looked for
again second"""
ROUNDS = 3
"""of the search, each in the coordinates of the forms that the one before found"""
COUPLED = 1e-7
"""of the largest entry of a row: entries below that count as none when parts are told apart, not in the proof"""


@dataclass(frozen=True, kw_only=True)
class Found:
    """A certificate, and which step of the ladder it took."""

    certificate: Certificate
    step: int


def certified(family: Family, of: Sequence[str], first: int = 0, radius: float = RADIUS) -> Found | None:
    """A certificate that the checker takes, from a step of the ladder on; None if none was found."""
    parts = parts_of(family)
    for step, (labels, memory) in enumerate(LADDER):
        if step < first:
            continue
        certificate = Certificate(
            of=tuple(of), radius=radius, family=family, cells=tuple(_divided(family, labels, 1)),
            coordinates=_coordinates(family, parts), memory=memory, forms={},
        )  # fmt: skip
        if inequalities_of(certificate) > LARGEST:
            continue
        found = _proved(certificate, parts, labels)
        if found is not None:
            return Found(certificate=found, step=step)
    return None


def _proved(certificate: Certificate, parts: Sequence[Sequence[int]], labels: int) -> Certificate | None:
    family = certificate.family
    for _ in range(ROUNDS):
        forms = forms_for(certificate, parts)
        if forms is None:
            return None
        for finer in FINER[max(1, *(len(letter.ranges) for letter in family.letters))]:
            refined = replace(certificate, forms=forms, cells=tuple(_divided(family, labels, finer)))
            try:
                proven(refined)
            except NotProven:
                continue
            return refined
        mean = sum((form / np.linalg.norm(form, 2) for form in forms.values()), np.zeros(certificate.coordinates.shape))
        for part in parts:
            mean[np.ix_(part, part)] /= np.linalg.norm(mean[np.ix_(part, part)], 2)
        try:
            certificate = replace(certificate, coordinates=np.linalg.cholesky(mean).T @ certificate.coordinates)
        except np.linalg.LinAlgError:  # forms that nearly fit a loop that grows
            return None
    return None


def _divided(family: Family, labels: int, finer: int) -> Iterator[Cells]:
    """The cells of each letter: labels of equal width along each parameter, each of as many cells."""
    total = [sum(x.ranges[i][1] - x.ranges[i][0] for x in family.letters if len(x.ranges) > i) for i in (0, 1)]
    first = 0
    for letter in family.letters:
        count = len(letter.ranges)
        edges, own = [], np.zeros((), dtype=int)
        for i, (low, high) in enumerate(letter.ranges):
            share = (high - low) / total[i] if total[i] > 0.0 else 1.0
            cells = SEARCHED ** (1.0 / count) * finer * share / labels
            each = max(1, math.ceil(cells - 1e-9))
            edges.append(tuple(np.linspace(low, high, labels * each + 1).tolist()) if high > low else (low, high))
            along = np.repeat(np.arange(labels), each) if high > low else np.zeros(1, dtype=int)
            own = own[..., None] * labels + along
        numbers = own.ravel()
        _, numbers = np.unique(numbers, return_inverse=True)
        yield Cells(edges=tuple(edges), labels=tuple((numbers + first).tolist()))
        first += int(numbers.max()) + 1


def parts_of(family: Family) -> list[list[int]]:
    """The kept coordinates in sets that do not move one another, the largest first."""
    size = len(next(iter(family.matrices.values())))
    joined = np.eye(size, dtype=bool)
    for matrix in family.matrices.values():
        sizes = np.abs(matrix)
        joined |= sizes > COUPLED * sizes.max(axis=1, keepdims=True)
    joined |= joined.T
    for _ in range(math.ceil(math.log2(size)) + 1):
        joined = (joined.astype(int) @ joined.astype(int)) > 0
    within = joined[np.ix_(family.kept, family.kept)]
    parts = {tuple(np.flatnonzero(row).tolist()) for row in within}
    return [list(part) for part in sorted(parts, key=lambda part: (-len(part), part))]


def _coordinates(family: Family, parts: Sequence[Sequence[int]]) -> Floats:
    """Coordinates in which the mean square, over values of the parameters, is nearly a norm that falls."""
    maps = [
        family.at(letter, [low + share * (high - low) for low, high in letter.ranges])
        for letter in family.letters
        for share in ((0.0, 0.25, 0.5, 0.75, 1.0) if letter.ranges else (0.0,))
    ]
    found: Floats = np.zeros((len(family.kept), len(family.kept)))
    for part in parts:
        inside = np.ix_(part, part)
        found[inside] = _norm_of([M[inside] for M in maps])
    return found


def _norm_of(maps: Sequence[Floats]) -> Floats:
    from scipy.linalg import matrix_balance

    size = len(maps[0])
    _, scale = matrix_balance(np.sum(np.abs(maps), axis=0), permute=False)
    unscaled = np.linalg.inv(scale)
    scaled = [unscaled @ M @ scale for M in maps]
    mean = np.mean([np.kron(M.T, M.T) for M in scaled], axis=0)
    mean *= min(1.0, 0.98 / float(np.abs(np.linalg.eigvals(mean)).max()))
    P = np.linalg.solve(np.eye(size * size) - mean, np.eye(size).ravel()).reshape(size, size)
    found: Floats = np.linalg.cholesky(0.5 * (P + P.T)).T @ unscaled
    return found
