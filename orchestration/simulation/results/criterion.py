"""Parts of a criterion: the objective that it judges, its bound, and the parts that a run did not meet."""

import operator
from collections.abc import Iterator, Mapping
from typing import Any

from orchestration.systems.expressions.syntax import Name, Node, Number, Operation, names, parse
from orchestration.systems.system.model import System

_HOLDS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


def judged_objective(system: System) -> str | None:
    """The objective that the criterion judges, or else the first one; None if there is none."""
    named = names(parse(system.criterion.good)) if system.criterion.good is not None else ()
    return next((name for name in named if name in system.objectives), next(iter(system.objectives), None))


def bound_of(system: System, metric: str) -> float | None:
    """The bound of a criterion that is only `metric < number`, or another comparison; None for any other."""
    if system.criterion.good is None:
        return None
    match parse(system.criterion.good):
        case Operation(operation, (Name(name), Number(bound))) if name == metric and operation in _HOLDS:
            return bound
    return None


def unmet(system: System, metrics: Mapping[str, Any], units: Mapping[str, str]) -> str | None:
    """The parts of the criterion that a run did not meet, with value and bound; None: it met all, or diverged.

    `units` are those of its metrics, by name. Parts are joined by `and`; for one that is no comparison of an objective
    with a number the text is only that it does not hold.
    """
    if system.criterion.good is None or metrics["good"] is not False or metrics["outcome"] == "diverged":
        return None
    parts = [text for part in _parts(parse(system.criterion.good)) if (text := _missed(part, metrics, units))]
    return "; ".join(parts) or f"{system.criterion.good} does not hold"


def _parts(node: Node) -> Iterator[Node]:
    match node:
        case Operation("and", (left, right)):
            yield from _parts(left)
            yield from _parts(right)
        case _:
            yield node


def _missed(part: Node, metrics: Mapping[str, Any], units: Mapping[str, str]) -> str | None:
    match part:
        case Operation(operation, (Name(name), Number(bound))) if operation in _HOLDS and name in metrics:
            value = metrics[name]
            if value is not None and _HOLDS[operation](value, bound):
                return None
            unit = f" {units[name]}" if name in units else ""
            text = "has no value" if value is None else f"= {value:.4g}{unit}"
            return f"{name} {text}, expected {operation} {bound:g}{unit}"
    return None
