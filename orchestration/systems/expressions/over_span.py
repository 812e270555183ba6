"""Recorded signals of a span of a run, and expressions over it: at its rows, just before the next, and half-way."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.systems.expressions.at_instant import IS_VECTOR
from orchestration.systems.expressions.operators import applied
from orchestration.systems.expressions.reductions import Course, Fold
from orchestration.systems.expressions.syntax import Call, Name, Node, Number, Operation, Sampled, is_over_run, names

TIME, STOP_TIME = "time", "stop_time"


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """A span of a run: `time` [s], shape (n,), increasing, and a signal of shape (n,) by name."""

    time: Floats
    signals: Mapping[str, Floats]
    ends: Mapping[str, Floats] = field(default_factory=dict)
    """Values of held signals just before the next row, shape (n - 1,), reached along a line; all others are in
    continuous time, known at the rows and linear between them"""
    numbers: Mapping[str, float] = field(default_factory=dict)
    """constants of the run, such as parameters, by name"""
    arrivals: Mapping[str, Booleans] = field(default_factory=dict)
    """Rows at which a message arrived, by connection, shape (n,)"""
    stop_time: float
    """Time at which the run ended [s]"""
    goes_on: bool = False
    """whether the first row is the last one of the span before"""

    @cached_property
    def vectors(self) -> dict[str, tuple[str, ...]]:
        """The names of vectors: `plant.position` for its .x, .y, .z (and .w)."""
        return vectors(self.signals)


Spans: TypeAlias = Callable[[], Iterator[Recorded]]
"""The spans of a run, in order; can be iterated repeatedly"""


def unknown(name: str) -> UsageError:
    """The error for a name that an objective cannot have."""
    return UsageError(f"there is no {name}; expected a recorded signal, time, stop_time or an objective above it")


def alone(connection: str) -> UsageError:
    """The error for samples of a connection that are not reduced to a number."""
    return UsageError(f"sampled({connection}, …): expected inside max, mean, rms, share or growth_share")


def vectors(signals: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """The names of vectors among `signals`, with their components."""
    found: dict[str, list[str]] = {}
    for axis in "xyzw":
        for name in signals:
            if name.endswith(f".{axis}"):
                found.setdefault(name[:-2], []).append(name)
    return {name: tuple(parts) for name, parts in found.items() if len(parts) > 1 and name not in signals}


class SpanValues:
    """The values of expressions over one span, each computed once."""

    def __init__(self, recorded: Recorded, known: Mapping[Node, float | None]) -> None:
        self._recorded, self._known = recorded, known
        self._found: dict[tuple[Node, str], Any] = {}

    def add_to(self, fold: Fold) -> None:
        """Add this span to a number of the whole run."""
        argument, *rest = fold.call.arguments
        fold.add(self._course(argument, fold.call.function), *(self.number(other) for other in rest))

    def number(self, node: Node) -> float | None:
        """The value of an expression that is one number."""
        data = self._at(node, "rows")
        if isinstance(data, np.ndarray) and data.ndim:
            raise UsageError("it has a value at each instant; expected one number of the run, as max(…) or last(…)")
        return None if data is None else float(data)

    def at_rows(self, node: Node) -> Any:
        """The values of an expression at the rows."""
        data = self._at(node, "rows")
        if isinstance(data, np.ndarray) and data.ndim > 1:
            raise UsageError(IS_VECTOR)
        return data

    def _at(self, node: Node, place: str) -> Any:
        key = (node, place)
        if key not in self._found:
            self._found[key] = self._computed(node, place)
        return self._found[key]

    def _computed(self, node: Node, place: str) -> Any:
        match node:
            case Number(value):
                return value
            case Name(name):
                return self._named(name, place)
            case Sampled(connection, _):
                raise alone(connection)
            case Call() if is_over_run(node):
                return self._known[node]
            case Operation(word, operands) | Call(word, operands):
                values = [self._at(operand, place) for operand in operands]
                return None if any(value is None for value in values) else applied(word, *values)

    def _named(self, name: str, place: str) -> Any:
        recorded = self._recorded
        if name in recorded.numbers:
            return recorded.numbers[name]
        if name == STOP_TIME:
            return recorded.stop_time
        if name == TIME:
            return _between(recorded.time, None, place)
        if name in recorded.signals:
            return _between(recorded.signals[name], recorded.ends.get(name), place)
        if name in recorded.vectors:
            return np.array([self._named(part, place) for part in recorded.vectors[name]])
        raise unknown(name)

    def _course(self, node: Node, function: str) -> Course:
        recorded, first = self._recorded, int(self._recorded.goes_on)
        if isinstance(node, Sampled):
            if node.connection not in recorded.arrivals:
                known = ", ".join(recorded.arrivals)
                raise UsageError(f"sampled({node.connection}, …): expected the name of a connection: {known}")
            marks = recorded.arrivals[node.connection].copy()
            marks[:first] = False
            values = np.broadcast_to(self.at_rows(node.argument), recorded.time.shape)[marks]
            return Course(recorded.time[marks], values, lambda: values[1:], lambda: None, sampled=True, first=0)
        values = self.at_rows(node)
        if values is None:
            values = np.full(recorded.time.shape, math.nan)
        if not isinstance(values, np.ndarray) or not values.ndim:
            raise UsageError(f"{function} of a number; expected a signal")

        def ends() -> Floats:
            computed = self._at(node, "ends") if any(map(self._is_partly_held, names(node))) else None
            return values[1:] if computed is None else computed

        def middles() -> Floats | None:
            return self._at(node, "middles") if all(map(self._is_held, names(node))) else None

        return Course(recorded.time, values, ends, middles, sampled=False, first=first)

    def _is_partly_held(self, name: str) -> bool:
        """Whether it is another just before a row than at that row."""
        recorded = self._recorded
        return any(part in recorded.ends for part in recorded.vectors.get(name, (name,)))

    def _is_held(self, name: str) -> bool:
        recorded = self._recorded
        parts = recorded.vectors.get(name, (name,))
        return name in recorded.numbers or name == STOP_TIME or all(part in recorded.ends for part in parts)


def _between(values: Floats, ends: Floats | None, place: str) -> Floats:
    if place == "rows":
        return values
    before_next = values[1:] if ends is None else ends
    return before_next if place == "ends" else 0.5 * (values[:-1] + before_next)
