"""The condition of divergence as a program for the compiled loop, which calls Python where rounding matters."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

from orchestration.simulation.engines.board import Board
from orchestration.simulation.engines.sources import SourceValues
from orchestration.simulation.engines.structures import constants
from orchestration.simulation.engines.watch import is_named
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.scalars import scalars
from orchestration.systems.expressions.syntax import Call, Name, Node, Number, Operation, names, parse

Step: TypeAlias = tuple[int, int, float]
"""The operation, the number of operands (of a signal, its place), and the value of a number"""

HEADER = Path(__file__).with_name("condition.h")
_OF_C = constants(HEADER.read_text(encoding="utf-8"))
_BOUNDED = {word: made.bounded for word, made in OPERATORS.items() if made.bounded is not None}
_CODES = {word: _OF_C[word.upper()] for word in ("number", "time", "signal", "source")}
_CODES |= {word: code for code, word in enumerate(_BOUNDED, start=_OF_C["OPERATOR"])}


class _Unknown(Exception):
    """A function that has no program: Python evaluates it at every instant."""


def operators() -> str:
    """The text of operators.h, which condition.h includes: the value of each operator."""
    cases = [f"    case {_CODES[word]}: return {code}; /* {word} */" for word, code in _BOUNDED.items()]
    head = "static Known applied(int64_t code, const Known *a, int64_t n) {"
    return "\n".join(
        [head, "    switch (code) {", *cases, "    default: return (Known){0.0, INFINITY};", "    }", "}", ""]
    )


def program(
    condition: str | None,
    board: Board,
    sources: Mapping[str, SourceValues],
    signals_of: Mapping[str, Sequence[str]],
    numbers: Mapping[str, float],
) -> tuple[Sequence[Step] | None, Sequence[SourceValues]]:
    """The steps of the program, None if there is none, and the sources in it, whose signals are numbered in order.

    The arguments are those of `watch`.
    """
    if condition is None:
        return [(_CODES["number"], 0, 0.0)], ()
    node = parse(condition)
    named = set(names(node))
    used = [name for name, signals in signals_of.items() if any(is_named(signal, named) for signal in signals)]
    leaves = {column: ("signal", place, 0.0) for column, place in board.place.items()}
    leaves["time"] = ("time", 0, 0.0)
    leaves |= {s: ("source", i, 0.0) for i, s in enumerate(signal for name in used for signal in signals_of[name])}
    leaves |= {name: ("number", 0, float(value)) for name, value in numbers.items()}
    (scalar,) = scalars(node, {name: _axes(name, leaves) for name in named})
    try:
        steps = [(_CODES[word], operands, number) for word, operands, number in _words(scalar, leaves)]
    except _Unknown:
        return None, ()
    return (steps if len(steps) < _OF_C["DEEPEST"] else None), [sources[name] for name in used]


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
