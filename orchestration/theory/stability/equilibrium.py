"""The rest of a loop from one near by, by Newton's method: also of one that is unstable, which no run reaches.

At rest signals do not change, so delays, holds and periods do not matter: each component stays in its state, at the
inputs that the outputs of the others give it. By the tangents near by these are linear equations; to the state that
solves them a component is led by pulses on its inputs. As it need not be linear, that is repeated from there.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.connection import Connection
from orchestration.theory.stability.lifted_component import LiftedTangent
from orchestration.theory.stability.linearised_component import Tangent

PULSES = 32
"""Steps over which a component is led to another state: over more they are smaller"""
ROUNDS = 30
"""Repetitions at most"""
BALANCED = 1e-12
"""The imbalance that remains then, relative where signals are above 1"""


class Steady:
    """A component that nearly stays in a state: x = A x + B v + a, y = C x + D v + c, with changes v of its inputs.

    Those of several samples are taken together, with the same inputs at each, and the outputs of the last.
    """

    def __init__(self, name: str, found: Tangent | LiftedTangent, held: Mapping[str, float]) -> None:
        self.name, self.inputs, self.outputs = name, found.inputs, found.outputs
        self._whole, self._samples = (found.whole, found.samples) if isinstance(found, LiftedTangent) else (found, 1)
        self.held = np.array([held[one] for one in self.inputs])
        self.state = self._whole.rest
        by_state, by_input = self._whole.derivatives(self._whole.ladder[0].duration)
        by_input = by_input.reshape(len(by_input), self._samples, len(self.inputs)).sum(axis=1)
        end = len(self._whole.outputs)
        self._last, after = slice(end - len(self.outputs), end), slice(end, None)
        self.A, self.B, self.C, self.D = by_state[after], by_input[after], by_state[self._last], by_input[self._last]
        self.measure()

    def measure(self) -> None:
        """Find a and c in the present state, at the inputs held."""
        outputs, self.a = self._whole.drift(self.state, np.tile(self.held, self._samples))
        self.c = outputs[self._last]

    def lead(self, x: Floats, v: Floats) -> None:
        """Lead it by pulses to a state of these coordinates, with changes of its inputs that last."""
        pulses: Floats = np.zeros((0, len(v)))
        if np.abs(x).max(initial=0.0) > BALANCED:
            powers = [np.eye(len(x))]
            for _ in range(PULSES - 1):
                powers.append(self.A @ powers[-1])
            reached = np.hstack([power @ self.B for power in reversed(powers)])
            drifted = np.sum(powers, axis=0) @ self.a
            pulses = np.linalg.lstsq(reached, x - drifted, rcond=None)[0].reshape(PULSES, len(v))
        given = self.held + np.vstack([pulses, v])
        self.state, self.held = self._whole.led(self.state, np.tile(given, self._samples)), self.held + v
        self.measure()


def balance(components: Sequence[Steady], connections: Sequence[Connection]) -> None:
    """Lead components to states in which each stays, at the inputs that connections bring, as nearly as it goes."""
    missing = np.inf
    for _ in range(ROUNDS):
        left, right = _equations(components, connections)
        missing, before = float(np.abs(right).max(initial=0.0)), missing
        if not BALANCED < missing < before:
            return
        found = iter(np.split(np.linalg.lstsq(left, right, rcond=None)[0], np.cumsum(_sizes(components))[:-1]))
        for one in components:
            one.lead(next(found), next(found))


def _equations(components: Sequence[Steady], connections: Sequence[Connection]) -> tuple[Floats, Floats]:
    """What the coordinates and changed inputs of the components in turn solve together: the matrix, and the right."""
    ends = np.cumsum([0, *_sizes(components)])
    left, right = np.eye(ends[-1]), np.zeros(ends[-1])
    rows = {
        f"{one.name}.{x}": ends[2 * k + 1] + i for k, one in enumerate(components) for i, x in enumerate(one.inputs)
    }
    held = {f"{one.name}.{x}": value for one in components for x, value in zip(one.inputs, one.held.tolist())}
    for k, one in enumerate(components):
        x, v = slice(ends[2 * k], ends[2 * k + 1]), slice(ends[2 * k + 1], ends[2 * k + 2])
        left[x, x] -= one.A
        left[x, v] -= one.B
        right[x] = one.a
        outputs = {f"{one.name}.{output}": place for place, output in enumerate(one.outputs)}
        wires = ((wire, *ends) for wire in connections for ends in zip(wire.start, wire.end))
        for wire, start, end in wires:
            if start in outputs and end in rows:
                row, y = rows[end], outputs[start]
                left[row, x] -= wire.scale * one.C[y]
                left[row, v] -= wire.scale * one.D[y]
                right[row] = wire.scale * one.c[y] + wire.offset - held[end]
    return left, right


def _sizes(components: Sequence[Steady]) -> list[int]:
    return [size for one in components for size in (len(one.a), len(one.held))]
