"""An instance at rest, whose inputs are pulsed, and which is followed from saved states.

Small deviations are linear as far as pulses of two sizes agree: this determines the size of pulses and how long a
response is followed. What rounds more than double precision does drowns small pulses, and is refused.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orchestration.components.fmi.instance import Instance
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.stability.operating_point import AT_REST

PULSE = 2.0**-20
"""Pulse of an input, up and down, with which the search for the best one begins: relative to its value, or absolute
where that is smaller than 1. It and the others are powers of two, which the sum with the value does not round"""
FINER = 2.0**-3
"""Factor from one to the next"""
MIN_PULSE, MAX_PULSE = 2.0**-80, 1.0
"""Ends of that search: only of an instance that rests at 0 rounding lets the response to the smallest be seen"""
LOST = 1e-9
"""Pulse from which on smaller ones may be lost in rounding without a sign of it, as none is linear, too"""
OTHER_SIZE = 1.5
"""Factor of the pulses that are compared: no power of two, which would be rounded alike"""
MAX_DEVIATION = 0.01
"""Deviation of an output from rest, relative or absolute, beyond which it is not followed: it might end the FMU"""
MAX_GROWTH = 100.0
"""Response, in pulses, up to which longer steps are tried"""
NONLINEAR = 1e-9
"""Difference of two sizes, relative to the largest response so far, up to which a response is linear"""
LEAST = 3.0
"""Factor of the least difference that any size has, up to which it is linear, too"""
ROUNDING = float(np.finfo(float).eps)
COARSE = 1e-5
"""Difference of responses to small pulses, relative, from which an instance is taken to round coarsely"""
COARSER = 1e-11
"""Difference of the outputs then, which double precision rounds by less"""
STANDS_OUT = 10.0
"""Factor on errors: what is larger is none"""
DITHER = (1.0, 1.140625, 1.296875, 1.453125)
"""Factors of the pulses that show it: rounded alike at two sizes, responses may agree by chance"""
FOLLOWS = 0.05
"""Share of the largest response of an output, from which it follows an input"""
LARGER = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
"""Pulses of an input that none of the outputs follows, by which it is seen whether they follow larger ones"""
ALIKE = 0.1
"""Difference of a step to two of half its length, relative to the largest response, up to which it is used instead"""


@dataclass(frozen=True, kw_only=True)
class Rest:
    """An instance at rest, with its last inputs and time."""

    fmu: Instance
    inputs: tuple[str, ...]
    """Reals that a connection feeds"""
    held: Floats
    """Values of these inputs"""
    outputs: tuple[str, ...]
    """Reals that a connection reads"""
    time: float
    """Time of its next step, by its own clock [s]"""


class Rung(NamedTuple):
    """Equal steps from one reading of the outputs to the next."""

    steps: int
    h: float
    """Length of a step [s]"""

    @property
    def duration(self) -> float:
        """From one reading to the next [s]."""
        return self.steps * self.h


@dataclass(frozen=True)
class SavedState:
    """A state of the instance, as its FMU saves it."""

    saved: bytes
    time: float
    """Time of the next step [s]"""


States = tuple[SavedState, SavedState]
"""States after a pulse up and one down"""
MOVES = (1.0, -1.0)


class ImpreciseError(UsageError):
    """Small deviations of an instance cannot be told from its rounding, whatever the method."""


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Errors of responses to a pulse over the first rung of a ladder that is gone through twice."""

    times: Floats
    """Time of each rung's end [s]"""
    values: Floats
    """Shape (inputs, rungs, outputs), as `Excitation.response`"""

    def of_futures(self, i: int, point: int) -> Floats:
        """Those of the futures of a state produced by an input at a point of the ladder, in a row."""
        ladder = self.times[: len(self.times) // 2]
        at = np.searchsorted(self.times, (ladder[point] + ladder) * (1.0 - 1e-9))
        return np.asarray(np.maximum(self.values[i, at], self.values[i, np.maximum(at - 1, 0)]).ravel())


class Excitation:
    """The responses of an instance about rest, per unit of a pulse; outputs relative to their values where above 1."""

    def __init__(self, rest: Rest) -> None:
        self.inputs, self.outputs = rest.inputs, rest.outputs
        self.pulse, self.largest = PULSE, MAX_DEVIATION
        self.scale = np.exp2(np.floor(np.log2(np.maximum(1.0, np.abs(rest.held)))))
        self._fmu, self.held, self._inputs_now = rest.fmu, rest.held, rest.held.copy()
        self._write = rest.fmu.writer(rest.inputs, self._inputs_now)
        self._outputs_now: Floats = np.zeros(len(rest.outputs))
        self._read = rest.fmu.reader(rest.outputs, self._outputs_now)
        self._time = rest.time
        self._followed: dict[tuple[SavedState, Rung], tuple[Floats, SavedState]] = {}
        self.rest = SavedState(rest.fmu.save(), rest.time)
        self.later = self.rest  # an unstable component that has only nearly come to rest is elsewhere by then
        self._read()
        self.at_rest = self._outputs_now.copy()
        self.weight = np.maximum(1.0, np.abs(self.at_rest))
        self._around = [*zip(self.at_rest.tolist(), self.weight.tolist())]

    @property
    def name(self) -> str:
        """The name of the instance."""
        return self._fmu.name

    def is_like(self, other: "Excitation") -> bool:
        """Whether it is of the same instance and signals, at rest with the same inputs, as nearly as rest is."""
        if self._fmu is not other._fmu or (self.inputs, self.outputs) != (other.inputs, other.outputs):
            return False
        return bool((np.abs(self.held - other.held) <= AT_REST * self.scale).all())

    @property
    def pulses(self) -> Floats:
        """The pulse of each input."""
        return self.pulse * self.scale

    @property
    def rounding(self) -> Floats:
        """The error of rounding of each output, at most: smaller with pulses that only rest at 0 allows."""
        return np.asarray(ROUNDING * self.weight * min(1.0, self.pulse / LOST))

    def pulsed(self, i: int, factor: float) -> Floats:
        """The inputs with a pulse on one of them, times `factor`."""
        held: Floats = self.held.copy()
        held[i] += factor * self.pulses[i]
        return held

    def outputs_after(self, start: SavedState, rungs: Sequence[Rung]) -> Floats:
        """The outputs at the end of each rung, shape (rungs, outputs), the inputs at rest."""
        if len(set(rungs)) > 1:
            return self.course(start, [(self.held, rung) for rung in rungs])
        found: Floats = np.zeros((len(rungs), len(self.outputs)))
        for k, rung in enumerate(rungs):  # samples, most of which an earlier state has come by
            found[k], start = self.followed(start, rung)
        return found

    def course(self, start: SavedState, legs: Sequence[tuple[Floats, Rung]], largest: float = np.inf) -> Floats:
        """The outputs at the end of each rung, with its inputs; ends with a deviation from rest above `largest`."""
        self._fmu.restore(start.saved)
        self._time, inputs = start.time, None
        found, step = [], self._fmu.step
        for held, rung in legs:
            if held is not inputs:
                self._inputs_now[:] = inputs = held
                self._write()
            for _ in range(rung.steps):
                step(self._time, rung.h)
                self._time += rung.h
            self._read()
            found.append(self._outputs_now.copy())
            if largest < np.inf and not self._is_followed(found[-1], largest):
                break
        return np.array(found).reshape(len(found), len(self.outputs))

    def stepped(self, start: SavedState, rung: Rung, held: Floats) -> tuple[Floats, SavedState]:
        """The outputs and the state after a rung; the inputs are `held`."""
        outputs = self.course(start, [(held, rung)])[0]
        return outputs, SavedState(self._fmu.save(), self._time)

    def followed(self, start: SavedState, rung: Rung) -> tuple[Floats, SavedState]:
        """The outputs and the state after a rung, the inputs at rest; the FMU goes there once."""
        if (start, rung) not in self._followed:
            self._followed[start, rung] = self.stepped(start, rung, self.held)
        return self._followed[start, rung]

    def futures(self, states: States, rungs: Sequence[Rung]) -> Floats:
        """What outputs do from a state, the inputs at rest: their differences at the end of each rung, in a row."""
        up, down = (self.outputs_after(state, rungs) for state in states)
        return np.asarray(((up - down) / self.weight).ravel() / (2.0 * self.pulse))

    def after_pulse(self, i: int, rung: Rung) -> States:
        """The states after a pulse on an input over a rung."""
        up, down = (self.stepped(self.rest, rung, self.pulsed(i, move))[1] for move in MOVES)
        return up, down

    def response(
        self,
        i: int,
        rungs: Sequence[Rung],
        *,
        factor: float = 1.0,
        lasting: bool = False,
        start: SavedState | None = None,
    ) -> Floats:
        """The response to a pulse on an input over the first rung, or all, shape (n, outputs); n ends with a large one.

        The pulse is multiplied by `factor`, and the response divided by it. It begins at `start`; default: at rest.
        """
        courses = []
        for move in MOVES:
            pulsed = self.pulsed(i, factor * move)
            later = pulsed if lasting else self.held
            legs = [(later if k else pulsed, rung) for k, rung in enumerate(rungs)]
            courses.append(self.course(start or self.rest, legs, self.largest))
        return self._response(courses, factor)

    def followed_response(
        self, i: int, rungs: Sequence[Rung], *, factor: float = 1.0, start: SavedState | None = None
    ) -> Floats:
        """As `response`, through states that are kept: the same ones are followed once."""
        if len(set(rungs)) > 1:
            return self.response(i, rungs, factor=factor, start=start)
        courses = []
        for move in MOVES:
            outputs, state = self.stepped(start or self.rest, rungs[0], self.pulsed(i, factor * move))
            course = [outputs]
            while len(course) < len(rungs) and self._is_followed(course[-1], self.largest):
                outputs, state = self.followed(state, rungs[0])
                course.append(outputs)
            courses.append(np.array(course))
        return self._response(courses, factor)

    def _response(self, courses: Sequence[Floats], factor: float) -> Floats:
        up, down = (course[: min(map(len, courses))] for course in courses)
        return np.asarray((up - down) / self.weight / (2.0 * factor * self.pulse))

    def _is_followed(self, outputs: Floats, largest: float) -> bool:
        return all(abs((y - rest) / weight) <= largest for y, (rest, weight) in zip(outputs.tolist(), self._around))

    def left(self, outputs: Floats) -> int:
        """After how many rows, shape (n, outputs), these leave rest farther than they are followed; else n."""
        return next((k for k, one in enumerate(outputs) if not self._is_followed(one, self.largest)), len(outputs))

    def response_to(self, moves: Floats, rung: Rung) -> Floats:
        """The response to deviations of the inputs, shape (n, inputs), each over a rung; shape (n, outputs)."""
        up, down = (self._moved(move * moves, rung) for move in MOVES)
        return np.asarray(0.5 * (up - down))

    def one_sided(self, moves: Floats, rung: Rung) -> Floats:
        """What is alike in the responses to such deviations and to their opposite: of a linear instance nothing."""
        up, down, still = (self._moved(move * moves, rung) for move in (*MOVES, 0.0))
        return np.asarray(0.5 * (up + down) - still)

    def _moved(self, moves: Floats, rung: Rung) -> Floats:
        return self.course(self.rest, [(x, rung) for x in self.held + moves])

    # -- coarse rounding -------------------------------------------------------------------------------------------

    def expect_fine(self, rungs: Sequence[Rung]) -> None:
        """Raise `ImpreciseError` for an instance that rounds more coarsely than double precision does."""
        chosen, largest = self.pulse, self.largest
        try:
            self._expect_small_ones_followed(rungs)
            self.pulse, self.largest = chosen, largest
            for self.pulse, least in ((chosen, 0.0), (PULSE, COARSER)) if chosen > PULSE else ((chosen, 0.0),):
                self._expect_alike(rungs, least)
        finally:
            self.pulse, self.largest = chosen, largest

    def _expect_alike(self, rungs: Sequence[Rung], least: float) -> None:
        """Responses to pulses of several sizes may not differ by more than a linear model may, and by `least`."""
        for i in range(len(self.inputs)):
            courses = [self.response(i, rungs, factor=factor) for factor in DITHER]
            each = np.array([course[: min(map(len, courses))] for course in courses])
            apart = float(np.ptp(each, axis=0).max(initial=0.0))
            if apart > max(COARSE * float(np.abs(each).max(initial=0.0)), least / self.pulse):
                raise self._imprecise(f"has outputs that jump as {self.inputs[i]} changes by {self.pulse:.2g}")

    def _imprecise(self, what: str) -> ImpreciseError:
        return ImpreciseError(
            f"{self.name} {what}, as code in single precision, or that quantises or has a dead zone: what small "
            "deviations do cannot be told: expected double precision, floats as C with quadcosim wrap, and the steps "
            "of a converter as quantisation of its connection, which linear theory leaves out"
        )

    def _expect_small_ones_followed(self, rungs: Sequence[Rung]) -> None:
        """Outputs that follow large deviations of an input have to follow small ones, too."""
        small = [self.response(i, rungs) for i in range(len(self.inputs))]
        usual = np.max([np.abs(one).max(axis=0, initial=0.0) for one in small], axis=0, initial=0.0)
        chosen, self.largest = self.pulse, np.inf
        for i in (i for i, one in enumerate(small) if not one.any()):
            for self.pulse in (pulse for pulse in LARGER if pulse > chosen):
                follows = np.abs(self.response(i, rungs)).max(axis=0, initial=0.0)
                if (follows > FOLLOWS * usual).any():
                    what = f"follows a change of {self.inputs[i]} by {self.pulse:g}, but not by {chosen:.1g}"
                    raise self._imprecise(what)

    # -- how far it is linear -------------------------------------------------------------------------------------

    def choose_pulse(self, rungs: Sequence[Rung]) -> int:
        """Choose the pulse; the number of rungs over which responses are linear.

        It is the pulse that is linear for longest, and of these the one to whose size and another responses agree best:
        smaller ones are lost in rounding. The search goes upward only from responses that are linear, and down, of a
        response that grows, while a smaller one is linear for no shorter, and where the first is.
        """
        tried = {PULSE: self._nonlinearity(rungs, PULSE)}
        early, pulse = len(tried[PULSE]) // 3, PULSE
        rounding = tried[PULSE][early]
        while (pulse := pulse / FINER) <= MAX_PULSE:
            tried[pulse] = self._nonlinearity(rungs, pulse)
            if len(tried[pulse]) <= early or not tried[pulse][early] < rounding:
                break
            rounding = tried[pulse][early]
        linear = {size: _linear(tried[size], max(NONLINEAR, LEAST * rounding)) for size in tried}
        best, first = max(linear, key=lambda size: linear[size]), linear[PULSE][0]
        pulse = min(best, PULSE)
        while linear[pulse][0] == linear[best][0] < len(rungs) and FINER * pulse >= MIN_PULSE:
            tried_before, pulse = pulse, FINER * pulse
            if pulse < LOST and not self._responds_alike(rungs[: linear[best][0] + 1], pulse, tried_before):
                break
            smaller, allowed = self._nonlinearity(rungs, pulse, rounded=True), max(NONLINEAR, LEAST * rounding)
            if smaller[max(0, first - 1) : first].max(initial=0.0) > allowed:
                break
            linear[pulse] = _linear(smaller, allowed)
            best = max(best, pulse, key=lambda size: linear[size][0])
        self.pulse = best
        return linear[best][0]

    def _responds_alike(self, rungs: Sequence[Rung], pulse: float, larger: float) -> bool:
        """Whether the response to a pulse is the one to a larger one."""
        self.pulse = pulse
        for i in range(len(self.inputs)):
            here, there = (self.response(i, rungs, factor=factor) for factor in (1.0, larger / pulse))
            count = min(len(here), len(there))
            if np.abs(here[:count] - there[:count]).max(initial=0.0) > COARSE * np.abs(there[:count]).max(initial=0.0):
                return False
        return True

    def _nonlinearity(self, rungs: Sequence[Rung], pulse: float, *, rounded: bool = False) -> Floats:
        """The difference of responses to two sizes, relative to the largest so far, up to each rung.

        At least that by which outputs are `rounded`, which may be alike at both.
        """
        self.pulse, courses = pulse, []
        for i in range(len(self.inputs)):
            once, other = self.two_sizes(i, rungs, self.response)
            largest = np.abs(once).max(axis=1, initial=0.0)
            apart = np.maximum(np.abs(once - other), self._rounded if rounded else 0.0).max(axis=1, initial=0.0)
            courses.append((np.maximum.accumulate(apart), np.maximum.accumulate(largest)))
        count = min(map(len, (apart for apart, _ in courses)), default=len(rungs))
        found: Floats = np.zeros(count)
        for apart, largest in courses:
            found = np.maximum(found, apart[:count] / np.where(largest[:count] > 0.0, largest[:count], np.inf))
        return found

    def two_sizes(self, i: int, rungs: Sequence[Rung], response: Callable[..., Floats]) -> tuple[Floats, Floats]:
        """Responses to two sizes of pulses, the second one begun `later`."""
        once, other = response(i, rungs), response(i, rungs, factor=OTHER_SIZE, start=self.later)
        count = min(len(once), len(other))
        return once[:count], other[:count]

    def errors_over(self, ladder: Sequence[Rung]) -> "Errors":
        """The errors of responses over a ladder gone through twice: by how much those to two sizes differ."""
        twice = [*ladder, *ladder]
        values = np.zeros((len(self.inputs), len(twice), len(self.outputs)))
        for i in range(len(self.inputs)):
            once, other = self.two_sizes(i, twice, self.followed_response)
            values[i] = np.inf  # where one is too large to be followed
            values[i, : len(once)] = np.abs(once - other)
        return Errors(times=np.cumsum([rung.duration for rung in twice]), values=np.maximum(values, self._rounded))

    @property
    def _rounded(self) -> Floats:
        """The error of a response by rounding of each output."""
        return np.asarray(ROUNDING * np.abs(self.at_rest) / self.weight / self.pulse)

    def longest_step(self, own: float, most: float) -> float:
        """The longest step [s] that is like two of half its length: the `own` one times a power of two."""
        h = own
        while 2.0 * h <= most and all(self._is_alike(i, h) for i in range(len(self.inputs))):
            h *= 2.0
        return h

    def _is_alike(self, i: int, h: float) -> bool:
        once, twice = (self.response(i, [Rung(1, d)] * n, lasting=True) for d, n in ((2.0 * h, 4), (h, 8)))
        largest = np.abs(twice).max(initial=0.0)
        if len(once) < 4 or len(twice) < 8 or not largest <= MAX_GROWTH:  # it would double once more
            return False
        return bool(np.abs(once - twice[1::2]).max(initial=0.0) <= ALIKE * largest)


def _linear(nonlinearity: Floats, allowed: float) -> tuple[int, float]:
    """The number of rungs up to the last that is linear, and how well it is, the larger the better."""
    linear = np.flatnonzero(nonlinearity <= allowed)
    return (int(linear[-1]) + 1, -float(nonlinearity[linear[-1]])) if len(linear) else (0, 0.0)
