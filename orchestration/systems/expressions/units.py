"""The unit of an expression from the units of its names, with errors for incompatible units."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from orchestration.foundation.basics.units import NUMBER, ONE, SECOND, Unit
from orchestration.systems.expressions.operators import OPERATORS
from orchestration.systems.expressions.recorded import STOP_TIME, TIME
from orchestration.systems.expressions.syntax import (
    Call,
    JobMeasure,
    Name,
    Node,
    Number,
    Operation,
    Sampled,
    is_over_run,
    names_job_measure,
    parse_job_measures,
    text,
)
from orchestration.systems.expressions.unit_rules import Operand, agreed

Units: TypeAlias = Mapping[str, Unit | None]
"""By name; None: it has none, or an unknown one"""


def unit_of(node: Node, units: Units) -> Unit | None:
    """The unit of an expression of names in `units`; None where one of these has none.

    Raises `UsageError` for values in different units that are added or compared, and for functions of a ratio with
    other arguments. A number has no unit and fits any other: also `x + 2 * v`.
    """
    match node:
        case Number():
            return NUMBER
        case JobMeasure(what):
            return SECOND if what == "response" else NUMBER
        case Name(name):
            return _named(name, units)
        case Sampled(_, argument):
            return unit_of(argument, units)
        case Call(function, arguments) if is_over_run(node):
            return _over_run(function, [_operand(argument, units) for argument in arguments])
        case Operation(word, operands) | Call(word, operands):
            return OPERATORS[word].unit(word, [_operand(operand, units) for operand in operands])


def _operand(node: Node, units: Units) -> Operand:
    return Operand(text=text(node), unit=unit_of(node, units), number=_constant(node))


def _named(name: str, units: Units) -> Unit | None:
    if names_job_measure(name):
        return unit_of(parse_job_measures(name), units)
    if name in (TIME, STOP_TIME):
        return SECOND
    if name in units:
        return units[name]
    parts = [f"{name}.{axis}" for axis in "xyzw" if f"{name}.{axis}" in units]
    return agreed(name, [Operand(text=part, unit=units[part]) for part in parts]) if parts else None


def _constant(node: Node) -> Fraction | None:
    """The value of an expression that consists of numbers only, as 1 / 2."""
    match node:
        case Number(value):
            return Fraction(value).limit_denominator(1000)
        case Operation("neg", (operand,)):
            inner = _constant(operand)
            return None if inner is None else -inner
        case Operation("/", (above, below)):
            one, other = _constant(above), _constant(below)
            return one / other if one is not None and other else None
    return None


def _over_run(function: str, arguments: Sequence[Operand]) -> Unit | None:
    of = arguments[0].unit
    if function == "settling_time":
        agreed(function, arguments)
    if function in ("settling_time", "peak_time"):
        return SECOND
    if function in ("share", "growth_share"):
        return ONE
    return of.times(SECOND) if function == "integral" and of is not None else of
