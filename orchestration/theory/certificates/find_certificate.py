"""Finds a certificate for a family: chooses cells, labels and coordinates, searches forms, and calls the checker."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.certificate import Cells, Certificate
from orchestration.theory.certificates.family import LoopFamily
from orchestration.theory.certificates.search import forms_for, inequalities_of
from orchestration.theory.certificates.verify_certificate import NotProven, verified

RADIUS = 1e-6
"""relative, of measured matrices"""
LADDER = ((1, 0), (2, 1), (2, 2), (2, 3), (2, 4), (3, 3))
"""labels of each letter with a parameter, and the number of future labels that a form depends on: tried in turn"""
MAX_INEQUALITIES = 1000
"""inequalities of a search: steps of the ladder that need more are skipped"""
SEARCHED = 12
"""cells for which forms are searched; of two parameters the square root of that along each"""
REFINEMENTS = {0: (1,), 1: (2, 4, 8), 2: (2, 4)}
"""factors on the number of cells for the proof, by the number of parameters: cells are refined first, forms searched
again second"""
ROUNDS = 3
"""Rounds of the search, each in the coordinates of the forms of the one before"""
COUPLED = 1e-7
"""Share of the largest entry of a row: smaller entries count as 0 when parts are separated, not in the proof"""


@dataclass(frozen=True, kw_only=True)
class CertificateOnStep:
    """A certificate, and the step of the ladder at which it was found."""

    certificate: Certificate
    step: int


def find_certificate(family: LoopFamily, of: Sequence[str], first: int = 0) -> CertificateOnStep | None:
    """A certificate that the checker accepts, from a step of the ladder on; None if none was found."""
    basis = _basis(family)
    family = family.in_basis(basis)
    parts, tried = parts_of(family), set[tuple[int, int]]()
    for step, (labels, memory) in enumerate(LADDER):
        if step < first:
            continue
        if (least := (labels if any(x.ranges for x in family.letters) else 1, memory)) in tried:
            continue
        tried.add(least)
        certificate = Certificate(
            of=tuple(of), radius=RADIUS, basis=basis, family=family, cells=tuple(_cells_of(family, labels, 1)),
            coordinates=_coordinates(family, parts), memory=memory, forms={},
        )  # fmt: skip
        if inequalities_of(certificate) > MAX_INEQUALITIES:
            continue
        found = _prove(certificate, parts, labels)
        if found is not None:
            return CertificateOnStep(certificate=found, step=step)
    return None


def _prove(certificate: Certificate, parts: Sequence[Sequence[int]], labels: int) -> Certificate | None:
    family = certificate.family
    for _ in range(ROUNDS):
        forms = forms_for(certificate, parts)
        if forms is None:
            return None
        for refinement in REFINEMENTS[max(len(letter.ranges) for letter in family.letters)]:
            refined = replace(certificate, forms=forms, cells=tuple(_cells_of(family, labels, refinement)))
            try:
                verified(refined)
            except NotProven:
                continue
            return refined
        mean = sum((form / np.linalg.norm(form, 2) for form in forms.values()), np.zeros(certificate.coordinates.shape))
        for part in parts:
            mean[np.ix_(part, part)] /= np.linalg.norm(mean[np.ix_(part, part)], 2)
        try:
            certificate = replace(certificate, coordinates=np.linalg.cholesky(mean).T @ certificate.coordinates)
        except np.linalg.LinAlgError:  # the forms of a loop that is nearly unstable
            return None
    return None


def _cells_of(family: LoopFamily, labels: int, refinement: int) -> Iterator[Cells]:
    """The cells of each letter: labels of equal width along each parameter, each of as many cells."""
    total = [sum(x.ranges[i][1] - x.ranges[i][0] for x in family.letters if len(x.ranges) > i) for i in (0, 1)]
    first = 0
    for letter in family.letters:
        count = len(letter.ranges)
        edges, own = [], np.zeros((), dtype=int)
        for i, (low, high) in enumerate(letter.ranges):
            share = (high - low) / total[i] if total[i] > 0.0 else 1.0
            cells = SEARCHED ** (1.0 / count) * refinement * share / labels
            each = max(1, math.ceil(cells - 1e-9))
            edges.append(tuple(np.linspace(low, high, labels * each + 1).tolist()) if high > low else (low, high))
            along = np.repeat(np.arange(labels), each) if high > low else np.zeros(1, dtype=int)
            own = own[..., None] * labels + along
        numbers = own.ravel()
        _, numbers = np.unique(numbers, return_inverse=True)
        yield Cells(edges=tuple(edges), labels=tuple((numbers + first).tolist()))
        first += int(numbers.max()) + 1


def parts_of(family: LoopFamily) -> list[list[int]]:
    """The kept coordinates in sets that do not act on one another, the largest first."""
    from scipy.sparse.csgraph import connected_components

    size = len(next(iter(family.matrices.values())))
    joined = np.eye(size, dtype=bool)
    for matrix in family.matrices.values():
        sizes = np.abs(matrix)
        joined |= sizes > COUPLED * sizes.max(axis=1, keepdims=True)
    which = connected_components(joined, directed=False)[1][list(family.kept)]
    parts = [np.flatnonzero(which == one).tolist() for one in np.unique(which)]
    return sorted(parts, key=lambda part: (-len(part), part))


def _coordinates(family: LoopFamily, parts: Sequence[Sequence[int]]) -> Floats:
    """Coordinates in which the mean square, over values of the parameters, is nearly a decreasing norm."""
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


def _basis(family: LoopFamily) -> Floats:
    """The state in which each component's part of the norm above is the sum of squares.

    In measured coordinates, as an output at successive samples, a radius of a millionth may be more than any proof has
    room for: their numbers nearly cancel.
    """
    norm = _coordinates(family, parts_of(family))
    squares, place = norm.T @ norm, {coordinate: i for i, coordinate in enumerate(family.kept)}
    found = np.eye(family.size)
    for group in (each for each in family.mixed() if len(each) > 1):
        inside = [place[i] for i in group]
        found[np.ix_(group, group)] = np.linalg.cholesky(squares[np.ix_(inside, inside)]).T
    return found if family.accepts(found) else np.eye(family.size)


def _norm_of(maps: Sequence[Floats]) -> Floats:
    from scipy.linalg import matrix_balance

    size = len(maps[0])
    _, scale = matrix_balance(np.sum(np.abs(maps), axis=0), permute=False)
    unscaled = np.linalg.inv(scale)
    scaled = [unscaled @ M @ scale for M in maps]
    mean = np.mean([np.kron(M.T, M.T) for M in scaled], axis=0)
    mean *= min(1.0, 0.98 / float(np.abs(np.linalg.eigvals(mean)).max()))
    P = np.linalg.solve(np.eye(size * size) - mean, np.eye(size).ravel()).reshape(size, size)
    return np.asarray(np.linalg.cholesky(0.5 * (P + P.T)).T @ unscaled)
