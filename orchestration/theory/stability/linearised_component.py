"""A component about a point where it rests, as a linear simulator: its derivatives, measured through saved states.

The saved state of an FMU is opaque. So states near rest are produced by pulses on inputs, and identified by the outputs
afterwards, the inputs at rest again: these are its coordinates, reduced by their singular values to as many as stand
out of the errors of measurement. States that are not controllable from inputs, or not observable from outputs, are no
part of a loop. Restored to such states, the component shows the derivatives of a step of any length. What is found then
has to predict the response to a random input.
"""

import math
import sys
from collections.abc import Sequence
from copy import copy

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.foundation.basics.unit_algebra import counted
from orchestration.theory.stability.excitation import (
    MOVES,
    ROUNDING,
    STANDS_OUT,
    Errors,
    Excitation,
    Rest,
    Rung,
    SavedState,
    States,
)
from orchestration.theory.stability.linear_simulator import LinearSimulator

SCALINGS = 4
"""Rounds in which rows and columns are scaled to errors of one size"""
UNPROVEN = 1e-5
"""Error of a predicted response, relative to the largest of that output, from which a linear model is refused"""
ONE_SIDED = 1e-3
"""Share of a response that may be alike for a move and its opposite: measurement explains less"""
SMALLER = 0.125
"""Factor on moves by which that share falls, too, of what is smooth"""
PROOF_STEPS = 256
"""Steps of the random input, at most"""
PARTS = 64
"""Parts of a pulse, of which it has random numbers: a power of two, which is not rounded beside the input at rest"""
HELD_STEPS = 1024
"""Samples over which inputs are held to see slow states, at most"""
HELD_SHARES = (1.0, 0.1, 0.01, 0.001)
"""Factors on them, tried in turn: over so many samples an integral adds up about as many pulses"""
UNSEEN = 1e-4
"""Error of the response to a held input, relative to it at the end, from which slow states are taken to be missed"""
SAME = 0.1
"""Difference of such errors at two sizes, relative, up to which it is the model that is wrong, and not the size"""
SMALL = 0.01
"""Share of the largest response, below which one at the end counts as that much"""
FAST = 3.0
"""Growth of a response in a step, from which it is told as the reason why states are not seen"""
EXACT = 1e-9
"""Error of a tangent in continuous time, relative, up to which its pulse and its ladder are kept"""
FORETOLD = 16
"""Points of time at which a later response is foretold"""
LINEAR = 1e-6
"""Error allowed of what is predicted at another point of rest, from an initial state or much later, relative to the
largest"""


ROUNDED = 4.0 * float(np.finfo(float).eps)
"""Error of rounding of a derivative, relative, per condition number of the coordinates"""


