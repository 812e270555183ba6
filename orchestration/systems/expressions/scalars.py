"""Expressions of vectors as expressions of their components."""

from collections.abc import Mapping, Sequence

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.syntax import Call, Name, Node, Operation, Sampled, is_over_run

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
