"""Values of expressions over a whole run, with integrals that are exact for signals that are held.

A run is gone through span by span, so that it need not fit into memory; each span begins with the last row of the
one before.
"""

import difflib
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from orchestration.errors import UsageError
from orchestration.expressions.syntax import (
    Call,
    Name,
    Node,
    Number,
    Operation,
    Sampled,
    children,
    is_over_run,
    names,
    text,
)
from orchestration.simulator import Floats

TIME, STOP_TIME = "time", "stop_time"
Marks: TypeAlias = npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """A span of a run: `time` [s], shape (n,), increasing, and a signal of shape (n,) by name."""

    time: Floats
    signals: Mapping[str, Floats]
    ends: Mapping[str, Floats] = field(default_factory=dict)
    """of signals that are held: what each has become just before the next row, shape (n - 1,), along a line; all
    others are in continuous time, known at the rows and taken as linear between them"""
    numbers: Mapping[str, float] = field(default_factory=dict)
    """what has one value in the run, such as parameters, by name"""
    arrivals: Mapping[str, Marks] = field(default_factory=dict)
    """by connection, the rows at which a message arrived, shape (n,)"""
    stop_time: float
    """[s], at which the run ended"""
    goes_on: bool = False
    """whether the first row is the last one of the span before"""

    @cached_property
    def vectors(self) -> dict[str, tuple[str, ...]]:
        """Names that stand for several signals: `plant.position` for its .x, .y, .z (and .w)."""
        return vectors(self.signals)


Spans: TypeAlias = Callable[[], Iterator[Recorded]]
"""The spans of a run, in order; to be gone through as often as need be"""


