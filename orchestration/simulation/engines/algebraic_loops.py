"""Values around an algebraic loop, in which each value depends on all others at once: by exchanges, then by secants and
by Newton's method, with the derivatives of FMUs that offer them.

So are instants closed: an output that follows its inputs at once is read again after these are set, and passed on. It
is that of an FMU for model exchange or in event mode; plain co-simulation FMUs answer in their next step.

Its numbers are the same on all machines: sums are added up in one order.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.basics.simulator import Booleans, Differentiable, Floats
from orchestration.simulation.engines import initial
from orchestration.simulation.engines.initial import Dependencies
from orchestration.simulation.engines.wiring_by_index import Wires
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.connection import Connection, component_of, variable_of
from orchestration.systems.system.model import System

if TYPE_CHECKING:
    from orchestration.simulation.engines.running_system import RunningSystem

EXCHANGES = 10
"""The most exchanges at an instant before secants"""
SECANTS = 50
"""The most exchanges with values of the secant method"""
NEWTON = 50
"""The most steps of Newton's method"""
BEGINNINGS = 10
"""Values from which Newton's method begins, until it finds some"""
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_SHORTEST = 2.0**-10
"""Share of a step of Newton's method, below which no shorter one is tried"""
_SMALL = 1e-7
"""Difference, relative where the value is larger than 1, that stands for a derivative"""
_LARGEST = 1e15
"""Magnitude beyond which exchanges do not converge; an FMU may refuse larger values"""
_DEPENDENT = 1e-10
"""Share of a difference that is left where it follows from others, but for rounding"""
Values = list[float]
Matrix = list[list[float]]


class _Leaves(Exception):
    """The values of exchanges leave all bounds."""


@dataclass(frozen=True, kw_only=True)
class Closing:
    """What is done at the end of an instant, after all inputs are set."""

    groups: tuple[tuple[int, ...], ...]
    """Wires whose values follow inputs at once, those that others need first; several where they form a loop"""
    read_again: tuple[int, ...]
    """components with outputs that follow inputs at once"""

    def operations(self, senders: Sequence[int]) -> list[int] | None:
        """Its reads (i: of component i) and wires (~i: wire i) in turn; None with loops. `senders`: of each wire."""
        if any(len(group) > 1 for group in self.groups):
            return None
        return [*(each for (i,) in self.groups for each in (senders[i], ~i)), *self.read_again]


def closing_of(wires: Wires, at_once: Dependencies) -> Closing:
    """The closing of the instants of a run; `at_once` are the inputs that an output follows before the next step."""
    connections = wires.system.connections

    def follows(component: str, output: str) -> bool:
        return at_once(component, output) is None or bool(at_once(component, output))

    passed = [
        i for i in wires.plan.wires if any(follows(connections[i].sender, variable_of(s)) for s in connections[i].start)
    ]
    groups = initial.groups([connections[i] for i in passed], at_once)
    return Closing(
        groups=tuple(tuple(passed[k] for k in group) for group in groups),
        read_again=tuple(
            i for i in wires.continuous if any(follows(wires.names[i], o) for o in wires.board.outputs[wires.names[i]])
        ),
    )


def describe_loops(system: System, depends: Dependencies, at_once: Dependencies) -> list[str]:
    """A line for each loop of wires whose values depend on each other at once, with how it is closed in steps.

    `depends` are the inputs that an output depends on at all, `at_once` those that it follows before the next step.
    """
    wires = [system.connections[i] for i in Plan(system).wires]
    loops = [[wires[i] for i in group] for group in initial.groups(wires, depends) if len(group) > 1]
    lag = [
        any(at_once(x.sender, variable_of(start)) == frozenset() for x in loop for start in x.start) for loop in loops
    ]
    how = {True: "by the lag of a step: one of its FMUs answers in its next step", False: "at each instant"}
    return [f"{in_words(loop)}: closed {how[lags]}" for loop, lags in zip(loops, lag)]