class Tangent(LinearSimulator):
    """A component about rest; as a `Simulator` it is linear, and begins at rest.

    The rungs of `ladder` identify states, and the first `points` of them produce these, at `fewest` rungs at least; it
    has `most` states, the strongest.
    Where the component only takes steps of a `unit`, these are whole numbers of it. Raises `UsageError` for a component
    with more states than these show.
    """

    def __init__(
        self,
        excitation: Excitation,
        ladder: Sequence[Rung],
        fewest: int,
        *,
        unit: float | None = None,
        most: int = sys.maxsize,
        points: int = sys.maxsize,
    ) -> None:
        super().__init__(excitation.inputs, excitation.outputs, states=0)  # set below, once they are found
        self.unit, self._excitation, self.ladder = unit, excitation, list(ladder)
        self._fewest, self._most, self._points = fewest, most, min(points, len(self.ladder))
        self._known: dict[int, tuple[Floats, Floats]] = {}
        self.accuracy = 0.0
        self.noise = np.zeros((len(self.outputs), 0)), np.zeros((len(self.outputs), len(self.inputs)))
        """Errors of the derivatives, by coordinates and by inputs, as two sizes of pulses differ"""
        self._find_coordinates(excitation.errors_over(ladder), fewest)
        self.state = np.zeros(len(self._inverse))

    @property
    def pulse(self) -> float:
        """The pulse by which it was measured, relative."""
        return self._excitation.pulse

    @property
    def rounding(self) -> float:
        """The error, relative, that rounding alone may leave in derivatives.

        By nearly dependent coordinates, or of small responses beside the values at rest: as two sizes of pulses differ.
        """
        if not len(self._inverse):
            return 0.0
        measured = float(self.noise[0][len(self.outputs) :].max())
        return max(measured, ROUNDED * float(np.linalg.cond(self._inverse)))

    def step(self, t: float, h: float) -> None:
        """As `Simulator`; the same at any time."""
        by_state, by_input = self.derivatives(h)
        found = by_state @ self.state + by_input @ (self.input + self.added)
        self.output[:] = found[: len(self.output)]
        self.state[:] = found[len(self.output) :]

    def derivatives(self, h: float) -> tuple[Floats, Floats]:
        """Derivatives of the outputs and coordinates after a step of `h` [s], by coordinates and by inputs."""
        key = round(h * NANOSECONDS)
        if key not in self._known:
            excitation, rung = self._excitation, self._rung(h)
            by_state = [self._difference([excitation.followed(s, rung) for s in states]) for states in self._produced]
            by_input = [
                self._difference([excitation.stepped(excitation.rest, rung, excitation.pulsed(i, x)) for x in MOVES])
                / excitation.scale[i]
                for i in range(len(self.inputs))
            ]
            size = len(self.outputs) + len(self._inverse)
            after, moved = (np.column_stack(c) if c else np.zeros((size, 0)) for c in (by_state, by_input))
            self._known[key] = after @ self._inverse, moved
        return self._known[key]

    def coordinates_of(self, saved: bytes) -> tuple[Floats, float, float]:
        """The coordinates of a state saved at time 0 as its deviation from rest.

        With the error of the outputs that they predict, and the largest of these: the error is large for a state that
        no input reaches, or from which the component is not linear.
        """
        state, rung = SavedState(saved, 0.0), self.ladder[0]
        found: Floats = self._axes.T @ self._deviation(state)
        outputs, later = self._excitation.followed(state, rung)
        at_rest, _ = self._excitation.followed(self._excitation.rest, rung)
        seen = np.concatenate([self._deviation(state), outputs - at_rest, self._axes.T @ self._deviation(later)])
        after = self.derivatives(rung.duration)[0] @ found
        error = np.abs(seen - np.concatenate([self._back @ found, after])).max(initial=0.0)
        return found, float(error), float(np.abs(seen).max(initial=0.0))

    @property
    def rest(self) -> SavedState:
        """The state about which it is the tangent."""
        return self._excitation.rest

    def drift(self, state: SavedState, held: Floats) -> tuple[Floats, Floats]:
        """The outputs after a first rung from a state, and by how much the coordinates change, with inputs `held`."""
        excitation, rung = self._excitation, self._rung(self.ladder[0].duration)
        outputs, later = excitation.stepped(state, rung, held)
        here, there = (excitation.course(one, [(held, each) for each in self.ladder]) for one in (state, later))
        return outputs, self._axes.T @ ((there - here) / excitation.weight).ravel()

    def led(self, state: SavedState, inputs: Floats) -> SavedState:
        """The state after first rungs from a state, with inputs for each, shape (n, inputs)."""
        for held in inputs:
            _, state = self._excitation.stepped(state, self._rung(self.ladder[0].duration), held)
        return state

    def about(self, rest: Rest) -> "Tangent | None":
        """This tangent, if it holds to `LINEAR` where the same instance with the same inputs rests now; else None."""
        excitation = Excitation(rest)
        if not excitation.is_like(self._excitation):
            return None
        excitation.pulse, excitation.scale = self._excitation.pulse, self._excitation.scale
        again = copy(self)
        again.state, again.input, again.output = (np.zeros_like(x) for x in (self.state, self.input, self.output))
        try:
            again._prove(excitation)
        except UsageError:
            return None
        return again if again.accuracy <= LINEAR else None

    def with_pulse(self, factor: float) -> "Tangent":
        """The same with pulses times a factor, at no more states: what rounding adds to them is none."""
        excitation = copy(self._excitation)
        excitation.pulse *= factor
        again = Tangent(
            excitation, self.ladder, self._fewest, unit=self.unit, most=len(self.state), points=self._points
        )
        return again

    def prove(self, h: float, duration: float) -> None:
        """Compare its response to a random input, in steps of `h` over a `duration` [s], with that of the component.

        Raises `UsageError` where they differ; else `accuracy` is their largest difference, relative.
        """
        self._proof = h, duration
        self._prove(self._excitation)

    def _prove(self, excitation: Excitation) -> None:
        h, duration = self._proof
        rung, rng = self._rung(h), np.random.default_rng(0)
        count = _steps(h, duration)
        moves = rng.integers(-PARTS, PARTS, (count, len(self.inputs))) / PARTS * self._excitation.pulses
        moves[(count + 1) // 2 :] = 0.0
        measured, predicted = excitation.response_to(moves, rung), np.zeros((count, len(self.outputs)))
        by_state, by_input = self.derivatives(h)
        state, cut = np.zeros(len(self.state)), len(self.outputs)
        for k, move in enumerate(moves):
            after = by_state @ state + by_input @ move
            predicted[k], state = after[:cut], after[cut:]
        growth = max(1.0, float(np.abs(np.linalg.eigvals(by_state[cut:])).max(initial=0.0)))
        # slow states are not hidden by those that grow
        shrunk = np.asarray(growth ** -np.arange(count, dtype=float)[:, None], dtype=float)
        largest = np.abs(shrunk * measured).max(axis=0, initial=0.0)
        error = np.abs(shrunk * (measured - predicted)).max(axis=0, initial=0.0)
        error = np.maximum(error - STANDS_OUT * excitation.rounding, 0.0)
        self.accuracy = float((error / np.where(largest > 0.0, largest, 1.0)).max(initial=0.0))
        if not self.accuracy <= UNPROVEN:
            raise UsageError(
                f"{excitation.name}: its linear model, of {counted(len(state), 'state')}, does not predict the "
                f"response to a random input over {count * h:.3g} s: off by {self.accuracy:.1g} of the largest, "
                f"expected at most {UNPROVEN:g}"
            )
        self._expect_two_sided(excitation, moves, rung, largest, shrunk)

    def _expect_two_sided(
        self, excitation: Excitation, moves: Floats, rung: Rung, largest: Floats, shrunk: Floats
    ) -> None:
        """Raise `UsageError` where moves differ from their opposite in effect, and smaller ones by as large a share.

        The mean of both would be taken for the response to either.
        """
        before = 0.0
        for factor in (1.0, SMALLER):
            alike = np.abs(shrunk * excitation.one_sided(factor * moves, rung)).max(axis=0, initial=0.0)
            alike = np.maximum(alike - STANDS_OUT * excitation.rounding, 0.0) / factor
            share = float((alike / np.where(largest > 0.0, largest, excitation.pulse)).max(initial=0.0))
            if share <= max(ONE_SIDED, 0.5 * before):
                return
            before = share
        raise UsageError(
            f"{excitation.name}: small changes of its inputs up and down differ in effect, by {before:.1g} of it "
            "however small they are, as where it rests just at a limit: expected another operating point"
        )

    def foretells(self, end: float, longest: float) -> bool:
        """Whether it predicts the response to a pulse up to a later time [s], in steps of `longest` at most.

        It differs by no more than measurement explains: rounding, and as responses to two sizes of pulses differ.
        """
        excitation, cut = self._excitation, len(self.outputs)
        count = max(1, math.ceil(end / FORETOLD / longest - 1e-6))
        rungs = [Rung(count, self.unit or end / FORETOLD / count)] * FORETOLD
        by_state, by_input = self.derivatives(rungs[0].h)
        for i in range(len(self.inputs)):
            once, other = excitation.two_sizes(i, rungs, excitation.response)
            predicted, state = np.zeros_like(once), np.zeros(len(self.state))
            for k in range(len(once) * count):
                after = by_state @ state
                if k < count:
                    after += by_input[:, i] * excitation.scale[i]
                predicted[k // count], state = after[:cut] / excitation.weight, after[cut:]
            allowed = max(EXACT, min(STANDS_OUT * self.rounding, LINEAR)) * np.abs(once).max(initial=0.0)
            if (np.abs(once - predicted) > allowed + STANDS_OUT * np.abs(once - other)).any():
                return False
        return True

    def prove_held(self, h: float, samples: int = 1) -> None:
        """Compare its responses to inputs that are held, in steps of `h` [s], with those of the component.

        Of several `samples` in a step each input is held at all of them.

        They show slow states, as of an integral, that rounding hides from short responses. Raises `UsageError` where
        they differ.
        """
        excitation, rung, cut = self._excitation, self._rung(h), len(self.outputs)
        by_state, by_input = self.derivatives(h)
        first = 2 * len(self.ladder)
        steps, several = max(2 * first, HELD_STEPS // samples), len(self.inputs) // samples
        for i, name in enumerate(self.inputs[:several]):
            move = np.zeros(len(self.inputs))
            move[i::several] = 0.5 * excitation.pulses[i::several]
            predicted, state, moved = np.zeros((steps, cut)), np.zeros(len(self.state)), by_input @ move
            with np.errstate(over="ignore", invalid="ignore"):  # beyond what is compared
                for k in range(steps):
                    after = by_state @ state + moved
                    predicted[k], state = after[:cut], after[cut:]
            known = 2.0 * np.abs(predicted[:first]).max(axis=0, initial=0.0)
            beyond = np.flatnonzero((np.abs(predicted[first:]) > known).any(axis=1))
            count = first + int(beyond[0]) if len(beyond) else steps
            self._expect_held(name, move, predicted[:count], rung)

    def _expect_held(self, name: str, move: Floats, predicted: Floats, rung: Rung) -> None:
        """Compare the response to a `move` that is held with the one predicted; where they differ, to smaller ones.

        What adds up in an integral may leave the range that pulses have shown to be linear. Raises `UsageError` where
        they differ by as much of it at two sizes, or at all of them.
        """
        excitation, count, before = self._excitation, len(predicted), np.zeros(len(self.outputs))
        for share in HELD_SHARES:
            measured, late = excitation.response_to(np.tile(share * move, (count, 1)), rung), slice(count // 2, None)
            size = np.maximum(np.abs(measured[late]).max(axis=0), SMALL * np.abs(measured).max(axis=0))
            error = np.abs(measured - share * predicted)[late].max(axis=0) - STANDS_OUT * excitation.rounding
            found = np.maximum(error, 0.0) / np.where(size > 0.0, size, 1.0)
            hidden = (before > UNSEEN) & (UNSEEN * size <= STANDS_OUT * excitation.rounding)
            if (found <= UNSEEN).all() and not hidden.any():
                return
            if hidden.any() or (np.abs(found - before) <= SAME * found)[found > UNSEEN].any():
                break
            before = found
        still = (before > UNSEEN) & (np.ptp(measured[late], axis=0) == 0.0)
        stay = [y for y, one in zip(self.outputs, still) if one]
        cause = f"where {stay[0]} stays the same, as at a limit" if stay else "as where rounding hides a slow integral"
        raise UsageError(
            f"{excitation.name}: its linear model, of {counted(len(self.state), 'state')}, does not predict the "
            f"response to {name} held over {count * rung.h:.3g} s: off by {before.max():.1g} of it, expected at most "
            f"{UNSEEN:g}, {cause}"
        )

    # -- coordinates --------------------------------------------------------------------------------------------

    def _find_coordinates(self, errors: Errors, fewest: int) -> None:
        """Produce states at points of the ladder until no further coordinates appear."""
        excitation, ladder = self._excitation, self.ladder
        latest = [excitation.after_pulse(i, ladder[0]) for i in range(len(self.inputs))]
        produced, columns, noise, ranks = list[States](), list[Floats](), list[Floats](), list[int]()
        for point, rung in enumerate(ladder[: self._points]):
            produced += latest
            columns += [excitation.futures(states, ladder) for states in latest]
            noise += [errors.of_futures(i, point) for i in range(len(latest))]
            found = None
            if latest and point >= min(fewest, self._points) - 3:  # of earlier ones no rank is looked at
                found = self._coordinates(np.column_stack(columns), np.column_stack(noise))
            ranks.append(0 if found is None else len(found[1]))
            if len(ranks) >= fewest and len(set(ranks[-3:])) == 1:
                break
            latest = [(excitation.followed(a, rung)[1], excitation.followed(b, rung)[1]) for a, b in latest]
        if found is None or not len(found[1]):
            self._axes = self._back = np.zeros((len(ladder) * len(self.outputs), 0))
            self._produced, self._inverse = [], np.zeros((0, 0))
            return
        self._axes, chosen, self._back = found
        if ranks[-1] == min(len(columns), len(self._axes)):
            known = (
                f"{excitation.name}: has {counted(ranks[-1], 'state')} or more, as {counted(len(ranks), 'pulse')} and "
                f"{counted(len(ladder), 'step')} "
            )
            growth = max(map(self._growth, range(len(excitation.inputs))))
            if growth > FAST:
                raise UsageError(
                    f"{known}show no more before what a pulse leaves, which grows {growth:.2g}-fold in a step, is no "
                    "longer small and linear: expected a component that grows more slowly by itself"
                )
            raise UsageError(
                f"{known}show no more: expected fewer, or a response that stays small and linear for longer, as with a "
                "shorter period"
            )
        self._produced = [produced[k] for k in chosen]
        self._inverse = np.linalg.inv(self._axes.T @ np.column_stack([columns[k] for k in chosen]))
        seen = np.column_stack(noise) ** 2
        seen[~np.isfinite(seen)] = 0.0
        spread = np.vstack([seen[: len(self.outputs)] * excitation.weight[:, None] ** 2, self._axes.T**2 @ seen])
        moved = np.sqrt(spread[:, : len(self.inputs)]) / excitation.scale
        self.noise = np.sqrt(spread[:, chosen] @ self._inverse**2), moved

    def _growth(self, i: int) -> float:
        """The factor by which the response to a pulse on an input grows in a step, at most."""
        sizes = np.abs(self._excitation.response(i, [*self.ladder, *self.ladder[-2:]])).max(axis=1)
        sizes = sizes[sizes > 0.0]
        return float((sizes[1:] / sizes[:-1]).max(initial=0.0))

    def _coordinates(self, futures: Floats, errors: Floats) -> tuple[Floats, list[int], Floats]:
        """The coordinates of what stands out of the errors: weights of the rows, columns that span, the way back."""
        largest = max(float(np.abs(futures).max(initial=0.0)), 1e-100)
        errors = np.where(np.isfinite(errors), errors, largest)  # what could not be followed is not known at all
        errors += ROUNDING * np.abs(futures) + 1e-30 * largest
        rows, columns = np.ones((len(futures), 1)), np.ones(futures.shape[1])
        times = np.cumsum([rung.duration for rung in self.ladder])
        for _ in range(SCALINGS):
            columns = 1.0 / np.sqrt(np.mean((errors * rows) ** 2, axis=0))
            by_output = (errors * columns).reshape(-1, len(self.outputs), futures.shape[1]) ** 2
            decay = _decay(times, np.sqrt(np.mean(by_output, axis=(1, 2))))[:, None]
            rows = (decay / np.sqrt(np.mean(by_output * decay[:, :, None] ** 2, axis=(0, 2)))).reshape(-1, 1)
        left, values, _ = np.linalg.svd(futures * rows * columns, full_matrices=False)
        rank = min(int((values > STANDS_OUT * np.linalg.norm(errors * rows * columns, 2)).sum()), self._most)
        axes = left[:, :rank] * rows
        size = np.linalg.norm(axes, axis=0)
        chosen = _most_independent(axes.T @ (futures * columns), rank)
        return axes / size, chosen, left[:, :rank] / rows * size

    def _deviation(self, state: SavedState) -> Floats:
        """The coordinates of a state before they are reduced."""
        here, rest = (self._excitation.outputs_after(s, self.ladder) for s in (state, self._excitation.rest))
        return np.asarray(((here - rest) / self._excitation.weight).ravel())

    def _difference(self, followed: Sequence[tuple[Floats, SavedState]]) -> Floats:
        """Outputs and coordinates after a step, per unit of the pulse up and down."""
        (up, after_up), (down, after_down) = followed
        future = self._axes.T @ self._excitation.futures((after_up, after_down), self.ladder)
        return np.asarray(np.concatenate([(up - down) / (2.0 * self.pulse), future]))

    def _rung(self, h: float) -> Rung:
        return Rung(1, h) if self.unit is None else Rung(round(h / self.unit), self.unit)


def _steps(h: float, duration: float) -> int:
    return int(np.clip(duration / h, 2, PROOF_STEPS))


def _decay(times: Floats, errors: Floats) -> Floats:
    """The factors, exponential in time, by which errors that grow over these `times` [s] do not."""
    growth = float(np.polyfit(times, np.log(errors), 1)[0]) if len(times) > 1 else 0.0
    return np.asarray(np.exp(-max(0.0, growth) * times))


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