def vectors(signals: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Names that stand for several of `signals`, by what they stand for."""
    found: dict[str, list[str]] = {}
    for axis in "xyzw":
        for name in signals:
            if name.endswith(f".{axis}"):
                found.setdefault(name[:-2], []).append(name)
    return {name: tuple(parts) for name, parts in found.items() if len(parts) > 1 and name not in signals}


def evaluate(nodes: Mapping[str, Node], spans: Spans) -> dict[str, float | None]:
    """The numbers that expressions come to, by name; one may name another that stands before it.

    None for what has no value, such as a settling time that is never reached. Raises `UsageError`, naming the
    expression, if it names what is not there or has a value for each row instead of one for the run.
    """
    whole: dict[str, Node] = {}
    for name, node in nodes.items():
        whole[name] = _inlined(node, whole)
    reductions = {call: _depth(call) for node in whole.values() for call in _reductions(node)}
    known: dict[Node, float | None] = {}
    context: Recorded | None = None
    with np.errstate(all="ignore"):
        for level in range(1, max(reductions.values(), default=0) + 1):
            folds = {call: _FOLDS[call.function](call) for call, depth in reductions.items() if depth == level}
            for span in spans():
                context, look = span, _Look(span, known)
                for call, fold in folds.items():
                    with _naming(nodes, whole, call):
                        look.into(fold)
            known |= {call: _finite(fold.value()) for call, fold in folds.items()}
        context = context or next(spans())
        found = {}
        for name, node in whole.items():
            with _naming(nodes, whole, node):
                found[name] = _finite(_Look(context, known).number(node))
    return found


@contextmanager
def _naming(nodes: Mapping[str, Node], whole: Mapping[str, Node], part: Node) -> Iterator[None]:
    """An error says in which of the expressions it is."""
    try:
        yield
    except UsageError as error:
        name = next(name for name, node in whole.items() if part in _all(node))
        raise UsageError(f"{name} = {text(nodes[name])}: {error}") from error


def _all(node: Node) -> Iterator[Node]:
    yield node
    for child in children(node):
        yield from _all(child)


def _inlined(node: Node, known: Mapping[str, Node]) -> Node:
    """The expression with those that it names in place of their names."""
    match node:
        case Name(name):
            return known.get(name, node)
        case Operation(sign, operands):
            return Operation(sign, tuple(_inlined(operand, known) for operand in operands))
        case Call("growth_share", (argument, floor)):
            inner = _inlined(argument, known)
            return Call("growth_share", (inner, Operation("*", (_inlined(floor, known), Call("max", (inner,))))))
        case Call(function, arguments):
            return Call(function, tuple(_inlined(argument, known) for argument in arguments))
        case Sampled(connection, argument):
            return Sampled(connection, _inlined(argument, known))
    return node


def _reductions(node: Node) -> Iterator[Call]:
    return (part for part in _all(node) if isinstance(part, Call) and is_over_run(part))


def _depth(node: Node) -> int:
    """How many reductions are inside one another."""
    return max(map(_depth, children(node)), default=0) + (isinstance(node, Call) and is_over_run(node))


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def series(node: Node, recorded: Recorded) -> Floats:
    """The values of an expression at the rows of a span, shape (n,); raises `UsageError` for a vector."""
    with np.errstate(all="ignore"):
        data = _Look(recorded, {}).at_rows(node)
    result: Floats = np.broadcast_to(np.asarray(np.nan if data is None else data, dtype=float), recorded.time.shape)
    return result


def expect_names(node: Node, valid: set[str], place: str) -> None:
    """Raise `UsageError` for the first name of an expression that is not valid, with those nearest to it."""
    for name in names(node):
        if name not in valid:
            near = difflib.get_close_matches(name, sorted(valid), n=3, cutoff=0.5)
            hint = f"; did you mean {' or '.join(near)}?" if near else ""
            raise UsageError(f"{place}: there is no {name}{hint}")


@dataclass(frozen=True)
class _Course:
    """The course of an expression over the rows of a span."""

    time: Floats
    values: Floats
    """at the rows, shape (n,)"""
    ends: Floats
    """just before the row after each, shape (n - 1,)"""
    middles: Floats | None
    """half-way, for what is made of held signals alone; None: linear between rows"""
    sampled: bool
    """whether the values stand for themselves, with nothing between them"""
    first: int
    """the first row that the span before did not have"""

    def integral(self) -> float:
        """By Simpson's rule over held signals, which is exact up to third powers of them; else by the trapezoid."""
        starts, ends = self.values[:-1], self.ends
        mean = 0.5 * (starts + ends) if self.middles is None else (starts + 4.0 * self.middles + ends) / 6.0
        return float((mean * np.diff(self.time)).sum())

    def map(self, function: Callable[[Floats], Floats]) -> "_Course":
        """The course of a function of the values."""
        middles = None if self.middles is None else function(self.middles)
        return replace(self, values=function(self.values), ends=function(self.ends), middles=middles)


class _Fold(ABC):
    """A number of a whole run, made span by span."""

    def __init__(self, call: Call) -> None:
        self.call = call

    @abstractmethod
    def add(self, x: _Course, *numbers: float | None) -> None:
        """The next span, and the function's further arguments."""

    @abstractmethod
    def value(self) -> float | None:
        """The number; None if there is none."""


class _Extreme(_Fold):
    """max and min: the largest or smallest value, also just before a held signal changes."""

    def __init__(self, call: Call) -> None:
        super().__init__(call)
        self._sign = 1.0 if call.function == "max" else -1.0
        self._best = -math.inf

    def add(self, x: _Course, *numbers: float | None) -> None:
        self._best = max(
            self._best, (self._sign * x.values).max(initial=-math.inf), (self._sign * x.ends).max(initial=-math.inf)
        )

    def value(self) -> float | None:
        return self._sign * self._best


class _Integral(_Fold):
    """integral, and mean, rms and share by it; of a sampled signal the mean of its values."""

    def __init__(self, call: Call) -> None:
        super().__init__(call)
        self._sum, self._span, self._first, self._count = 0.0, 0.0, math.nan, 0
        self._sampled = False

    def add(self, x: _Course, *numbers: float | None) -> None:
        if self.call.function == "rms":
            x = x.map(np.square)
        elif self.call.function == "share":  # a condition holds from its row to the next
            true = (x.values != 0.0).astype(float)
            x = replace(x, values=true, ends=true[:-1], middles=true[:-1])
        if not self._count and len(x.values):
            self._first = float(x.values[0])
        self._sampled, new = x.sampled, x.values[x.first :]
        self._count += len(new)
        self._sum += float(new.sum()) if x.sampled else x.integral()
        self._span += float(x.time[-1] - x.time[0]) if len(x.time) else 0.0

    def value(self) -> float | None:
        if not self._count:
            return None
        if self.call.function == "integral":
            return self._sum
        mean = self._sum / self._count if self._sampled else self._sum / self._span if self._span else self._first
        return math.sqrt(mean) if self.call.function == "rms" else mean


class _Edge(_Fold):
    """first and last."""

    def __init__(self, call: Call) -> None:
        super().__init__(call)
        self._values: list[float] = []

    def add(self, x: _Course, *numbers: float | None) -> None:
        new = x.values[x.first :]
        if len(new):
            self._values = [*self._values[:1], float(new[0]), float(new[-1])]

    def value(self) -> float | None:
        return None if not self._values else self._values[0 if self.call.function == "first" else -1]


class _PeakTime(_Fold):
    """peak_time: when the largest value is there first."""

    def __init__(self, call: Call) -> None:
        super().__init__(call)
        self._best, self._time = -math.inf, None

    def add(self, x: _Course, *numbers: float | None) -> None:
        if len(x.values) and x.values.max() > self._best:
            place = int(x.values.argmax())
            self._best, self._time = float(x.values[place]), float(x.time[place])

    def value(self) -> float | None:
        return self._time

    _time: float | None


class _SettlingTime(_Fold):
    """settling_time: from when on |x| stays within the band."""

    def __init__(self, call: Call) -> None:
        super().__init__(call)
        self._inside_from: float | None = None

    def add(self, x: _Course, *numbers: float | None) -> None:
        time, values = x.time[x.first :], x.values[x.first :]
        outside = np.flatnonzero(~(np.abs(values) <= (math.nan if numbers[0] is None else numbers[0])))
        place = int(outside[-1]) + 1 if len(outside) else 0
        if len(outside):
            self._inside_from = None
        if self._inside_from is None and place < len(time):
            self._inside_from = float(time[place])

    def value(self) -> float | None:
        return self._inside_from


class _TotalVariation(_Fold):
    """total_variation: how far x moves in all, along its course and where it jumps."""

    def __init__(self, call: Call) -> None:
        super().__init__(call)
        self._sum = 0.0

    def add(self, x: _Course, *numbers: float | None) -> None:
        self._sum += float(np.abs(x.ends - x.values[:-1]).sum() + np.abs(x.values[1:] - x.ends).sum())

    def value(self) -> float | None:
        return self._sum


class _GrowthShare(_Fold):
    """growth_share: of the steps from one value to the next, the share that grows and ends above the floor."""

    def __init__(self, call: Call) -> None:
        super().__init__(call)
        self._last: float | None = None
        self._grown = self._steps = 0

    def add(self, x: _Course, *numbers: float | None) -> None:
        values = x.values[x.first :]
        if self._last is not None:
            values = np.concatenate([[self._last], values])
        if len(values) and numbers[0] is not None:
            self._last = float(values[-1])
            self._grown += int(np.count_nonzero((np.diff(values) > 0.0) & (values[1:] > numbers[0])))
            self._steps += len(values) - 1

    def value(self) -> float | None:
        return self._grown / self._steps if self._steps else None


_FOLDS: dict[str, type[_Fold]] = {
    "min": _Extreme, "max": _Extreme, "mean": _Integral, "rms": _Integral, "share": _Integral, "integral": _Integral,
    "first": _Edge, "last": _Edge, "peak_time": _PeakTime, "settling_time": _SettlingTime,
    "total_variation": _TotalVariation, "growth_share": _GrowthShare,
}  # fmt: skip


class _Look:
    """Expressions over one span: at its rows, just before the next ones, and half-way between; each found once."""

    def __init__(self, recorded: Recorded, known: Mapping[Node, float | None]) -> None:
        self._recorded, self._known = recorded, known
        self._found: dict[tuple[Node, str], Any] = {}

    def into(self, fold: _Fold) -> None:
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
            raise UsageError("it is a vector; expected a number, as norm(…)")
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
            case Operation(sign, operands):
                return _applied(_OPERATIONS[sign], [self._at(operand, place) for operand in operands])
            case Sampled(connection, _):
                expected = "inside max, mean, rms, share or growth_share"
                raise UsageError(f"sampled({connection}, …): expected {expected}")
            case Call(function, arguments) if not is_over_run(node):
                return _applied(_FUNCTIONS[function], [self._at(argument, place) for argument in arguments])
        return self._known[node]

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
        raise UsageError(f"there is no {name}; expected a recorded signal, time, stop_time or an objective above it")

    def _course(self, node: Node, function: str) -> _Course:
        recorded, first = self._recorded, int(self._recorded.goes_on)
        if isinstance(node, Sampled):
            if node.connection not in recorded.arrivals:
                known = ", ".join(recorded.arrivals)
                raise UsageError(f"sampled({node.connection}, …): expected the name of a connection: {known}")
            marks = recorded.arrivals[node.connection].copy()
            marks[:first] = False
            values = np.broadcast_to(self.at_rows(node.argument), recorded.time.shape)[marks]
            return _Course(recorded.time[marks], values, values[1:], None, True, 0)
        values = self.at_rows(node)
        if values is None:
            values = np.full(recorded.time.shape, math.nan)
        if not isinstance(values, np.ndarray) or not values.ndim:
            raise UsageError(f"{function} of a number; expected a signal")
        held = all(self._is_held(name) for name in names(node))
        middles = self._at(node, "middles") if held else None
        return _Course(recorded.time, values, self._at(node, "ends"), middles, False, first)

    def _is_held(self, name: str) -> bool:
        recorded = self._recorded
        parts = recorded.vectors.get(name, (name,))
        return name in recorded.numbers or name == STOP_TIME or all(part in recorded.ends for part in parts)


def _between(values: Floats, ends: Floats | None, place: str) -> Floats:
    if place == "rows":
        return values
    before_next = values[1:] if ends is None else ends
    return before_next if place == "ends" else 0.5 * (values[:-1] + before_next)


def _applied(function: Callable[..., Any], values: list[Any]) -> Any:
    return None if any(value is None for value in values) else function(*values)


def _norm(*parts: Any) -> Any:
    squares = [np.square(part).sum(axis=0) if np.ndim(part) == 2 else np.square(part) for part in parts]
    return np.sqrt(sum(squares))


def _logic(function: Callable[..., Any]) -> Callable[..., Any]:
    def wrapped(*values: Any) -> Any:
        found = np.asarray(function(*(np.asarray(value) != 0.0 for value in values)))
        return found.astype(float) if found.ndim else float(found)

    return wrapped


def _comparison(function: Callable[..., Any]) -> Callable[..., Any]:
    def wrapped(a: Any, b: Any) -> Any:
        found = np.asarray(function(a, b))
        return found.astype(float) if found.ndim else float(found)

    return wrapped


_OPERATIONS: dict[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "**": np.power, "neg": np.negative,
    "<": _comparison(np.less), "<=": _comparison(np.less_equal), ">": _comparison(np.greater),
    ">=": _comparison(np.greater_equal), "==": _comparison(np.equal), "!=": _comparison(np.not_equal),
    "not": _logic(np.logical_not),
    "and": _logic(lambda *sides: np.logical_and.reduce(np.broadcast_arrays(*sides))),
    "or": _logic(lambda *sides: np.logical_or.reduce(np.broadcast_arrays(*sides))),
}  # fmt: skip

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "asin": np.arcsin, "acos": np.arccos, "atan2": np.arctan2, "tanh": np.tanh, "hypot": _norm, "norm": _norm,
    "min": lambda *v: np.minimum.reduce(np.broadcast_arrays(*v)),
    "max": lambda *v: np.maximum.reduce(np.broadcast_arrays(*v)),
}  # fmt: skip
