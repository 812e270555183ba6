"""Values around an algebraic loop, in which each value depends on all others at once: by exchanges, then by secants.

So are instants closed: an output that follows its inputs at once is read again after these are set, and passed on. It
is that of an FMU for model exchange or in event mode; plain co-simulation FMUs answer in their next step.

Its numbers are the same on all machines: sums are those of Python, in one order.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.simulation.engines import initial
from orchestration.simulation.engines.initial import Dependencies
from orchestration.simulation.engines.wiring_by_index import Wires
from orchestration.systems.schedule.plan import Plan
from orchestration.systems.system.connection import Connection, variable_of
from orchestration.systems.system.model import System

if TYPE_CHECKING:
    from orchestration.simulation.engines.running_system import RunningSystem

EXCHANGES = 10
"""The most exchanges at an instant before secants"""
SECANTS = 50
"""The most exchanges with values of the secant method"""
_LARGEST = 1e15
"""Magnitude beyond which exchanges do not converge; an FMU may refuse larger values"""
_DEPENDENT = 1e-10
"""Share of a difference that is left where it follows from others, but for rounding"""
Values = list[float]


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
            if not initial.exchange(self._group, self._pass_on, iterations=self._iterations).any():
                return
        except _Leaves:
            pass
        self._put(start)
        self._exchange()  # from here on only values that it has passed on: as many unknowns as its narrowest place has
        before, after = secants(self._exchanged, self._values())
        if before is not after:
            x = self._running.system.connections
            ends = [end for i in self._group for end in x[i].end]
            found = "; ".join(f"{end} = {a:g} becomes {b:g}" for end, a, b in zip(ends, before, after))
            raise SimulatorError(
                f"{when}: no values found around the loop {in_words([x[i] for i in self._group])}: after "
                f"{self._iterations} exchanges and {SECANTS} with secants, {found}"
            )

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
        if all(abs(b - a) <= initial.CONVERGED * max(1.0, abs(b)) for a, b in zip(values, after)):
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
    return sum(a * b for a, b in zip(one, other))


def in_words(loop: Sequence[Connection]) -> str:
    """The connections of a loop."""
    return "; ".join(f"{', '.join(x.start)} -> {', '.join(x.end)}" for x in loop)
