"""Searches the quadratic forms of a certificate, by semidefinite programming; they are proved elsewhere."""

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.certificates.certificate import Certificate, Node
from orchestration.theory.certificates.verify_certificate import edges_of

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
    corners = sum(math.prod(map(len, cells.edges)) for cells in certificate.cells)
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