class AlgebraicLoop:
    """Connections of a run that form a loop, or one that does not."""

    def __init__(self, running: "RunningSystem", group: Sequence[int], iterations: int = initial.ITERATIONS) -> None:
        self._running, self._group, self._iterations = running, group, iterations
        self._channels = [running.channels[i] for i in group]

    def close(self, when: str) -> None:
        """Carry out its connections until their values are consistent; raises `SimulatorError` if none are found."""
        start = self._values()
        try:
            runs = self._running.board.row.shape[1:]
            if not initial.exchange(self._group, self._pass_on, runs, iterations=self._iterations).any():
                return
        except _Leaves:
            pass
        methods = (self._by_secants, self._by_newton)
        for method in methods if self._slopes(start) is None else reversed(methods):
            self._put(start)
            before, after = method()
            if before is after:
                return
        x = self._running.system.connections
        ends = [end for i in self._group for end in x[i].end]
        found = "; ".join(f"{end} = {a:g} becomes {b:g}" for end, a, b in zip(ends, before, after))
        tried = f"{self._iterations} exchanges, {SECANTS} with secants and Newton's method from {BEGINNINGS} values"
        loop = in_words([x[i] for i in self._group])
        raise SimulatorError(f"{when}: no values found around the loop {loop}: after {tried}, {found}")

    def _by_secants(self) -> tuple[Values, Values]:
        self._exchange()  # from here on only values that it has passed on: as many unknowns as its narrowest place has
        return secants(self._exchanged, self._values())

    def _by_newton(self) -> tuple[Values, Values]:
        start = self._values()
        size = max([1.0, *(abs(x) for x in self._passed_on(start) if abs(x) <= _LARGEST)])
        first = newton(self._passed_on, self._slopes, start)
        found = first
        for k in range(1, BEGINNINGS):  # spread evenly around the first one
            if found[0] is found[1]:
                return found
            spread = [2.0 * (k * (i + 1) * _GOLDEN % 1.0) - 1.0 for i in range(len(start))]
            beginning = [x + size * share for x, share in zip(start, spread)]
            found = newton(self._passed_on, self._slopes, beginning)
        return found if found[0] is found[1] else first

    def _pass_on(self, index: int, open_: Booleans) -> tuple[Floats, Floats]:
        running, channel = self._running, self._running.channels[index]
        running.readers[running.system.connections[index].sender]()
        before = channel.received.copy()
        channel.pass_on()
        if len(self._group) > 1 and not (abs(channel.received) <= _LARGEST).all():
            raise _Leaves
        return before, channel.received

    def _exchange(self) -> None:
        for index in self._group:
            self._running.readers[self._running.system.connections[index].sender]()
            self._running.channels[index].pass_on()

    def _exchanged(self, values: Values) -> Values:
        self._put(values)
        self._exchange()
        return self._values()

    def _passed_on(self, values: Values) -> Values:
        """What all connections deliver after these values, each read before any is passed on."""
        self._put(values)
        for sender in dict.fromkeys(self._running.system.connections[i].sender for i in self._group):
            self._running.readers[sender]()
        for channel in self._channels:
            channel.pass_on()
        return self._values()

    def _slopes(self, values: Values) -> Matrix | None:
        """The derivatives of what is passed on after these values; None if an FMU does not offer its own."""
        self._put(values)
        x = [self._running.system.connections[i] for i in self._group]
        ends = [end for each in x for end in each.end]
        starts = [(start, each.scale) for each in x for start in each.start]
        known: dict[tuple[str, str], float] = {}
        for name in dict.fromkeys(each.sender for each in x):
            outputs = list(dict.fromkeys(start for start, _ in starts if component_of(start) == name))
            inputs = [end for end in ends if component_of(end) == name]
            simulator, found = self._running.simulators[name], None
            if isinstance(simulator, Differentiable):
                found = simulator.slopes([*map(variable_of, outputs)], [*map(variable_of, inputs)])
            if found is None:
                return None
            known |= dict(zip(itertools.product(outputs, inputs), found.ravel().tolist()))
        return [[scale * known.get((start, end), 0.0) for end in ends] for start, scale in starts]

    def _values(self) -> Values:
        return [value for channel in self._channels for value in channel.received.tolist()]

    def _put(self, values: Values) -> None:
        place = 0
        for channel in self._channels:
            size = len(channel.received)
            channel.received[:] = values[place : place + size]
            channel.write()
            place += size


