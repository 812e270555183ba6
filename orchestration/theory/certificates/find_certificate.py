"""Finds a certificate for a family: chooses cells, labels and coordinates, searches forms, and calls the checker."""

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.certificate import Cells, Certificate, Node
from orchestration.theory.certificates.family import Letter, LoopFamily
from orchestration.theory.certificates.verify_certificate import NotProven, edges_of, verified

RADIUS = 1e-6
"""relative, of measured matrices"""
LADDER = ((1, 0), (2, 1), (2, 2), (2, 3), (2, 4), (3, 3))
"""labels of each letter with a parameter, and the number of future labels that a form depends on: tried in turn"""
MAX_INEQUALITIES = 1000
"""inequalities of a search: steps of the ladder that need more are skipped"""
SEARCHED = 12
"""cells for which forms are searched; of two parameters the square root of that along each"""
REFINEMENTS = {0: (1,), 1: (2, 4, 8), 2: (2, 4, 8, 16, 32)}
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
        for refinement in REFINEMENTS[max(map(_varying, family.letters))]:
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
    total = [sum(high - low for low, high in along) for along in zip(*(x.ranges for x in family.letters))]
    first = 0
    for letter in family.letters:
        count = _varying(letter)
        edges, own = [], np.zeros((), dtype=int)
        for i, (low, high) in enumerate(letter.ranges):
            share = (high - low) / total[i] if total[i] > 0.0 else 1.0
            cells = SEARCHED ** (1.0 / max(count, 1)) * refinement * share / labels
            each = max(1, math.ceil(cells - 1e-9))
            edges.append(tuple(np.linspace(low, high, labels * each + 1).tolist()) if high > low else (low, high))
            along = np.repeat(np.arange(labels), each) if high > low else np.zeros(1, dtype=int)
            own = own[..., None] * labels + along
        numbers = own.ravel()
        _, numbers = np.unique(numbers, return_inverse=True)
        yield Cells(edges=tuple(edges), labels=tuple((numbers + first).tolist()))
        first += int(numbers.max()) + 1


def _varying(letter: Letter) -> int:
    """The number of parameters that vary in a letter."""
    return sum(high > low for low, high in letter.ranges)


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


FALL = 1e-7
"""Least fall of a form, relative to the largest one: a smaller one counts as none"""


def forms_for(certificate: Certificate, parts: Sequence[Sequence[int]]) -> Mapping[Node, Floats] | None:
    """Forms that fall at the corners of all cells, in the coordinates of `certificate`; None if none were found.

    `parts` are sets of coordinates that do not act on one another.
    """
    maps = _maps(certificate)
    edges = list(dict.fromkeys(edges_of(certificate)))
    nodes = list(dict.fromkeys(start for start, _, _ in edges))
    forms = {node: np.zeros(certificate.coordinates.shape) for node in nodes}
    for part in parts:
        inside = np.ix_(part, part)
        of_part = {label: [M[inside] for M in found] for label, found in maps.items()}
        found = _solve(nodes, edges, of_part, len(part))
        if found is None:
            return None
        for node, form in found.items():
            forms[node][inside] = form
    return forms


def inequalities_of(certificate: Certificate) -> int:
    """The number of matrix inequalities of a search, or an upper bound of it."""
    labels = sum(len(set(cells.labels)) for cells in certificate.cells)
    corners = sum(math.prod(len(set(edges)) for edges in cells.edges) for cells in certificate.cells)
    modes = max(len(letter.moves) for letter in certificate.family.letters)
    return int(modes * corners * labels**certificate.memory)


def _maps(certificate: Certificate) -> dict[int, list[Floats]]:
    """The maps at the corners of the cells, by label, in the coordinates of the forms."""
    into = certificate.coordinates
    back = np.linalg.inv(into)
    family, result = certificate.family, dict[int, list[Floats]]()
    for letter, cells in zip(family.letters, certificate.cells):
        at = functools.cache(lambda point, letter=letter: into @ family.at(letter, point) @ back)
        points: dict[int, dict[tuple[float, ...], None]] = {}
        for label, box in cells.boxes():
            points.setdefault(label, {}).update(dict.fromkeys(itertools.product(*box)))
        result |= {label: [at(point) for point in each] for label, each in points.items()}
    return result


