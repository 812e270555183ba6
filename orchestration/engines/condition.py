"""The condition by which a run has diverged as a program for the compiled loop, which asks Python where it is close."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

from orchestration.engines.board import Board
from orchestration.engines.sources import Values
from orchestration.engines.structures import constants
from orchestration.engines.watch import is_wanted
from orchestration.expressions.operators import OPERATORS
from orchestration.expressions.scalars import scalars
from orchestration.expressions.syntax import Call, Name, Node, Number, Operation, names, parse

Step: TypeAlias = tuple[int, int, float]
"""What is done, how many operands it takes (of a signal, its place), and the number that it is"""

HEADER = Path(__file__).with_name("condition.h")
_OF_C = constants(HEADER.read_text(encoding="utf-8"))
_BOUNDED = {word: made.bounded for word, made in OPERATORS.items() if made.bounded is not None}
_CODES = {word: _OF_C[word.upper()] for word in ("number", "time", "signal", "source")}
_CODES |= {word: code for code, word in enumerate(_BOUNDED, start=_OF_C["OPERATOR"])}


class _Unknown(Exception):
    """A function that has no program: Python is asked at every instant."""


def operators() -> str:
    """The C of operators.h, which condition.h includes: what each operator makes of its operands."""
    cases = [f"    case {_CODES[word]}: return {code}; /* {word} */" for word, code in _BOUNDED.items()]
    head = "static Known applied(int64_t code, const Known *a, int64_t n) {"
    return "\n".join(
        [head, "    switch (code) {", *cases, "    default: return (Known){0.0, INFINITY};", "    }", "}", ""]
    )


def program(
    condition: str | None,
    board: Board,
    sources: Mapping[str, Values],
    signals_of: Mapping[str, Sequence[str]],
    numbers: Mapping[str, float],
) -> tuple[Sequence[Step] | None, Sequence[Values]]:
    """The steps over the row and the sources that are in it, whose signals are counted through; None: no program.

    Arguments are those that `watch` has taken.
    """
    if condition is None:
        return [(_CODES["number"], 0, 0.0)], ()
    node = parse(condition)
    wanted = set(names(node))
    used = [name for name, signals in signals_of.items() if any(is_wanted(signal, wanted) for signal in signals)]
    leaves = {column: ("signal", place, 0.0) for column, place in board.place.items()}
    leaves["time"] = ("time", 0, 0.0)
    leaves |= {s: ("source", i, 0.0) for i, s in enumerate(signal for name in used for signal in signals_of[name])}
    leaves |= {name: ("number", 0, float(value)) for name, value in numbers.items()}
    (scalar,) = scalars(node, {name: _axes(name, leaves) for name in wanted})
    try:
        steps = [(_CODES[word], operands, number) for word, operands, number in _words(scalar, leaves)]
    except _Unknown:
        return None, ()
    return (steps if len(steps) < _OF_C["DEEPEST"] else None), [sources[name] for name in used]


_Words: TypeAlias = list[tuple[str, int, float]]


def _axes(name: str, leaves: Mapping[str, tuple[str, int, float]]) -> Sequence[str]:
    """What a name stands for."""
    return (name,) if name in leaves else [part for axis in "xyzw" if (part := f"{name}.{axis}") in leaves]


def _words(node: Node, leaves: Mapping[str, tuple[str, int, float]]) -> _Words:
    """Operands before what is made of them."""
    match node:
        case Number(value):
            return [("number", 0, value)]
        case Name(name):
            return [leaves[name]]
        case Operation(word, operands) | Call(word, operands) if word in _BOUNDED:
            return [*(step for operand in operands for step in _words(operand, leaves)), (word, len(operands), 0.0)]
    raise _Unknown
