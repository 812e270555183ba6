"""The paper's flight under a zero-order hold: adaptive integration between what happens.

The attitude is integrated as a rotation matrix; the quaternion is taken from it at each sample.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from tests.reference.law import Parameters, evaluate, rotation, skew

Array = Any
PAPER = Parameters()
Q0 = np.array([0.1699, 0.3058, 0.1699, 0.9212])


def paper_wind(t: float) -> Array:
    """F_d [N], inertial (section V)."""
    return np.full(3, 0.01 * math.cos(0.1 * t))


def reference(t: float) -> Array:
    """P_d(t) = [2 sin 0.3 t, 4 sin 0.15 t, 2 + 0.1 t] and its first four derivatives, one a row."""
    rows = np.zeros((5, 3))
    for k in range(5):
        phase = k * math.pi / 2
        rows[k, 0] = 2.0 * 0.3**k * math.sin(0.3 * t + phase)
        rows[k, 1] = 4.0 * 0.15**k * math.sin(0.15 * t + phase)
    rows[:2, 2] = 2.0 + 0.1 * t, 0.1
    return rows


def motion(t: float, x: Array, command: Array, p: Parameters, force: Callable[[float], Array]) -> Array:
    """d[P, V, R, Ω]/dt of the vehicle (4)-(5), R from inertial to body, `force` [N] inertial."""
    V, R, Omega = x[3:6], x[6:15].reshape(3, 3), x[15:]
    dV = (force(t) - command[0] * R[2]) / p.m
    dV[2] += p.g
    momentum = p.J @ Omega
    d_Omega = np.linalg.solve(p.J, command[1:] - skew(Omega) @ momentum)
    return np.concatenate([V, dV, (-skew(Omega) @ R).ravel(), d_Omega])


def quaternion(R: Array, near: Array) -> Array:
    """The unit quaternion of R that lies closer to `near` than its opposite."""
    # In terms of Q, this is 4 Q Qᵀ - 1: its eigenvector of the largest eigenvalue is Q.
    (a, b, c), (d, e, f), (g, h, i) = R
    K = np.array(
        [
            [a - e - i, b + d, c + g, f - h],
            [b + d, e - a - i, f + h, g - c],
            [c + g, f + h, i - a - e, b - d],
            [f - h, g - c, b - d, a + e + i],
        ]
    )
    Q = np.linalg.eigh(K)[1][:, -1]
    return Q if Q @ near > 0.0 else -Q


def fly(period: float, delay: float = 0.0, stop: float = 30.0, p: Parameters = PAPER, rtol: float = 1e-12) -> Array:
    """One row a second: time, P, V, Q, Ω, and the command computed then.

    The law samples every `period` [s]; a command acts `delay` < `period` [s] after its sample, and that of
    the first sample from the start.
    """
    if not 0.0 <= delay < period:
        raise ValueError(f"delay = {delay}: expected 0 <= delay < period = {period}")
    Q = Q0 / np.linalg.norm(Q0)
    x = np.concatenate([np.zeros(6), rotation(Q).ravel(), np.zeros(3)])
    held, rows = None, []
    for k in range(round(stop / period) + 1):
        t = k * period
        Q = quaternion(x[6:15].reshape(3, 3), Q)
        now = evaluate(x[:3], x[3:6], Q, x[15:], reference(t), p)
        command = np.array([now["thrust"], *now["torque"]])
        held = command if held is None else held
        if abs(t - round(t)) < 1e-9:
            rows.append([round(t), *x[:6], *Q, *x[15:], *command])
        for start, end, acting in ((t, t + delay, held), (t + delay, t + period, command)):
            if end > start:
                x = integrated(x, start, end, acting, p, rtol=rtol)
        held = command
    return np.array(rows)


def integrated(
    x: Array,
    start: float,
    end: float,
    command: Array,
    p: Parameters,
    *,
    force: Callable[[float], Array] = paper_wind,
    rtol: float = 1e-12,
) -> Array:
    """The state at `end` [s] from the one at `start` [s] under one command."""
    from scipy.integrate import solve_ivp

    solution = solve_ivp(motion, (start, end), x, method="DOP853", rtol=rtol, atol=1e-14, args=(command, p, force))
    if not solution.success:
        raise ArithmeticError(solution.message)
    return solution.y[:, -1]
