"""The condition of divergence over the current row: a function of Python, and a program for the compiled loop.

The program calls Python where rounding matters.
"""

import functools
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from orchestration.foundation.basics.c_structures import constants
from orchestration.foundation.basics.errors import prefixed, told_apart
from orchestration.simulation.engines.sources import SourceValues
from orchestration.simulation.engines.wiring_by_index import Board
from orchestration.systems.expressions.at_instant import Current, compiled, scalars
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.syntax import Call, Name, Node, Number, Operation, names, parse, text

Watch = Callable[[float], str | None]
"""Returns how the values of the row at t [s] have diverged; None if they have not"""


Step: TypeAlias = tuple[int, int, float]
"""The operation, the number of operands (of a signal, its place), and the value of a number"""

HEADER = Path(__file__).with_name("condition.h")
_OF_C = constants(HEADER.read_text(encoding="utf-8"))
_BOUNDED = {word: made.bounded for word, made in OPERATORS.items() if made.bounded is not None}
_CODES = {word: _OF_C[word.upper()] for word in ("number", "time", "signal", "source")}
_CODES |= {word: code for code, word in enumerate(_BOUNDED, start=_OF_C["OPERATOR"])}


@dataclass(frozen=True, kw_only=True)
class Condition:
    """The condition of divergence of a run, over the columns of the board, `time`, and what is given here by name."""

    text: str | None = None
    """Expression; None: no values diverge"""
    sources: Mapping[str, SourceValues] = field(default_factory=dict)
    signals_of: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Signals of each source"""
    numbers: Mapping[str, float] = field(default_factory=dict)

    def watch(self, board: Board) -> Watch:
        """The monitor of a board; raises `UsageError` if the condition has an unknown name."""
        if self.text is None:
            return lambda t: None
        node = parse(self.text)
        named = set(names(node))
        columns = [c for c in board.columns if c != "time" and _is_named(c, named)]
        used = self._used(named)
        constants = [name for name in self.numbers if name in named]
        order = ("", "time", *columns, *(signal for name in used for signal in self.signals_of[name]), *constants)
        with prefixed("criterion.diverged: "):
            clauses = _clauses(node, order)
        get = operator.itemgetter(
            0, 0, *(board.place[column] for column in columns)
        )  # two more than needed, so that it is a tuple
        row = board.row.data
        feeds, fixed = [self.sources[name].at for name in used], [float(self.numbers[name]) for name in constants]
        conditions = [clause.holds for clause in clauses]

        def check(t: float) -> str | None:
            values: list[float] = [*get(row)]
            values[1] = t
            for at in feeds:
                values += at(t)
            values += fixed
            for holds in conditions:
                if holds(values):
                    return clauses[conditions.index(holds)].describe(values, t)
            return None

        return check

    def program(self, board: Board) -> tuple[Sequence[Step] | None, Sequence[SourceValues]]:
        """The steps of the program, None if there is none, and the sources in it, whose signals it numbers in order."""
        if self.text is None:
            return [(_CODES["number"], 0, 0.0)], ()
        node = parse(self.text)
        named = set(names(node))
        used = self._used(named)
        signals = [signal for name in used for signal in self.signals_of[name]]
        leaves = {column: ("signal", place, 0.0) for column, place in board.place.items()}
        leaves["time"] = ("time", 0, 0.0)
        leaves |= {signal: ("source", i, 0.0) for i, signal in enumerate(signals)}
        leaves |= {name: ("number", 0, float(value)) for name, value in self.numbers.items()}
        (scalar,) = scalars(node, {name: _axes(name, leaves) for name in named})
        try:
            steps = [(_CODES[word], operands, number) for word, operands, number in _words(scalar, leaves)]
        except _Unknown:
            return None, ()
        return (steps if len(steps) < _OF_C["DEEPEST"] else None), [self.sources[name] for name in used]

    def _used(self, named: set[str]) -> list[str]:
        """The sources with a signal that is named."""
        return [name for name, signals in self.signals_of.items() if any(_is_named(each, named) for each in signals)]


NEVER = Condition()
"""Condition of runs that do not diverge"""


def _is_named(signal: str, named: set[str]) -> bool:
    """Whether a signal is one of the names of an expression, or a component of a vector of them."""
    return signal in named or signal.rpartition(".")[0] in named


def _alternatives(node: Node) -> tuple[Node, ...]:
    return node.operands if isinstance(node, Operation) and node.sign == "or" else (node,)


class _Clause:
    """One of the conditions joined by `or`."""

    def __init__(self, node: Node, places: Mapping[str, int]) -> None:
        self.holds: Current = compiled(node, places)
        self._node = node
        self._left: Current | None = None
        if isinstance(node, Operation) and node.sign in _EXPECTED:
            self._left = compiled(node.operands[0], places)

    def describe(self, values: Sequence[float], t: float) -> str:
        """The value that diverged, and what was expected."""
        node = self._node
        if self._left is None or not isinstance(node, Operation):
            return f"{text(node)} at t = {t:g} s"
        left, right = node.operands
        value = self._left(values)
        shown = told_apart(value, right.value)[0] if isinstance(right, Number) else f"{value:g}"
        return f"{text(left)} = {shown} at t = {t:g} s, expected {_EXPECTED[node.sign]} {text(right)}"


@functools.lru_cache(maxsize=64)
def _clauses(node: Node, order: Sequence[str]) -> Sequence[_Clause]:
    """The clauses of a condition over values in this order; runs of one system have the same."""
    places = {name: i for i, name in enumerate(order)}
    return [_Clause(clause, places) for clause in _alternatives(node)]


_EXPECTED = {">": "at most", ">=": "less than", "<": "at least", "<=": "more than"}


class _Unknown(Exception):
    """A function that has no program: Python evaluates it at every instant."""


def operators() -> str:
    """The text of operators.h, which condition.h includes: the value of each operator."""
    cases = [f"    case {_CODES[word]}: return {code}; /* {word} */" for word, code in _BOUNDED.items()]
    head = "static Known applied(int64_t code, const Known *a, int64_t n) {"
    return "\n".join(
        [head, "    switch (code) {", *cases, "    default: return (Known){0.0, INFINITY};", "    }", "}", ""]
    )


_Words: TypeAlias = list[tuple[str, int, float]]


def _axes(name: str, leaves: Mapping[str, tuple[str, int, float]]) -> Sequence[str]:
    """The signals that a name refers to."""
    return (name,) if name in leaves else [part for axis in "xyzw" if (part := f"{name}.{axis}") in leaves]


def _words(node: Node, leaves: Mapping[str, tuple[str, int, float]]) -> _Words:
    """The program in postfix order."""
    match node:
        case Number(value):
            return [("number", 0, value)]
        case Name(name):
            return [leaves[name]]
        case Operation(word, operands) | Call(word, operands) if word in _BOUNDED:
            return [*(step for operand in operands for step in _words(operand, leaves)), (word, len(operands), 0.0)]
    raise _Unknown
