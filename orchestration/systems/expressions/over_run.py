"""Evaluates expressions over a whole run."""

import functools
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

import numpy as np

from orchestration.foundation.basics.errors import UsageError, did_you_mean
from orchestration.systems.expressions.over_span import Recorded, Spans, SpanValues
from orchestration.systems.expressions.reductions import FOLDS
from orchestration.systems.expressions.syntax import (
    Call,
    Name,
    Node,
    Operation,
    Sampled,
    children,
    is_over_run,
    names,
    names_job_measure,
    parse,
    text,
)


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
            folds = {call: FOLDS[call.function](call) for call, depth in depths.items() if depth == level}
            for span in spans():
                context, values = span, SpanValues(span, known)
                for call, fold in folds.items():
                    with _naming(nodes, whole, call):
                        values.add_to(fold)
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


def expect_names(node: Node, valid: set[str], place: str) -> None:
    """Raise `UsageError` for the first name of an expression that is not valid, with those nearest to it."""
    for name in names(node):
        if name not in valid:
            raise UsageError(f"{place}: there is no {name}{did_you_mean(name, valid, most=3)}")
