"""The units of operators from those of their operands, with errors for incompatible units."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.units import ONE, RADIAN, Unit, common


@dataclass(frozen=True, kw_only=True)
class Operand:
    """An operand of an operator, or an argument of a function."""

    text: str
    unit: Unit | None
    """None: it has none, or an unknown one"""
    number: Fraction | None = None
    """its value, if it consists of numbers only, as 1 / 2"""


Rule: TypeAlias = Callable[[str, Sequence[Operand]], Unit | None]
"""Function from a word and its operands to the unit of the result; raises `UsageError` for incompatible units"""


def agreed(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The common unit; raises `UsageError` if two of them differ."""
    known = [(operand.text, operand.unit) for operand in operands if operand.unit is not None]
    for i, (text, unit) in enumerate(known):
        for other, another in known[:i]:
            if unit.agrees(another) is False:
                raise UsageError(
                    f"{word}: {other} is in {another}, {text} is in {unit}; expected one unit, or a number as a factor"
                )
    return common([unit for _, unit in known]) if len(known) == len(operands) else None


def first(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The unit of the first operand."""
    return operands[0].unit


def none(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The unit of a truth value, with any operands."""
    return ONE


def compared(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The unit of a truth value, with operands of one unit."""
    agreed(word, operands)
    return ONE


def direction(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The unit of an angle, with operands of one unit."""
    agreed(word, operands)
    return RADIAN


def product(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The product of both units."""
    left, right = (operand.unit for operand in operands)
    return None if left is None or right is None else left.times(right)


def quotient(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The first unit divided by the second."""
    left, right = (operand.unit for operand in operands)
    return None if left is None or right is None else left.times(right.power(Fraction(-1)))


def power(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The power of the first unit; the exponent has none."""
    base, exponent = operands
    if base.unit is None:
        return None
    if exponent.number is not None:
        return base.unit.power(exponent.number)
    if base.unit.is_ratio is False and not base.unit.has_number:
        raise UsageError(f"{exponent.text} is the exponent of {base.text}, which is in {base.unit}; expected a number")
    return ONE if base.unit.is_ratio else None


def root(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The root of the unit."""
    unit = operands[0].unit
    return None if unit is None else unit.power(Fraction(1, 2))


def ratio(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The unit 1, with an operand in 1 or rad."""
    unit = operands[0].unit
    if unit is not None and unit.is_ratio is False and not unit.has_number:
        raise UsageError(f"{word} of {operands[0].text}, which is in {unit}; expected 1 or rad, or a factor")
    return ONE


def angle(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The unit of an angle, with an operand in 1 or rad."""
    ratio(word, operands)
    return RADIAN
