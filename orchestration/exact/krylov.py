"""The largest eigenvalue of a linear map, and the solution of x = L x + b, from what the map makes of vectors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats

Map = Callable[[Floats], Floats]

SIZE, TURNS = 100, 20
"""vectors of a basis, and how often it is begun anew"""
EIGENVALUE, RESIDUAL = 1e-12, 1e-13
"""relative: what is left when it is found"""
ENOUGH = 1e-10
"""likewise, where rounding lets it become no smaller"""


def largest(of: Map, start: Floats) -> float:
    """The spectral radius of a map that keeps a cone, from inside of that; raises `UsageError` where none is found.

    It is an eigenvalue, and its eigenvector is in the cone: of what a basis tells the one with the largest real part.
    """
    vector, radius, rest = start, 0.0, np.inf
    for _ in range(TURNS):
        basis, small, beside = _basis(of, vector)
        values, vectors = np.linalg.eig(small)
        first = int(np.argmax(values.real))
        radius, share = float(values[first].real), np.real(vectors[:, first])
        rest = beside * float(np.abs(share[-1])) / max(radius * float(np.linalg.norm(share)), 1e-300)
        if rest <= EIGENVALUE or radius <= 0.0:
            return max(radius, 0.0)
        vector = share @ basis
    if rest > ENOUGH:
        raise UsageError(f"the spectral radius of moments, about {radius:.6g}, is not told from others: too close")
    return radius


def solved(of: Map, b: Floats) -> Floats:
    """x = L x + b, by GMRES; raises `UsageError` where it is not found."""
    size = float(np.linalg.norm(b))
    found: Floats = np.zeros_like(b)
    left = b
    for _ in range(TURNS):
        norm = float(np.linalg.norm(left))
        if norm <= RESIDUAL * max(size, float(np.linalg.norm(found))):
            return found
        basis, small, beside = _basis(of, left)
        count = len(small)
        system = np.vstack([np.eye(count) - small, np.zeros(count)])
        system[-1, -1] = -beside
        shares = np.linalg.lstsq(system, np.append(norm, np.zeros(count)), rcond=None)[0]
        found = found + shares @ basis
        left = b + of(found) - found
    if float(np.linalg.norm(left)) > ENOUGH * max(size, float(np.linalg.norm(found))):
        raise UsageError("the second moments that stay are not found: they grow too close to without end")
    return found


def _basis(of: Map, start: Floats) -> tuple[Floats, Floats, float]:
    """By Arnoldi: an orthonormal basis in rows, the map in it, and what it leads out of it by."""
    rows = [start / np.linalg.norm(start)]
    count = min(SIZE, len(start))
    small: Floats = np.zeros((count + 1, count))
    for k in range(count):
        image = of(rows[k])
        known = np.array(rows)
        size = float(np.linalg.norm(image))
        for _ in range(2):
            shares = known @ image
            small[: k + 1, k] += shares
            image = image - shares @ known
        small[k + 1, k] = beside = float(np.linalg.norm(image))
        if k + 1 == count or beside <= 1e-15 * size:
            return known, small[: k + 1, : k + 1], beside
        rows.append(image / beside)
    raise AssertionError
