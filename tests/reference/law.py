"""The law (1)-(33) on numpy vectors, matrices and Taylor series.

Only what is not a rate is written down, in the order of the paper, with the errata of `docs/law.md`. Every
rate (24)-(28), (31), the desired angular velocity (13), (14) and its rate come out of series arithmetic.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tests.reference.series import (
    Series,
    add,
    derivatives,
    from_derivatives,
    power,
    product,
    quotient,
    rate,
    scale,
    tanh,
)

Array = Any
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Gains and nominal model; the defaults are the paper's flight (section V)."""

    m: float = 1.0
    J: Array = field(default_factory=lambda: np.eye(3))
    g: float = 9.81
    k_t: Array = field(default_factory=lambda: np.full(3, 2.0))
    beta: float = 0.99
    k_s: float = 5.0
    beta_t: float = 0.99
    epsilon: float = 1e-3
    k_eta: float = 15.0
    k_theta: float = 15.0
    k_q: float = 15.0
    kappa: float = 1.0


def cross(a: Array, b: Array) -> Array:
    """a × b of two 3-vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def skew(v: Array) -> Array:
    """[v]×."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def hamilton(a: Array, b: Array) -> Array:
    """a ⊙ b of two quaternions x, y, z, w."""
    return np.append(a[3] * b[:3] + b[3] * a[:3] + cross(a[:3], b[:3]), a[3] * b[3] - a[:3] @ b[:3])


def conjugate(Q: Array) -> Array:
    """Q⁻¹ of a unit quaternion x, y, z, w."""
    return Q * np.array([-1.0, -1.0, -1.0, 1.0])


def pure(v: Array) -> Array:
    """[v, 0]."""
    return np.append(v, 0.0)


def rotation(Q: Array) -> Array:
    """R(Q) from inertial to body components (1), as a matrix."""
    x, y, z, w = Q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
            [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
            [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def transposed(R: Series) -> Series:
    """Of a series of matrices."""
    return [c.T for c in R]


def sliding(e: Series, p: Parameters) -> Series:
    """s (19)-(21), one term shorter than the position error `e`; a line inside the boundary layer."""
    axes = []
    for axis in range(3):
        x = [c[axis] for c in e]
        side = np.sign(x[0])
        outside = abs(x[0]) >= p.epsilon
        axes.append(scale(p.k_s * side, power(scale(side, x), p.beta_t)) if outside else scale(p.k_s, x))
    return add([np.array(c) for c in zip(*axes)], rate(e))


def evaluate(P: Array, V: Array, Q: Array, Omega: Array, reference: Array, p: Parameters) -> dict[str, Array]:
    """Command and all that it is made of, by the names of the tables.

    `P` [m], `V` [m/s] inertial; `Q` x, y, z, w, body to inertial; `Omega` [rad/s] body; `reference`: the rows
    P_d, V_d, A_d, J_d, S_d.
    """
    R = [rotation(Q), -skew(Omega) @ rotation(Q)]
    A_d = from_derivatives(*reference[2:5])
    axis = [c @ Z for c in transposed(R)]  # of the thrust, inertial

    # F to second order: each order of F gives the next derivative of e, by the model without wind.
    e = [P - reference[0], V - reference[1]]
    for order in range(3):
        s = sliding(from_derivatives(*e), p)
        F = add(A_d, scale(-(p.k_t + p.beta), tanh(s)))  # (22), (23), (32)
        u = add([p.g * Z, *[0.0 * Z] * order], scale(-1.0, F))
        n = power(product(np.dot, u, u), 0.5)  # (11)
        if order < 2:
            lift = derivatives(product(np.multiply, n, axis))
            e.append((p.g * Z if order == 0 else 0.0) - lift[order] - reference[2 + order])

    cosine = quotient([c[2] for c in u], scale(2.0, n))
    q_d0 = power([cosine[0] + 0.5, *cosine[1:]], 0.5)  # (12)
    leaning = [np.array([c[1], -c[0], 0.0]) for c in F]
    q_d = quotient(leaning, scale(2.0, product(np.multiply, n, q_d0)))
    Q_d = [np.append(vector, scalar) for vector, scalar in zip(q_d, q_d0)]
    Q_d_inverse = [conjugate(c) for c in Q_d]
    Omega_d = [c[:3] for c in scale(2.0, product(hamilton, Q_d_inverse, rate(Q_d)))]  # the meaning of (13)

    Q_err = product(hamilton, Q_d_inverse, [Q, 0.5 * hamilton(Q, pure(Omega))])  # (8)
    q = [c[:3] for c in Q_err]
    q_bar = [np.array([c[1], -c[0], -c[3]]) for c in Q_err]
    R_d = [rotation(Q_d[0]), -skew(Omega_d[0]) @ rotation(Q_d[0])]
    R_err = product(np.matmul, R, transposed(R_d))
    Omega_d_body = product(np.matmul, R_err, Omega_d)
    Omega_err = Omega - Omega_d_body[0]

    s_body = product(np.matmul, R, s)
    pull = product(np.multiply, n, product(cross, q_bar, s_body))
    Psi = add(scale(-p.k_eta, q), scale(-2.0 * p.kappa / p.k_q, pull))  # (29)
    Theta = Omega_err - Psi[0]  # (9)
    # (30) is the torque that makes J dΘ = -k_θ Θ - k_q q̃.
    torque = cross(Omega, p.J @ Omega) + p.J @ (Omega_d_body[1] + Psi[1]) - p.k_theta * Theta - p.k_q * q[0]
    energy = 2.0 * p.k_q * (1.0 - Q_err[0][3]) + 0.5 * Theta @ p.J @ Theta + 0.5 * p.kappa * s[0] @ s[0]  # (33)

    s_derivatives, F_derivatives = derivatives(s), derivatives(F)
    return {
        "thrust": p.m * n[0],
        "torque": torque,
        "sliding": s_derivatives[0],
        "sliding_rate": s_derivatives[1],
        "virtual_control": F_derivatives[0],
        "virtual_control_rate": F_derivatives[1],
        "virtual_control_acceleration": F_derivatives[2],
        "desired_quaternion": Q_d[0],
        "desired_angular_velocity": Omega_d[0],
        "desired_angular_acceleration": Omega_d[1],
        "psi": Psi[0],
        "psi_rate": Psi[1],
        "theta": Theta,
        "position_error": e[0],
        "velocity_error": e[1],
        "attitude_error": Q_err[0],
        "angular_velocity_error": Omega_err,
        "energy": energy,
    }
