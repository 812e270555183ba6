"""The unit of an expression, from the units of what it names; what does not go together is refused."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TypeAlias

from orchestration.basics.errors import UsageError
from orchestration.basics.units import NUMBER, ONE, RADIAN, SECOND, Unit, common
from orchestration.expressions.recorded import STOP_TIME, TIME
from orchestration.expressions.syntax import Call, Name, Node, Number, Operation, Sampled, is_over_run, text

Units: TypeAlias = Mapping[str, Unit | None]
"""By name; None: it has none, or none that is known"""


def unit_of(node: Node, units: Units) -> Unit | None:
    """The unit of an expression over what `units` names; None where something in it has none.

    Raises `UsageError` for values in different units that are added or compared, and for a function of a ratio that
    is given something else. A number is without unit, and so goes with anything: also `x + 2 * v`.
    """
    match node:
        case Number():
            return NUMBER
        case Name(name):
            return _named(name, units)
        case Sampled(_, argument):
            return unit_of(argument, units)
        case Operation(sign, operands):
            return _operation(sign, operands, [unit_of(operand, units) for operand in operands])
        case Call(function, arguments):
            found = [unit_of(argument, units) for argument in arguments]
            return (_over_run if is_over_run(node) else _at_instant)(function, arguments, found)


Found: TypeAlias = Sequence[Unit | None]
"""The units of operands or arguments"""


def _named(name: str, units: Units) -> Unit | None:
    if name in (TIME, STOP_TIME):
        return SECOND
    if name in units:
        return units[name]
    parts = [f"{name}.{axis}" for axis in "xyzw" if f"{name}.{axis}" in units]
    return _agreed(name, [Name(part) for part in parts], [units[part] for part in parts]) if parts else None


def _operation(sign: str, operands: Sequence[Node], found: Found) -> Unit | None:
    if sign in ("and", "or", "not"):
        return ONE
    if sign == "neg":
        return found[0]
    if sign == "**":
        return _power(operands[0], found[0], operands[1])
    if sign in ("*", "/"):
        left, right = found
        return None if left is None or right is None else left.times(right.power(Fraction(1 if sign == "*" else -1)))
    agreed = _agreed(sign, operands, found)
    return agreed if sign in ("+", "-") else ONE


def _power(of: Node, unit: Unit | None, exponent: Node) -> Unit | None:
    if unit is None:
        return None
    number = _constant(exponent)
    if number is not None:
        return unit.power(number)
    if unit.is_ratio is False and not unit.has_number:
        raise UsageError(f"{text(exponent)} is the exponent of {text(of)}, which is in {unit}; expected a number")
    return ONE if unit.is_ratio else None


def _constant(node: Node) -> Fraction | None:
    """The value of an expression of numbers alone, as 1 / 2."""
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


def _over_run(function: str, arguments: Sequence[Node], found: Found) -> Unit | None:
    of = found[0]
    if function == "settling_time":
        _agreed(function, arguments, found)
    if function in ("settling_time", "peak_time"):
        return SECOND
    if function in ("share", "growth_share"):
        return ONE
    return of.times(SECOND) if function == "integral" and of is not None else of


def _at_instant(function: str, arguments: Sequence[Node], found: Found) -> Unit | None:
    if function in ("abs", "min", "max", "norm", "hypot"):
        return _agreed(function, arguments, found)
    if function == "atan2":
        _agreed(function, arguments, found)
        return RADIAN
    of = found[0]
    if function == "sqrt":
        return None if of is None else of.power(Fraction(1, 2))
    if of is not None and of.is_ratio is False and not of.has_number:
        raise UsageError(f"{function} of {text(arguments[0])}, which is in {of}; expected 1 or rad, or a factor")
    return RADIAN if function in ("asin", "acos") else ONE


def _agreed(what: str, operands: Sequence[Node], found: Found) -> Unit | None:
    """The unit that all have; raises `UsageError` if two of them differ."""
    known = [(operand, unit) for operand, unit in zip(operands, found, strict=True) if unit is not None]
    for i, (operand, unit) in enumerate(known):
        for other, another in known[:i]:
            if unit.agrees(another) is False:
                one, two = (f"{text(node)} is in {of}" for node, of in ((other, another), (operand, unit)))
                raise UsageError(f"{what}: {one}, {two}; expected one unit, or a number as a factor")
    return common([unit for _, unit in known]) if len(known) == len(operands) else None
