"""Looks for the quadratic forms of a certificate, by semidefinite programming; what it finds is proved elsewhere."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from orchestration.basics.simulator import Floats
from orchestration.certificates.certificate import Certificate, Node
from orchestration.certificates.checker import edges_of

FALL = 1e-7
"""of a form, at least, relative to the largest one: what the program finds below that is taken for nothing"""


def forms_for(certificate: Certificate, parts: Sequence[Sequence[int]]) -> Mapping[Node, Floats] | None:
    """Forms that fall at the corners of all cells, in the coordinates of `certificate`; None if none were found.

    `parts` are the coordinates that do not move each other.
    """
    maps = _maps(certificate)
    edges = list(dict.fromkeys(edges_of(certificate)))
    nodes = list(dict.fromkeys(start for start, _, _ in edges))
    whole = {node: np.zeros(certificate.coordinates.shape) for node in nodes}
    for part in parts:
        inside = np.ix_(part, part)
        of_part = {label: [M[inside] for M in found] for label, found in maps.items()}
        found = _solved(nodes, edges, of_part, len(part))
        if found is None:
            return None
        for node, form in found.items():
            whole[node][inside] = form
    return whole


def inequalities_of(certificate: Certificate) -> int:
    """How many matrix inequalities a search would have to satisfy, or enough to be too many."""
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


def _solved(
    nodes: Sequence[Node], edges: Sequence[tuple[Node, Node, int]], maps: Mapping[int, Sequence[Floats]], size: int
) -> dict[Node, Floats] | None:
    """Forms below the identity of which the least fall is largest; None where that is nothing."""
    import clarabel
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
    cost = np.zeros(t + 1)
    cost[t] = -1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.PSDTriangleConeT(size)] * (row // count)
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix((t + 1, t + 1)), cost, A, np.concatenate(rest), cones, settings
    ).solve()
    x = np.array(solution.x)
    if not np.isfinite(x).all() or x[t] < FALL:
        return None
    found = {node: (basis.T @ x[at : at + count]).reshape(size, size) for node, at in place.items()}
    return {node: 0.5 * (form + form.T) for node, form in found.items()}


def _symmetric_basis(size: int) -> Floats:
    """Orthonormal symmetric matrices as rows, in the order of an upper triangle, column by column."""
    rows = []
    for j in range(size):
        for i in range(j + 1):
            unit = np.zeros((size, size))
            unit[i, j] = unit[j, i] = 1.0 if i == j else np.sqrt(0.5)
            rows.append(unit.ravel())
    return np.array(rows)
