"""Evaluates expressions over a whole run, span by span: at rows, just before the next ones, and half-way between."""

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from orchestration.foundation.basics.errors import UsageError, did_you_mean
from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.systems.expressions.at_instant import IS_VECTOR
from orchestration.systems.expressions.operators import applied
from orchestration.systems.expressions.reductions import REDUCTIONS, Course, Fold
from orchestration.systems.expressions.syntax import (
    Call,
    Name,
    Node,
    Number,
    Operation,
    Sampled,
    children,
    is_over_run,
    names,
    names_job_measure,
    parse,
    text,
)

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
    known: Mapping[str, Booleans] = field(default_factory=dict)
    """Rows at which signals of a component between its points are known, shape (n,); on a line at the others"""
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
    return UsageError(
        f"sampled({connection}, …): expected inside a reduction, as max, mean, rms, share or growth_share"
    )


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

    def add_to(self, fold: Fold, call: Call) -> None:
        """Add this span to a number of the whole run."""
        argument, *rest = call.arguments
        fold.add(self._course(argument, call.function), *(self.number(other) for other in rest))

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

        if not any(map(self._is_partly_held, names(node))) and (at := self._known_rows(node)) is not None:
            at[0] = True  # the last row of the span before
            there = values[at]
            return Course(recorded.time[at], there, lambda: there[1:], lambda: None, sampled=False, first=first)
        return Course(recorded.time, values, ends, middles, sampled=False, first=first)

    def _known_rows(self, node: Node) -> Booleans | None:
        """The rows at which signals of an expression are known, and not all on lines; None: all rows."""
        recorded = self._recorded
        parts = (part for name in names(node) for part in recorded.vectors.get(name, (name,)))
        marks = [recorded.known[part] for part in parts if part in recorded.known]
        return np.any(marks, axis=0) if marks else None

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


def evaluate(nodes: Mapping[str, Node], spans: Spans) -> dict[str, float | None]:
    """The values of expressions, by name; an expression may use the name of one before it.

    None for no value, as of a settling time that is never reached. Raises `UsageError`, naming the expression, for an
    unknown name and for an expression with a value for each row instead of one for the run.
    """
    whole: dict[str, Node] = {}
    for name, node in nodes.items():
        whole[name] = inlined(node, whole)
    depths = {call: _depth(call) for node in whole.values() for call in reductions(node)}
    known: dict[Node, float | None] = {}
    context: Recorded | None = None
    with np.errstate(all="ignore"):
        for level in range(1, max(depths.values(), default=0) + 1):
            folds = {
                call: REDUCTIONS[call.function].fold(call.function) for call, depth in depths.items() if depth == level
            }
            for span in spans():
                context, values = span, SpanValues(span, known)
                for call, fold in folds.items():
                    with _naming(nodes, whole, call):
                        values.add_to(fold, call)
            known |= {call: _finite(fold.value()) for call, fold in folds.items()}
        context = context or next(spans())
        found = {}
        for name, node in whole.items():
            with _naming(nodes, whole, node):
                found[name] = _finite(SpanValues(context, known).number(node))
    return found


@contextmanager
def _naming(nodes: Mapping[str, Node], whole: Mapping[str, Node], part: Node) -> Iterator[None]:
    """Begin an error with the expression that contains `part`."""
    try:
        yield
    except UsageError as error:
        name = next(name for name, node in whole.items() if part in _all(node))
        raise UsageError(f"{name} = {text(nodes[name])}: {error}") from error


def _all(node: Node) -> Iterator[Node]:
    yield node
    for child in children(node):
        yield from _all(child)


def inlined(node: Node, known: Mapping[str, Node]) -> Node:
    """The expression with the known ones in place of their names."""
    match node:
        case Name(name):
            return known.get(name, node)
        case Operation(sign, operands):
            return Operation(sign, tuple(inlined(operand, known) for operand in operands))
        case Call("growth_share", (argument, floor)):
            inner = inlined(argument, known)
            return Call("growth_share", (inner, Operation("*", (inlined(floor, known), Call("max", (inner,))))))
        case Call(function, arguments):
            return Call(function, tuple(inlined(argument, known) for argument in arguments))
        case Sampled(connection, argument):
            return Sampled(connection, inlined(argument, known))
    return node


@functools.lru_cache(maxsize=1024)
def reductions(node: Node) -> tuple[Call, ...]:
    """The functions over a run in an expression, including nested ones."""
    return tuple(part for part in _all(node) if isinstance(part, Call) and is_over_run(part))


def _depth(node: Node) -> int:
    """The depth of nested functions over a run."""
    return max(map(_depth, children(node)), default=0) + (isinstance(node, Call) and is_over_run(node))


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def job_terms(expressions: Iterable[str]) -> dict[str, None]:
    """The terms about jobs in expressions: numbers of a run that do not depend on signals."""
    return dict.fromkeys(name for text in expressions for name in names(parse(text)) if names_job_measure(name))


def expect_number(node: Node, courses: set[str], place: str) -> None:
    """Raise `UsageError` for an expression of which a part outside the functions over a run is one of `courses`."""
    if isinstance(node, Name) and node.text in courses:
        raise UsageError(
            f"{place}: {node.text} has a value at each instant; expected one number of the run, as max(…) or last(…)"
        )
    if not (isinstance(node, Sampled) or (isinstance(node, Call) and is_over_run(node))):
        for child in children(node):
            expect_number(child, courses, place)


def expect_names(node: Node, valid: set[str], place: str) -> None:
    """Raise `UsageError` for the first name of an expression that is not valid, with those nearest to it."""
    for name in names(node):
        if name not in valid:
            raise UsageError(f"{place}: there is no {name}{did_you_mean(name, valid, most=3)}")
