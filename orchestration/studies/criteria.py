"""What a criterion is about: the objective that it judges, and where it draws the line."""

from orchestration.expressions.syntax import Name, Number, Operation, names, parse
from orchestration.system.model import System


def judged(system: System) -> str | None:
    """The objective that the criterion is about, or the first one; None where there is none."""
    named = names(parse(system.criterion.good)) if system.criterion.good is not None else ()
    return next((name for name in named if name in system.objectives), next(iter(system.objectives), None))


def edge(system: System, metric: str) -> float | None:
    """The bound of a criterion that is `metric < number` and no more, or with another comparison."""
    if system.criterion.good is None:
        return None
    match parse(system.criterion.good):
        case Operation("<" | "<=" | ">" | ">=", (Name(name), Number(bound))) if name == metric:
            return bound
    return None
