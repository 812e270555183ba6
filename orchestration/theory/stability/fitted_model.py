"""A linear model fitted to many responses of a component that rounds, by least squares, and what rounding leaves of it.

Rounding differs from response to response. So the model that predicts all of them best is better than each of them, and
models of parts of the responses differ by what is not known.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Floats

GROUPS = 4
"""Parts of the responses, of which each has a model"""
FEWEST = 4
"""Responses of a part, at least"""
ITERATIONS = 4
EACH = 3.0
"""Numbers in the responses of a part for each number of the model, at least"""
MOST_NUMBERS = 400
"""Numbers of a model that is fitted, at most"""
HELD = 1e-7
"""Distance of an eigenvalue from 1 up to which the model holds its state as it is: a pulse shows that better"""
SAME = 1e-12
"""Share of the largest eigenvalue of the normal equations, below which a change of coordinates changes no response"""
LOWEST = 1e-4
"""Lowest frequency at which models are compared, as a share of the highest"""
FREQUENCIES = 100
BESIDE = 4
"""Frequencies to either side over which an output has its size: it may be 0 at one"""


@dataclass(frozen=True, kw_only=True)
class LinearModel:
    """Outputs, then the state after a step, by the state, then the inputs."""

    matrix: Floats
    states: int

    @property
    def outputs(self) -> int:
        """The number of outputs."""
        return len(self.matrix) - self.states

    @property
    def numbers(self) -> int:
        """Those that a fit may change."""
        return int(np.count_nonzero(self.matrix))

    def in_coordinates(self, axes: Floats) -> "LinearModel":
        """The same with other states, of which the old ones are these combinations."""
        found, cut = self.matrix.copy(), self.states
        found[:, :cut] = found[:, :cut] @ axes
        found[self.outputs :] = np.linalg.solve(axes, found[self.outputs :])
        return LinearModel(matrix=found, states=cut)

    def response(self, turns: Floats) -> Any:
        """The frequency response at some turns [rad] from step to step, shape (n, outputs, inputs)."""
        states, outputs = self.matrix[:, : self.states], self.matrix[:, self.states :]
        own, cut = np.exp(1j * turns)[:, None, None] * np.eye(self.states), self.outputs
        moved = np.broadcast_to(outputs[cut:], (len(turns), *outputs[cut:].shape))
        return states[:cut] @ np.linalg.solve(own - states[cut:], moved) + outputs[:cut]


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A model fitted to responses, and those fitted to parts of them."""

    model: LinearModel
    of_parts: Sequence[LinearModel]

    def spread(self, sizes: Floats) -> float:
        """Twice the largest difference of the frequency responses to inputs of some sizes, relative to an output's."""
        turns = np.pi * np.geomspace(LOWEST, 1.0, FREQUENCIES)
        own = self.model.response(turns) * sizes
        size = np.linalg.norm(own, axis=2)
        size = np.array([size[max(0, k - BESIDE) : k + BESIDE + 1].max(axis=0) for k in range(len(size))])
        size = np.where(size > 0.0, size, 1.0)
        apart = (np.linalg.norm(other.response(turns) * sizes - own, axis=2) / size for other in self.of_parts)
        return 2.0 * max(float(each.max(initial=0.0)) for each in apart)


def responses_needed(model: LinearModel, steps: int) -> int:
    """The number of responses of some steps that a fit needs; 0: the model is too large for one."""
    if not model.outputs or not 0 < model.numbers <= MOST_NUMBERS:
        return 0
    return GROUPS * max(FEWEST, int(np.ceil(EACH * model.numbers / (steps * model.outputs))))


def fitted(model: LinearModel, inputs: Floats, outputs: Floats) -> Fit:
    """The model fitted to responses from rest, shapes (responses, steps, signals); what is 0 in it stays so."""
    axes, held = _held_apart(model)
    begun = model.in_coordinates(axes)
    matrix, states = begun.matrix, slice(begun.outputs, None)
    changes = matrix != 0.0
    changes[states, : begun.states] = False
    changes[begun.outputs + held :, held : begun.states] = True
    matrix[begun.outputs : begun.outputs + held, held : begun.states] = 0.0
    matrix[begun.outputs + held :, :held] = 0.0
    free, parts = np.nonzero(changes), np.array_split(np.arange(len(inputs)), GROUPS)

    def moved(matrix: Floats, normal: Floats, right: Floats) -> Floats:
        found: Floats = matrix.copy()
        found[free] += _solved(normal.sum(axis=0), right.sum(axis=0))
        return found

    for _ in range(ITERATIONS):
        matrix = moved(matrix, *_normal_equations(matrix, begun.states, free, inputs, outputs))
    normal, right = _normal_equations(matrix, begun.states, free, inputs, outputs)
    back = np.asarray(np.linalg.inv(axes), dtype=float)
    each = (matrix, *(moved(matrix, normal[part], right[part]) for part in parts))
    whole, *of_parts = (LinearModel(matrix=one, states=begun.states).in_coordinates(back) for one in each)
    return Fit(model=whole, of_parts=of_parts)


def _held_apart(model: LinearModel) -> tuple[Floats, int]:
    """Axes along the states that are held, first, and along the others, and the number of the former."""
    own = model.matrix[model.outputs :, : model.states]
    held = int((np.abs(np.linalg.eigvals(own) - 1.0) <= HELD).sum()) if model.states else 0
    change = np.linalg.matrix_power(own - np.eye(model.states), max(1, held))
    left, _, right = np.linalg.svd(change)
    return np.hstack([right[model.states - held :].T, left[:, : model.states - held]]), held


def _normal_equations(
    matrix: Floats, states: int, free: tuple[Any, ...], inputs: Floats, outputs: Floats
) -> tuple[Floats, Floats]:
    """Those of each response, the errors of each output relative to their mean square."""
    (rows, columns), (responses, steps, _) = free, inputs.shape
    numbers, count = np.arange(len(rows)), len(matrix) - states
    state, by_number = np.zeros((responses, states)), np.zeros((responses, states, len(rows)))
    errors, derivatives = np.zeros((steps, responses, count)), np.zeros((steps, responses, count, len(rows)))
    for k in range(steps):
        before = np.hstack([state, inputs[:, k]])
        after, after_by_number = before @ matrix.T, matrix[:, :states] @ by_number
        after_by_number[:, rows, numbers] += before[:, columns]
        errors[k], state = outputs[:, k] - after[:, :count], after[:, count:]
        derivatives[k], by_number = after_by_number[:, :count], after_by_number[:, count:]
    size = np.sqrt((errors**2).mean(axis=(0, 1)))
    size = np.maximum(size, max(1e-12 * float(np.abs(outputs).max(initial=0.0)), 1e-300))
    errors, derivatives = errors / size, derivatives / size[:, None]
    normal = np.einsum("krip,kriq->rpq", derivatives, derivatives, optimize=True)
    return normal, np.einsum("krip,kri->rp", derivatives, errors)


def _solved(normal: Floats, right: Floats) -> Floats:
    size = np.sqrt(np.diagonal(normal))
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.pinv(normal / np.outer(size, size), rcond=SAME, hermitian=True) @ (right / size) / size)