def secants(evaluate: Callable[[Values], Values], values: Values) -> tuple[Values, Values]:
    """Values that `evaluate` keeps, twice the same list; other lists, the last ones, if none are found.

    Each guess is where the line, plane ... through all earlier exchanges has the values that it is given: of n linear
    equations in n unknowns the solution after n + 1 exchanges.
    """
    steps: list[tuple[Values, Values]] = []  # differences of values and of residuals
    last: tuple[Values, Values] | None = None
    after = values
    for _ in range(SECANTS):
        after = evaluate(values)
        if _agree(values, after):
            return after, after
        residual = _difference(after, values)
        if last is not None:
            steps.append((_difference(values, last[0]), _difference(residual, last[1])))
        last = values, residual
        guess = list(after)
        for moved, changed in _orthogonal(steps):
            share = _product(residual, changed) / _product(changed, changed)
            guess = [g - share * (m + c) for g, m, c in zip(guess, moved, changed)]
        if not all(map(math.isfinite, guess)):
            break
        values = guess
    return values, after


def newton(
    evaluate: Callable[[Values], Values], slopes: Callable[[Values], Matrix | None], values: Values
) -> tuple[Values, Values]:
    """As `secants`, by Newton's method; a step that does not lead closer is shortened.

    `slopes` has the derivatives of `evaluate`; None: they are taken from small differences.
    """
    after = evaluate(values)
    for _ in range(NEWTON):
        if _agree(values, after):
            return after, after
        residual = _difference(after, values)
        matrix = slopes(values)
        if matrix is None:
            columns = [_slope(evaluate, values, after, k) for k in range(len(values))]
            matrix = [list(row) for row in zip(*columns)]
        step = solved([[float(i == k) - x for k, x in enumerate(row)] for i, row in enumerate(matrix)], residual)
        share, size = 1.0, _product(residual, residual)
        while step is not None and share >= _SHORTEST:
            guess = [a + share * d for a, d in zip(values, step)]
            reached = evaluate(guess)
            rest = _difference(reached, guess)
            if _product(rest, rest) < size:  # not one that is not a number
                break
            share /= 2.0
        else:
            return values, after
        values, after = guess, reached
    return values, after


def _slope(evaluate: Callable[[Values], Values], values: Values, after: Values, k: int) -> Values:
    """The derivatives by one of the values."""
    small = _SMALL * max(1.0, abs(values[k]))
    moved = evaluate([*values[:k], values[k] + small, *values[k + 1 :]])
    return [(b - a) / small for a, b in zip(after, moved)]


def solved(matrix: Matrix, right: Values) -> Values | None:
    """x of matrix x = right; None if it has none, or many, but for rounding."""
    rows = [[*row, value] for row, value in zip(matrix, right)]
    sizes = [max(map(abs, row)) for row in matrix]
    n = len(rows)
    for k in range(n):
        best = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[best], sizes[k], sizes[best] = rows[best], rows[k], sizes[best], sizes[k]
        if not abs(rows[k][k]) > _DEPENDENT * sizes[k]:
            return None
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k])]
    found = [0.0] * n
    for k in reversed(range(n)):
        found[k] = (rows[k][n] - _product(rows[k][k + 1 : n], found[k + 1 :])) / rows[k][k]
    return found if all(map(math.isfinite, found)) else None


def _agree(values: Values, after: Values) -> bool:
    return all(abs(b - a) <= initial.CONVERGED * max(1.0, abs(b)) < math.inf for a, b in zip(values, after))


def _orthogonal(steps: Sequence[tuple[Values, Values]]) -> list[tuple[Values, Values]]:
    """Differences without their parts along later ones, the last first; those of which nothing is left are left out."""
    found: list[tuple[Values, Values]] = []
    for moved, changed in reversed(steps):
        size = _product(changed, changed)
        for other, along in found:
            share = _product(changed, along) / _product(along, along)
            moved = [m - share * o for m, o in zip(moved, other)]
            changed = [c - share * a for c, a in zip(changed, along)]
        if _product(changed, changed) > _DEPENDENT**2 * size:
            found.append((moved, changed))
    return found


def _difference(one: Values, other: Values) -> Values:
    return [a - b for a, b in zip(one, other)]


def _product(one: Values, other: Values) -> float:
    total = 0.0  # the built-in sum of floats is compensated from Python 3.12 on
    for a, b in zip(one, other):
        total += a * b
    return total


def in_words(loop: Sequence[Connection]) -> str:
    """The connections of a loop."""
    return "; ".join(f"{', '.join(x.start)} -> {', '.join(x.end)}" for x in loop)
