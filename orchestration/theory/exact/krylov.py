"""The largest eigenvalue of a linear map, and the solution of x = L x + b, from images of vectors."""

from collections.abc import Callable

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats

Map = Callable[[Floats], Floats]

SIZE, TURNS = 100, 20
"""vectors of a basis, and the number of restarts"""
FIRST = 12
"""vectors of the first basis of an eigenvalue: enough for a map with few"""
EIGENVALUE, RESIDUAL = 1e-12, 1e-13
"""relative: residuals at convergence"""
INVARIANT = 1e-13
"""likewise, of the part of an image outside of a basis that has all images"""
ENOUGH = 1e-10
"""likewise, where rounding prevents smaller ones"""


def spectral_radius_of(of: Map, start: Floats, size: int = SIZE) -> float:
    """The spectral radius of a map that preserves a cone, from a start inside it; raises `UsageError` if not converged.

    It is an eigenvalue with an eigenvector in the cone: the one with the largest real part in each basis, of `size`
    vectors.
    """
    vector, radius, residual = start, 0.0, np.inf
    for turn in range(TURNS):
        basis, small, outside = _basis(of, vector, size if turn else FIRST)
        values, vectors = np.linalg.eig(small)
        first = int(np.argmax(values.real))
        radius, share = float(values[first].real), np.real(vectors[:, first])
        residual = outside * float(np.abs(share[-1])) / max(radius * float(np.linalg.norm(share)), 1e-300)
        if residual <= EIGENVALUE or radius <= 0.0:
            return max(radius, 0.0)
        vector = share @ basis
    if residual > ENOUGH:
        raise UsageError(
            f"the spectral radius of moments, about {radius:.6g}, does not converge: other eigenvalues are too close"
        )
    return radius


def solve_fixed_point(of: Map, b: Floats, size: int = SIZE) -> Floats:
    """Solve x = L x + b by GMRES, restarted after `size` vectors; raises `UsageError` if it does not converge."""
    largest = float(np.linalg.norm(b))
    solution: Floats = np.zeros_like(b)
    residual = b
    for _ in range(TURNS):
        norm = float(np.linalg.norm(residual))
        if norm <= RESIDUAL * max(largest, float(np.linalg.norm(solution))):
            return solution
        basis, small, outside = _basis(of, residual, size)
        count = len(small)
        system = np.vstack([np.eye(count) - small, np.zeros(count)])
        system[-1, -1] = -outside
        shares = np.linalg.lstsq(system, np.append(norm, np.zeros(count)), rcond=None)[0]
        solution = solution + shares @ basis
        residual = b + of(solution) - solution
    if float(np.linalg.norm(residual)) > ENOUGH * max(largest, float(np.linalg.norm(solution))):
        raise UsageError("the stationary second moments do not converge: the mean-square radius is too close to 1")
    return solution


def _basis(of: Map, start: Floats, most: int) -> tuple[Floats, Floats, float]:
    """By Arnoldi: an orthonormal basis in rows, the map in it, and the norm of the part outside of it."""
    count = min(most, len(start))
    rows: Floats = np.empty((count, len(start)))
    rows[0] = start / np.linalg.norm(start)
    small: Floats = np.zeros((count + 1, count))
    for k in range(count):
        image = of(rows[k])
        known = rows[: k + 1]
        size = float(np.linalg.norm(image))
        for _ in range(2):
            shares = known @ image
            small[: k + 1, k] += shares
            image = image - shares @ known
        small[k + 1, k] = outside = float(np.linalg.norm(image))
        if k + 1 == count or outside <= INVARIANT * size:
            return known, small[: k + 1, : k + 1], outside
        rows[k + 1] = image / outside
    raise AssertionError
