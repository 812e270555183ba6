"""A component about a point where it rests, as a linear simulator: its derivatives, measured through saved states.

The saved state of an FMU is opaque. So states near rest are produced by pulses on inputs, and identified by the outputs
afterwards, the inputs at rest again: these are its coordinates, reduced by their singular values to as many as there
are. States that are not controllable from inputs, or not observable from outputs, are no part of a loop. Restored to
such states, the component shows the derivatives of a step of any length.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestration.components.fmi.instance import Instance
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.theory.stability.linear_simulator import LinearSimulator

PULSE = 1e-6
"""Size of a pulse of an input, both ways, by its value, or absolute where that is smaller than 1"""
LARGEST_RESPONSE = 1e4
"""Largest response of an output to the pulse; later outputs are ignored"""
NOISE = 100.0 * np.finfo(float).eps
"""Effect of rounding on an output, likewise"""
OBSERVABLE = 1e-11
"""Share of the largest singular value: smaller ones count as 0"""
TURN = 1e-3
"""Difference of the response to a pulse on all inputs allowed from sample to sample"""
FEWEST_POINTS = 6
"""points of the ladder at which states are produced at least"""
LATER = 4
"""steps over which responses to pulses of several sizes are compared"""
LINEAR = 1e-6
"""Error of the derivatives allowed, by the outputs from a state, or absolute where these are smaller than 1"""


@dataclass(frozen=True, kw_only=True)
class Rest:
    """An instance at rest, with its last inputs and time."""

    fmu: Instance
    inputs: tuple[str, ...]
    """Reals that a connection feeds"""
    held: Floats
    """their values"""
    outputs: tuple[str, ...]
    """Reals that a connection reads"""
    time: float
    """Time of its next step, by its own clock [s]"""


@dataclass(frozen=True)
class _State:
    saved: bytes
    time: float


_Pair = tuple[_State, _State]
"""A state after a pulse up, and after one down"""


class Tangent(LinearSimulator):
    """A component about rest; as a `Simulator` it is linear, and begins at rest.

    `ladder` are the lengths of the steps [s] that produce and identify states; where the component only takes steps of
    a `unit`, whole numbers of it. Raises `UsageError` for a component that has more states than these show.
    """

    def __init__(self, rest: Rest, ladder: Sequence[float], pulse: float = PULSE, *, unit: float | None = None) -> None:
        super().__init__(rest.inputs, rest.outputs, states=0)  # set below, once they are found
        self.unit, self._fmu = unit, rest.fmu
        self._held, self._inputs_now = rest.held, rest.held.copy()
        self._write = rest.fmu.writer(rest.inputs, self._inputs_now)
        self._outputs_now: Floats = np.zeros(len(rest.outputs))
        self._read = rest.fmu.reader(rest.outputs, self._outputs_now)
        self._pulse = pulse * np.maximum(1.0, np.abs(rest.held))
        self._largest = LARGEST_RESPONSE * pulse
        self._time = rest.time
        self._rest = _State(rest.fmu.save(), rest.time)
        self._read()
        self._weight = np.maximum(1.0, np.abs(self._outputs_now))
        self._ladder = list(ladder)
        self._known: dict[int, tuple[Floats, Floats]] = {}
        self._expect_one_rate()
        self._find_coordinates()
        self.state = np.zeros(self._axes.shape[1])

    def step(self, t: float, h: float) -> None:
        """As `Simulator`; the same at any time."""
        by_state, by_input = self.derivatives(h)
        found = by_state @ self.state + by_input @ self.input
        self.output[:] = found[: len(self.output)]
        self.state[:] = found[len(self.output) :]

    def _expect_one_rate(self) -> None:
        """Raise `UsageError` where the response differs from sample to sample: the component has several rates."""
        if len(set(self._ladder)) > 1:  # no samples
            return
        rest, first, h = self._rest, None, self._ladder[0]
        for _ in self._ladder:
            perturbed = self._outputs_after(rest, self._held + self._pulse, [h])[0]
            unperturbed, rest = self._stepped(rest, self._held, h)
            response = (perturbed - unperturbed) / PULSE
            first = response if first is None else first
            if np.abs(response - first).max(initial=0.0) > TURN * max(1.0, np.abs(first).max(initial=0.0)):
                raise UsageError(f"{self._fmu.name}: responds to a pulse differently from sample to sample")

    # -- coordinates --------------------------------------------------------------------------------------------

    def _find_coordinates(self) -> None:
        """Produce states at points of the ladder until no further coordinates appear."""
        sets, before, rank = [self._pulse_responses()], 0, 0
        fewest = max([FEWEST_POINTS, *(self._dead_points(i) + 2 for i in range(len(self.inputs)))])
        for shown in range(1, len(self._ladder) + 1):
            self._shown = shown
            columns = [self._futures(pairs) for pairs in sets]
            while (len(sets) < fewest or not _is_spanned(columns)) and len(sets) < len(self._ladder):
                later = self._after_free_motion(sets[-1], self._ladder[len(sets)])
                if later is None:
                    break
                sets.append(later)
                columns.append(self._futures(later))
            futures = np.column_stack(columns)
            rank = _rank(futures)
            if rank == before and rank < len(futures):
                break
            before = rank
        if 0 < rank == min(futures.shape):
            raise UsageError(f"{self._fmu.name}: has more states than {len(sets)} pulses and {self._shown} steps show")
        self._choose([pair for pairs in sets for pair in pairs], futures, rank)

    def _choose(self, pairs: Sequence[_Pair], futures: Floats, rank: int) -> None:
        """The coordinates that `futures` span, and states that span them."""
        self._axes = np.linalg.svd(futures, full_matrices=False)[0][:, :rank]
        coordinates = self._axes.T @ futures
        chosen = _most_independent(coordinates, rank)
        self._pairs = [pairs[i] for i in chosen]
        self._inverse = np.linalg.inv(coordinates[:, chosen]) if rank else np.zeros((0, 0))

    def derivatives(self, h: float) -> tuple[Floats, Floats]:
        """Derivatives of the outputs and coordinates after a step of `h` [s], by coordinates and by inputs."""
        key = round(h * NANOSECONDS)
        if key not in self._known:
            by_pair = [self._difference([self._stepped(s, self._held, h) for s in pair]) for pair in self._pairs]
            by_input = [
                self._difference([self._stepped(self._rest, self._pulses(i, sign), h) for sign in (1, -1)])
                / (self._pulse[i] / PULSE)
                for i in range(len(self.inputs))
            ]
            size = len(self.outputs) + self._axes.shape[1]
            after, moved = (np.column_stack(c) if c else np.zeros((size, 0)) for c in (by_pair, by_input))
            self._known[key] = after @ self._inverse, moved
        return self._known[key]

    def prediction_error(self, pulse: float, h: float) -> float:
        """The error of the predicted responses to pulses of another size, relative to the largest of each output.

        Over a step of `h` [s], and over the next ones, the inputs at rest again.
        """
        by_state, by_input = self.derivatives(h)
        count, sizes = len(self.outputs), pulse * np.maximum(1.0, np.abs(self._held))
        predicted, state = [by_input[:count]], by_input[count:]
        for _ in range(LATER):
            predicted.append(by_state[:count] @ state)
            state = by_state[count:] @ state
        measured = np.zeros((LATER + 1, count, len(self.inputs)))
        for i, unit in enumerate(np.diag(sizes)):
            perturbed = [self._stepped(self._rest, self._held + sign * unit, h) for sign in (1, -1)]
            later = [self._outputs_after(state, self._held, [h] * LATER) for _, state in perturbed]
            up, down = (np.vstack([first, rest]) for (first, _), rest in zip(perturbed, later))
            measured[:, :, i] = (up - down) / (2.0 * sizes[i])
        scale = np.abs(measured).max(axis=(0, 2), initial=0.0)[:, None]
        return float((np.abs(measured - np.array(predicted)) / np.maximum(scale, 1e-300)).max(initial=0.0))

    def coordinates_of(self, saved: bytes) -> Floats:
        """The coordinates of a state saved at time 0 as its deviation from rest.

        Raises `UsageError` for one that no input reaches, or from which the component is not linear.
        """
        state, h = _State(saved, 0.0), self._ladder[0]
        found: Floats = self._axes.T @ self._deviation(state)
        outputs, later = self._stepped(state, self._held, h)
        at_rest, _ = self._stepped(self._rest, self._held, h)
        seen = [self._deviation(state), outputs - at_rest, self._axes.T @ self._deviation(later)]
        predicted = np.concatenate([self._axes @ found, self.derivatives(h)[0] @ found])
        error = np.abs(np.concatenate(seen) - predicted).max(initial=0.0)
        if not error <= LINEAR * max(1.0, np.abs(predicted).max(initial=0.0)):
            raise UsageError(
                f"{self._fmu.name}: its initial state is not linear about its operating point: expected initial values "
                "near it that its inputs could reach"
            )
        return found

    def _deviation(self, state: _State) -> Floats:
        """The coordinates of a state before they are reduced."""
        here, rest = (self._outputs_after(s, self._held, self._ladder[: self._shown]) for s in (state, self._rest))
        found: Floats = ((here - rest) / self._weight).ravel()
        return found

    def _stepped(self, start: _State, held: Floats, h: float) -> tuple[Floats, _State]:
        outputs = self._outputs_after(start, held, [h])[0]
        return outputs, _State(self._fmu.save(), self._time)

    def _difference(self, both: Sequence[tuple[Floats, _State]]) -> Floats:
        """Outputs and coordinates after a step, per unit of the pulse up and down."""
        (up, after_up), (down, after_down) = both
        future = self._axes.T @ self._future((after_up, after_down))
        found: Floats = np.concatenate([(up - down) / (2.0 * PULSE), future])
        return found

    def _pulse_responses(self) -> list[_Pair]:
        """For each input the states after a pulse on it over the first step of the ladder."""
        return [
            (self._stepped(self._rest, self._pulses(i, 1), h)[1], self._stepped(self._rest, self._pulses(i, -1), h)[1])
            for i, h in enumerate([self._ladder[0]] * len(self.inputs))
        ]

    def _dead_points(self, i: int) -> int:
        """The number of points of the ladder before an output responds to an input; 0 if none does."""
        for most in (FEWEST_POINTS, len(self._ladder)):
            up, down = (self._outputs_after(self._rest, self._pulses(i, s), self._ladder[:most]) for s in (1, -1))
            responds = (np.abs(up - down) / self._weight > NOISE).any(axis=1)
            if responds.any():
                return int(np.argmax(responds))
        return 0

    def _after_free_motion(self, pairs: Sequence[_Pair], h: float) -> list[_Pair] | None:
        """The states `h` [s] later, the inputs at rest; None if one has become too large."""
        later = []
        for pair in pairs:
            (up, after_up), (down, after_down) = (self._stepped(state, self._held, h) for state in pair)
            if np.abs((up - down) / self._weight).max(initial=0.0) > self._largest:
                return None
            later.append((after_up, after_down))
        return later

    def _futures(self, pairs: Sequence[_Pair]) -> Floats:
        columns = [self._future(pair) for pair in pairs]
        return np.column_stack(columns) if columns else np.zeros((self._shown * len(self.outputs), 0))

    def _future(self, pair: _Pair) -> Floats:
        """The coordinates of a state before they are reduced: outputs at the points of the ladder, as differences."""
        up, down = (self._outputs_after(state, self._held, self._ladder[: self._shown]) for state in pair)
        found: Floats = ((up - down) / self._weight).ravel() / (2.0 * PULSE)
        return found

    def _pulses(self, i: int, sign: int) -> Floats:
        held: Floats = self._held.copy()
        held[i] += sign * self._pulse[i]
        return held

    def _outputs_after(self, start: _State, held: Floats, steps: Sequence[float]) -> Floats:
        """Shape (steps, outputs); the inputs are `held` over all steps."""
        self._fmu.restore(start.saved)
        self._time, self._inputs_now[:] = start.time, held
        self._write()
        found: Floats = np.zeros((len(steps), len(self.outputs)))
        for k, h in enumerate(steps):
            count = 1 if self.unit is None else round(h / self.unit)
            for _ in range(count):
                self._fmu.step(self._time, h / count)
                self._time += h / count
            self._read()
            found[k] = self._outputs_now
        return found


def _is_spanned(columns: Sequence[Floats]) -> bool:
    """Whether the last states have added no coordinate."""
    return _rank(np.column_stack(columns)) == _rank(np.column_stack(columns[:-2]))


def _rank(futures: Floats) -> int:
    if not futures.size:
        return 0
    values = np.linalg.svd(futures, compute_uv=False)
    return int((values > max(OBSERVABLE * values[0], NOISE * np.sqrt(futures.size) / PULSE)).sum())


def _most_independent(columns: Floats, count: int) -> list[int]:
    """Columns that span the space of all, shape (n, m), by QR with pivoting: each the longest beyond those before."""
    rest, chosen = columns.copy(), list[int]()
    for _ in range(count):
        longest = int(np.argmax(np.linalg.norm(rest, axis=0)))
        direction = rest[:, longest] / np.linalg.norm(rest[:, longest])
        rest -= np.outer(direction, direction @ rest)
        rest[:, longest] = 0.0
        chosen.append(longest)
    return chosen