def _solve(
    nodes: Sequence[Node], edges: Sequence[tuple[Node, Node, int]], maps: Mapping[int, Sequence[Floats]], size: int
) -> dict[Node, Floats] | None:
    """Forms below the identity whose least fall is largest; None where it vanishes."""
    from scipy import sparse

    basis = _symmetric_basis(size)
    count, one = len(basis), basis @ np.eye(size).ravel()
    place = {node: i * count for i, node in enumerate(nodes)}
    conjugations = {label: [basis @ np.kron(M.T, M.T) @ basis.T for M in found] for label, found in maps.items()}
    pieces = []  # of rows and columns, beginning at these, and values
    row, t = 0, len(nodes) * count
    rest = []
    for start, end, label in edges:
        for K in conjugations[label]:
            pieces += [(row, place[start], -np.eye(count)), (row, place[end], K), (row, t, one[:, None])]
            rest.append(np.zeros(count))
            row += count
    for node in nodes:
        pieces.append((row, place[node], np.eye(count)))
        rest.append(one)
        row += count
    rows, columns, values = [], [], []
    for r, c, block in pieces:
        i, j = np.nonzero(block)
        rows.append(i + r)
        columns.append(j + c)
        values.append(block[i, j])
    A = sparse.csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(row, t + 1))
    x = _program(A, np.concatenate(rest), [size] * (row // count), -np.eye(t + 1)[t])
    if not np.isfinite(x).all() or x[t] < FALL:
        return None
    found = {node: (basis.T @ x[at : at + count]).reshape(size, size) for node, at in place.items()}
    return {node: 0.5 * (form + form.T) for node, form in found.items()}


def least_cost(conditions: Sequence[Callable[[Floats], Floats]], count: int) -> Floats | None:
    """The numbers, with the least last one, for which matrices affine in them are positive; None: there are none."""
    from scipy import sparse

    A, rest, sizes = list[Floats](), list[Floats](), list[int]()
    for condition in conditions:
        at_zero = condition(np.zeros(count))
        basis = _symmetric_basis(len(at_zero))
        A.append(np.column_stack([basis @ (at_zero - condition(unit)).ravel() for unit in np.eye(count)]))
        rest.append(basis @ at_zero.ravel())
        sizes.append(len(at_zero))
    x = _program(sparse.csc_matrix(np.vstack(A)), np.concatenate(rest), sizes, np.eye(count)[-1])
    return x if np.isfinite(x).all() and all(_is_nearly_positive(f(x)) for f in conditions) else None


def _is_nearly_positive(matrix: Floats) -> bool:
    values = np.linalg.eigvalsh(matrix)
    return bool(values[0] > -1e-6 * values[-1])


def _program(A: Any, rest: Floats, sizes: Sequence[int], cost: Floats) -> Floats:
    """The x of least cost for which rest - A x, cut into symmetric matrices of these sizes, is positive."""
    import clarabel
    from scipy import sparse

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "faer"  # of large programs in less than half of the time that the default takes
    settings.max_threads = 1  # the same bits on any machine
    cones = [clarabel.PSDTriangleConeT(size) for size in sizes]
    nothing = sparse.csc_matrix((len(cost), len(cost)))
    return np.array(clarabel.DefaultSolver(nothing, cost, A, rest, cones, settings).solve().x)


def _symmetric_basis(size: int) -> Floats:
    """Orthonormal symmetric matrices as rows, in the order of an upper triangle, column by column."""
    rows = []
    for j in range(size):
        for i in range(j + 1):
            unit = np.zeros((size, size))
            unit[i, j] = unit[j, i] = 1.0 if i == j else np.sqrt(0.5)
            rows.append(unit.ravel())
    return np.array(rows)
