"""The constant command under which the nominal model ends a hold period nearest to a given state."""

import math
from collections.abc import Callable
from typing import NamedTuple

from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.rigid_body import Body, RigidState, Wrench
from fmu_kit.scalar import FLOAT, Scalar, ScalarOps, repeat

ITERATIONS = 4
"""Iterations of Gauss-Newton: see `matched_command`."""
DIFFERENCE, ROUNDINGS = 1e-5, 200.0
"""Difference of the commands for the Jacobian [m/s²], [rad/s²]; in coarser numbers it is `ROUNDINGS` times the root of
their resolution, so that the states after a period of milliseconds still differ."""
COUNTS_AS_ZERO = 1e-150
"""Length of the vector part of a quaternion below which it counts as zero [1]."""


class _Candidate(NamedTuple):
    """A command, and its residuals."""

    command: tuple[Scalar, ...]
    """T/m [m/s²] and J⁻¹ Γ [rad/s²]: of similar size for every vehicle"""
    residuals: tuple[Scalar, ...]


def matched_command(
    simulate: Callable[[Wrench], RigidState],
    model: Body,
    target: RigidState,
    first: Wrench,
    weight: Scalar,
    ops: ScalarOps = FLOAT,
) -> Wrench:
    """The constant command that minimises ‖δv‖² + ‖δΩ‖² + ‖`weight` δθ‖² between the end of `simulate` and `target`.

    Gauss-Newton from the command `first`, in a fixed number of iterations; a step that does not improve is not taken.
    The Jacobian is by forward differences, so the model's equations need not be differentiated; its error slows the
    descent, and moves the minimum by no more than this error times the residual.
    """

    def candidate(command: tuple[Scalar, ...]) -> _Candidate:
        return _Candidate(command, residuals(simulate(_wrench(command, model)), target, weight, ops))

    difference = max(DIFFERENCE, ROUNDINGS * math.sqrt(ops.resolution))

    def iterated(i: int, now: _Candidate) -> _Candidate:
        columns = [
            [
                (there - here) / difference
                for there, here in zip(candidate(_shifted(now.command, k, difference)).residuals, now.residuals)
            ]
            for k in range(4)
        ]
        matrix = [[_inner(a, b) for b in columns] for a in columns]
        step = solve(matrix, [-_inner(column, now.residuals) for column in columns])
        after = candidate(tuple(x + dx for x, dx in zip(now.command, step)))
        better = _inner(after.residuals, after.residuals) < _inner(now.residuals, now.residuals)
        return _Candidate(*(tuple(ops.where(better, a, b) for a, b in zip(*parts)) for parts in zip(after, now)))

    start = (first.thrust / model.mass, *model.inertia.solve(first.torque))
    return _wrench(repeat(ITERATIONS, iterated, candidate(start)).command, model)


def residuals(state: RigidState, target: RigidState, weight: Scalar, ops: ScalarOps = FLOAT) -> tuple[Scalar, ...]:
    """δv [m/s], δΩ [rad/s] and `weight` δθ."""
    attitude = rotation_vector(target.quaternion.inverse() * state.quaternion, ops)
    return (
        *(state.velocity - target.velocity),
        *(state.angular_velocity - target.angular_velocity),
        *(weight * attitude),
    )


def rotation_vector(Q: Quaternion, ops: ScalarOps = FLOAT) -> Vec3:
    """The rotation vector [rad] of the unit quaternion `Q`, the shorter way."""
    size = Q.vector.norm(ops)
    angle = 2.0 * ops.atan2(size, abs(Q.scalar))
    vector: Vec3 = (ops.where(Q.scalar < 0.0, -angle, angle) / ops.maximum(size, COUNTS_AS_ZERO)) * Q.vector
    return vector


def solve(matrix: list[list[Scalar]], right: list[Scalar]) -> list[Scalar]:
    """Solve `matrix` x = `right` for a symmetric positive definite matrix, by elimination in place."""
    size = len(right)
    for k in range(size):
        for i in range(k + 1, size):
            factor = matrix[i][k] / matrix[k][k]
            for j in range(k, size):
                matrix[i][j] = matrix[i][j] - factor * matrix[k][j]
            right[i] = right[i] - factor * right[k]
    for k in reversed(range(size)):
        for j in range(k + 1, size):
            right[k] = right[k] - matrix[k][j] * right[j]
        right[k] = right[k] / matrix[k][k]
    return right


def _shifted(command: tuple[Scalar, ...], k: int, by: float) -> tuple[Scalar, ...]:
    return tuple(x + by if i == k else x for i, x in enumerate(command))


def _wrench(command: tuple[Scalar, ...], model: Body) -> Wrench:
    return Wrench(model.mass * command[0], model.inertia @ Vec3(*command[1:]))


def _inner(a: list[Scalar] | tuple[Scalar, ...], b: list[Scalar] | tuple[Scalar, ...]) -> Scalar:
    first, *others = (x * y for x, y in zip(a, b))
    total = first
    for other in others:
        total = total + other
    return total
