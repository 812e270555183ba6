"""Expressions at one instant: in terms of scalar signals, and compiled to a function of the current values."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.expressions.operators import OPERATORS, PYTHON
from orchestration.systems.expressions.syntax import Call, Name, Node, Number, Operation, Sampled, children, is_over_run

A_NUMBER = "expected a number, as norm(…)"
IS_VECTOR = f"it is a vector; {A_NUMBER}"


def scalars(node: Node, vectors: Mapping[str, Sequence[str]]) -> list[Node]:
    """The expression in terms of signals only: one, or several for a vector.

    `vectors` has the components of vectors by name. Raises `UsageError` for vectors of different sizes.
    """
    match node:
        case Name(name):
            return [Name(part) for part in vectors.get(name, (name,))]
        case Operation(sign, operands):
            return [Operation(sign, parts) for parts in _side_by_side(sign, operands, vectors)]
        case Call(function, arguments) if is_over_run(node):
            return [Call(function, tuple(scalar(argument, vectors) for argument in arguments))]
        case Call(function, arguments) if OPERATORS[function].joins:
            return [Call(function, tuple(part for argument in arguments for part in scalars(argument, vectors)))]
        case Call(function, arguments):
            return [Call(function, parts) for parts in _side_by_side(function, arguments, vectors)]
        case Sampled(connection, argument):
            return [Sampled(connection, scalar(argument, vectors))]
    return [node]


def scalar(node: Node, vectors: Mapping[str, Sequence[str]]) -> Node:
    """The expression of a number in terms of signals only; raises `UsageError` for a vector."""
    found = scalars(node, vectors)
    if len(found) > 1:
        raise UsageError(IS_VECTOR)
    return found[0]


def _side_by_side(what: str, nodes: Sequence[Node], vectors: Mapping[str, Sequence[str]]) -> list[tuple[Node, ...]]:
    parts = [scalars(node, vectors) for node in nodes]
    size = max(map(len, parts))
    if any(len(each) not in (1, size) for each in parts):
        raise UsageError(f"{what} of vectors of different sizes")
    return [tuple(each[i if len(each) > 1 else 0] for each in parts) for i in range(size)]


Current: TypeAlias = Callable[[Sequence[float]], float]
"""A number from the values of the signals in an expression"""


def compiled(node: Node, places: Mapping[str, int]) -> Current:
    """A function of a sequence of values, with the index of each signal in `places`.

    Raises `UsageError` for an unknown name, a vector outside `norm`, or a function over a whole run.
    """
    vectors: dict[str, Sequence[str]] = {}
    _check(node, places, vectors)
    written = _Lines(places)
    result = written.value(scalar(node, vectors))
    scope: dict[str, Any] = dict(PYTHON)
    # The text has only numbers, indices and operators, whatever the expression is.
    exec("\n    ".join(["def current(values):", *written.lines, f"return {result}"]), scope)
    current: Current = scope["current"]
    return current


def _check(node: Node, places: Mapping[str, int], vectors: dict[str, Sequence[str]]) -> None:
    """Raise `UsageError` for what has no value at an instant, and add the signals of vectors to `vectors`."""
    if isinstance(node, Sampled):
        raise UsageError("sampled is of a whole run; expected functions of values at one instant")
    if isinstance(node, Call) and is_over_run(node):
        raise UsageError(f"{node.function} is of a whole run; expected functions of values at one instant")
    if isinstance(node, Name) and node.text not in places:
        vectors[node.text] = [name for axis in "xyzw" if (name := f"{node.text}.{axis}") in places]
        if not vectors[node.text]:
            raise UsageError(f"there is no {node.text}; expected a recorded signal or time")
    for child in children(node):
        _check(child, places, vectors)
    if isinstance(node, Call) and not OPERATORS[node.function].joins:
        sizes = [len(scalars(argument, vectors)) for argument in node.arguments]
        if max(sizes) > 1:
            raise UsageError(f"{node.function} of a vector; {A_NUMBER}")


class _Lines:
    """Lines of Python, each of which names the result of one operator."""

    def __init__(self, places: Mapping[str, int]) -> None:
        self.lines: list[str] = []
        self._places, self._found = places, dict[object, str]()

    def value(self, node: Node) -> str:
        """The name of a number."""
        match node:
            case Number(value):
                return repr(value)
            case Name(name):
                return self._named(node, lambda: f"values[{self._places[name]}]")
            case Operation(word, operands) | Call(word, operands) if not OPERATORS[word].gives_truth:
                return self._named(node, lambda: OPERATORS[word].python(*map(self.value, operands)))
        return self._named(node, lambda: f"1.0 if {self._truth(node)} else 0.0")

    def _truth(self, node: Node) -> str:
        """The name of a truth value."""
        if not isinstance(node, Operation) or not OPERATORS[node.sign].gives_truth:
            return self.value(node)
        operator, operands = OPERATORS[node.sign], node.operands
        write = self._truth if operator.takes_truths else self.value
        return self._named((node, "truth"), lambda: operator.python(*map(write, operands)))

    def _named(self, key: object, text: Callable[[], str]) -> str:
        if key not in self._found:
            written = text()
            self._found[key] = f"x{len(self.lines)}"
            self.lines.append(f"{self._found[key]} = {written}")
        return self._found[key]
