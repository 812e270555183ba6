"""The condition by which a run has diverged as a program for the compiled loop, which asks Python where it is close."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from orchestration.engines.board import Board
from orchestration.engines.sources import Values
from orchestration.engines.watch import is_wanted
from orchestration.expressions.syntax import Name, Node, Number, Operation, names, parse

Step: TypeAlias = tuple[int, int, float]
"""What is done, how many operands it takes (of a signal, its place), and the number that it is"""

_CODES = (
    "number", "time", "signal", "source", "neg", "abs", "+", "-", "*", "/", "norm", "<", "<=", ">", ">=", "==", "!=",
    "not", "and", "or",
)  # fmt: skip
"""As condition.h counts them"""
_DEEPEST = 256
"""Numbers that it has room for"""


class _Unknown(Exception):
    """A function or a vector that has no program: Python is asked at every instant."""


def program(
    condition: str | None,
    board: Board,
    sources: Mapping[str, Values],
    signals_of: Mapping[str, Sequence[str]],
    numbers: Mapping[str, float],
) -> tuple[Sequence[Step] | None, Sequence[Values]]:
    """The steps over the row and the sources that are in it, whose signals are counted through; None: no program.

    Arguments are those of `watch`.
    """
    if condition is None:
        return [(_CODES.index("number"), 0, 0.0)], ()
    node = parse(condition)
    wanted = set(names(node))
    used = [name for name, signals in signals_of.items() if any(is_wanted(signal, wanted) for signal in signals)]
    leaves = {column: ("signal", place, 0.0) for column, place in board.place.items()}
    leaves["time"] = ("time", 0, 0.0)
    leaves |= {s: ("source", i, 0.0) for i, s in enumerate(signal for name in used for signal in signals_of[name])}
    leaves |= {name: ("number", 0, float(value)) for name, value in numbers.items()}
    try:
        parts = _parts(node, leaves)
    except _Unknown:
        return None, ()
    steps = [(_CODES.index(word), operands, number) for word, operands, number in parts[0]]
    return (steps if len(parts) == 1 and len(steps) < _DEEPEST else None), [sources[name] for name in used]


_Words: TypeAlias = list[tuple[str, int, float]]


def _parts(node: Node, leaves: Mapping[str, tuple[str, int, float]]) -> list[_Words]:
    """One list of steps for a number, several for a vector."""
    if isinstance(node, Number):
        return [[("number", 0, node.value)]]
    if isinstance(node, Name):
        found = [node.text] if node.text in leaves else [f"{node.text}.{axis}" for axis in "xyzw"]
        if not any(name in leaves for name in found):
            raise _Unknown
        return [[leaves[name]] for name in found if name in leaves]
    if isinstance(node, Operation):
        operands = [_parts(operand, leaves) for operand in node.operands]
        size = max(map(len, operands))
        return [_applied(node.sign, [parts[i if len(parts) > 1 else 0] for parts in operands]) for i in range(size)]
    function = getattr(node, "function", None)
    arguments = [part for argument in getattr(node, "arguments", ()) for part in _parts(argument, leaves)]
    if function in ("norm", "hypot"):
        return [_applied("norm", arguments)]
    if function == "abs" and len(arguments) == 1:
        return [_applied("abs", arguments)]
    raise _Unknown


def _applied(word: str, operands: Sequence[_Words]) -> _Words:
    if word not in _CODES:
        raise _Unknown
    return [*(step for operand in operands for step in operand), (word, len(operands), 0.0)]
