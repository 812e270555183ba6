"""Searches a large ellipsoid in which V decreases at points: a candidate for the proof.

The form has two parts, for (y, vy, φ, p) and for (z, vz), which are decoupled about hover. The first solves a Lyapunov
equation of the linear loop, with weights from the search; in the coordinates of the second, the vertical loop is a
shrinking rotation. The sizes of both are searched by simulating a period from points.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag, solve_discrete_lyapunov

from docs.lateral_basin.period import STATES, Loop
from orchestration.foundation.basics.simulator import Floats

POINTS = 3000
"""directions"""
DEPTHS = np.array([0.03, 0.06, 0.12, 0.25, 0.4, 0.55, 0.7, 0.8, 0.9, 1.0])
"""Depths of the points along each direction, as shares of the ellipsoid"""
STEEPEST = 1.0
"""Largest roll in an ellipsoid that is considered [rad]"""
RATE = 0.5
"""Least rate at which V decreases at every point [1/s]"""
WEIGHTS = np.log([1.0, 0.1, 0.1, 0.001])
"""Weights of y, vy, φ and p in the equation, at the start of the search"""
VERTICAL = np.log(0.5)
"""size of the vertical part relative to the lateral one, at the start of the search"""


def largest_ellipsoid(loop: Loop, evaluations: int) -> Floats:
    """R of the ellipsoid |R x| ≤ 1 of largest volume that the search finds."""
    from scipy.optimize import minimize

    directions = np.random.default_rng(1).standard_normal((6, POINTS))
    directions /= np.linalg.norm(directions, axis=0)
    jacobian = _jacobian(loop)

    def sized(choice: Floats) -> Floats:
        R = _shape(jacobian, choice)
        return R / _level(loop, R, directions)

    def cost(choice: Floats) -> float:
        return float(np.linalg.slogdet(sized(choice))[1])

    start = np.array([*(WEIGHTS[1:] - WEIGHTS[0]), VERTICAL])
    simplex = np.vstack([start, start + np.diag([1.0, 1.0, 1.0, 0.5])])
    settings = {"maxfev": evaluations, "initial_simplex": simplex, "xatol": 0.01, "fatol": 0.01}
    best = minimize(cost, start, method="Nelder-Mead", options=settings).x
    return sized(best)


def _jacobian(loop: Loop) -> Floats:
    """The Jacobian at hover, with k_s in the middle of the values of γ from ε to 1 m."""
    gains = loop.gains
    middle = replace(gains, k_s=gains.k_s * (1.0 + gains.epsilon ** (gains.beta_t - 1.0)) / 2.0)
    near = 1e-3 * gains.epsilon * np.eye(6)
    linear = replace(loop, gains=middle)
    found: Floats = (linear.after(near) - linear.after(-near)) / (2e-3 * gains.epsilon)
    return found


def _shape(jacobian: Floats, choice: Floats) -> Floats:
    weights = np.exp(np.array([0.0, *choice[:-1]]))
    lateral = solve_discrete_lyapunov(jacobian[:4, :4].T, np.diag(weights))
    modes = np.linalg.inv(np.linalg.eig(jacobian[4:, 4:])[1])
    vertical = (modes.conj().T @ modes).real
    R: Floats = block_diag(_factor(lateral), np.exp(-choice[-1]) * _factor(vertical))
    return R


def _factor(P: Floats) -> Floats:
    """Lower triangular R with Rᵀ R = P up to its size, so that a box is as wide along y or z as its coordinate."""
    R: Floats = np.linalg.cholesky(P[::-1, ::-1]).T[::-1, ::-1]
    R = R / R[0, 0]
    return R


def _level(loop: Loop, R: Floats, directions: Floats) -> float:
    """The largest |R x| up to which V decreases at every point, by bisection."""
    T, low = np.linalg.inv(R), 0.0
    high = STEEPEST / float(np.linalg.norm(T[STATES.index("φ")]))
    for _ in range(9):
        middle = (low + high) / 2.0
        if _falls(loop, R, T @ (middle * directions)):
            low = middle
        else:
            high = middle
    return max(low, 1e-3 * high)


def _falls(loop: Loop, R: Floats, edge: Floats) -> bool:
    points = (DEPTHS[:, None, None] * edge).transpose(1, 0, 2).reshape(6, -1)
    before, after = ((R @ x) ** 2 for x in (points, loop.after(points)))
    return bool((after.sum(axis=0) < (1.0 - RATE * loop.period) * before.sum(axis=0)).all())
