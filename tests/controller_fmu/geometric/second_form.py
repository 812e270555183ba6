"""The geometric law a second time: rotation matrices, numpy, and Taylor series in place of every written rate.

It shares no formula with `controller_fmu/geometric/law.py`: R_c is a series of matrices, Ω_c and its rate come out of
it, and the torque is the one that makes J de_Ω = -k_R e_R - k_Ω e_Ω.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.reference.law import cross, rotation, skew
from tests.reference.series import add, derivatives, from_derivatives, power, product, quotient, rate, scale

Array = Any
Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Gains as the paper has them, with the mass in k_x and k_v, and the nominal model."""

    m: float
    J: Array
    g: float
    k_x: float
    k_v: float
    k_R: Array
    """a number or a matrix, as is k_Omega"""
    k_Omega: Array


def vee(S: Array) -> Array:
    """v of the skew-symmetric [v]×."""
    assert np.allclose(S, -S.T, atol=1e-9 * (1.0 + np.abs(S).max()))
    return np.array([S[2, 1], S[0, 2], S[1, 0]])


def normalised(v: Array) -> Array:
    """The series of v/|v|."""
    return quotient(v, power(product(np.dot, v, v), 0.5))


def evaluate(
    P: Array, V: Array, Q: Array, Omega: Array, reference: Array, b1d: Array, p: Parameters
) -> dict[str, Array]:
    """Command and all that it is made of; `reference`: the rows P_d … S_d; `b1d`: it and two rates."""
    R = [rotation(Q).T, rotation(Q).T @ skew(Omega)]  # body to inertial
    b3 = [c @ Z for c in R]
    A_d = from_derivatives(*reference[2:5])

    # Each order of A gives the next derivative of the position error, by the model without wind.
    e = [P - reference[0], V - reference[1]]
    for order in range(3):
        x = from_derivatives(*e)
        weight = [p.m * p.g * Z, *[0.0 * Z] * order]
        A = add(scale(-p.k_x, x), scale(-p.k_v, rate(x)), scale(-1.0, weight), scale(p.m, A_d))
        if order < 2:
            f = scale(-1.0, product(np.dot, A, b3))
            push = derivatives(product(np.multiply, f, b3))[order] / p.m
            e.append((p.g * Z if order == 0 else 0.0) - push - reference[2 + order])

    b3c = normalised(scale(-1.0, A))
    b2c = normalised(product(cross, b3c, from_derivatives(*b1d)))
    b1c = product(cross, b2c, b3c)
    R_c = [np.column_stack(columns) for columns in zip(b1c, b2c, b3c)]
    transposed = [c.T for c in R_c]
    Omega_c = [vee(c) for c in product(np.matmul, transposed, rate(R_c))]
    seen = product(np.matmul, [c.T for c in R], product(np.matmul, R_c, Omega_c))  # Rᵀ R_c Ω_c

    error = R_c[0].T @ R[0]
    e_R = 0.5 * vee(error - error.T)
    e_Omega = Omega - seen[0]
    return {
        "thrust": f[0],
        "torque": cross(Omega, p.J @ Omega) + p.J @ seen[1] - np.dot(p.k_R, e_R) - np.dot(p.k_Omega, e_Omega),
        "position_error": e[0],
        "velocity_error": e[1],
        "acceleration_error": e[2],
        "jerk_error": e[3],
        "desired_angular_velocity": Omega_c[0],
        "desired_angular_acceleration": Omega_c[1],
        "angular_velocity_error": e_Omega,
        "rotation_error": e_R,
        "error_function": 0.5 * np.trace(np.eye(3) - error),
        "R_c": R_c[0],
    }
