"""Units as FMI defines them, those of results of operators, and numbers with units as people read them."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TypeAlias

from fmu_kit.units import BASE, SYMBOLS, factors
from orchestration.foundation.basics.errors import UsageError


@dataclass(frozen=True, kw_only=True)
class BaseUnits:
    """A unit in SI base units: value · factor + offset, with these exponents."""

    exponents: tuple[Fraction, ...]
    """Exponents of `BASE`; whole numbers in FMI"""
    factor: float = 1.0
    offset: float = 0.0

    def times(self, other: "BaseUnits") -> "BaseUnits":
        """Of a product; an offset has no meaning there."""
        exponents = tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True))
        return BaseUnits(exponents=exponents, factor=self.factor * other.factor)

    def power(self, exponent: Fraction) -> "BaseUnits":
        """Of a power."""
        return BaseUnits(exponents=tuple(a * exponent for a in self.exponents), factor=self.factor ** float(exponent))


_NONE = BaseUnits(exponents=(Fraction(0),) * len(BASE))


@dataclass(frozen=True, kw_only=True)
class Unit:
    """The unit of the value of an expression."""

    symbols: tuple[tuple[str, Fraction], ...] = ()
    """names with their exponents, as written"""
    base: BaseUnits | None = _NONE
    """None: no FMU defines it"""
    has_number: bool = False
    """whether a plain number, whose unit is not stated, is a factor of it: it is compatible with any unit"""

    def __str__(self) -> str:
        ordered = sorted(self.symbols, key=lambda symbol: symbol[0] == "s")  # seconds last, as in N.m.s
        above = [_power(name, exponent) for name, exponent in ordered if exponent > 0]
        below = [_power(name, -exponent) for name, exponent in ordered if exponent < 0]
        divisor = f"({'.'.join(below)})" if len(below) > 1 else "".join(below)
        return (".".join(above) or "1") + (f"/{divisor}" if below else "")

    def times(self, other: "Unit") -> "Unit":
        """Of a product."""
        exponents = dict(self.symbols)
        for name, exponent in other.symbols:
            exponents[name] = exponents.get(name, Fraction(0)) + exponent
        return Unit(
            symbols=tuple((name, exponent) for name, exponent in exponents.items() if exponent),
            base=None if self.base is None or other.base is None else self.base.times(other.base),
            has_number=self.has_number or other.has_number,
        )

    def power(self, exponent: Fraction) -> "Unit":
        """Of a power."""
        return replace(
            self,
            symbols=tuple((name, e * exponent) for name, e in self.symbols if exponent),
            base=None if self.base is None else self.base.power(exponent),
        )

    @property
    def is_ratio(self) -> bool | None:
        """Whether it is 1 or rad, which is 1 in SI; None if unknown."""
        return None if self.base is None else _is_same(self.base, _NONE)

    def agrees(self, other: "Unit") -> bool | None:
        """Whether values in both units can be added; None if unknown."""
        return True if self.has_number or other.has_number else self.is_same(other)

    def is_same(self, other: "Unit") -> bool | None:
        """Whether they are the same unit, apart from numbers; None if unknown."""
        if self is other:
            return True
        same_name = self.symbols == other.symbols
        if self.base is None or other.base is None:
            return True if same_name else None
        return _is_same(self.base, other.base) and (self.base.offset == other.base.offset or same_name)


ONE, SECOND, METRE, RADIAN, NUMBER = (
    Unit(),
    *(
        Unit(symbols=((name, Fraction(1)),), base=BaseUnits(exponents=tuple(Fraction(b == name) for b in BASE)))
        for name in ("s", "m", "rad")
    ),
    Unit(has_number=True),
)


def named(name: str, base: BaseUnits | None) -> Unit:
    """A unit by its name in an FMU; a name that is not a plain product stays whole."""
    if name == "1":
        return ONE
    try:
        exponents = factors(name)
    except ValueError:
        exponents = {name: 1}
    return Unit(symbols=tuple((symbol, Fraction(exponent)) for symbol, exponent in exponents.items()), base=base)


def common(units: Sequence[Unit]) -> Unit | None:
    """The unit of a sum of values whose units agree; None if unknown.

    Units without a plain number as a factor decide, and of 1 and rad the latter.
    """
    decisive = [u for u in units if not u.has_number] or [u for u in units if u.symbols] or list(units)
    chosen = next((u for u in decisive if u.symbols), decisive[0])
    return chosen if all(u.is_same(chosen) for u in decisive) else None


def _is_same(one: BaseUnits, other: BaseUnits) -> bool:
    return math.isclose(one.factor, other.factor, rel_tol=1e-9) and one.exponents[:-1] == other.exponents[:-1]


def _power(name: str, exponent: Fraction) -> str:
    if exponent == 1:
        return name
    whole = name if name[-1:].isalpha() and name.isalnum() else f"({name})"
    return f"{whole}{exponent}" if exponent.denominator == 1 else f"{whole}^({exponent})"


def after(unit: str | None) -> str:
    """The text after a number in this unit: empty for none and for 1."""
    return "" if unit in (None, "1") else f" {unit}"


def in_brackets(name: str, unit: str | None) -> str:
    """A quantity with its unit, as an axis label."""
    return name if unit in (None, "1") else f"{name} [{unit}]"


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


def over_time(word: str, operands: Sequence[Operand]) -> Unit | None:
    """The unit of an integral over time: J of W, C of A."""
    unit = operands[0].unit
    return None if unit is None else _renamed(unit.times(SECOND))


def _renamed(unit: Unit) -> Unit:
    """A symbol times a second under the one symbol that SI has for it, if it has."""
    is_product = len(unit.symbols) == 2 and all(exponent == 1 for _, exponent in unit.symbols)
    if not is_product or unit.base is None or unit.base.factor != 1.0:
        return unit
    exponents = {name: int(e) for name, e in zip(BASE, unit.base.exponents) if e}
    return next((replace(unit, symbols=((name, Fraction(1)),)) for name, e in SYMBOLS.items() if e == exponents), unit)


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


def _always(unit: Unit, expected: Rule = lambda word, operands: None) -> Rule:
    """The rule of one unit, with operands that `expected` allows."""

    def rule(word: str, operands: Sequence[Operand]) -> Unit | None:
        expected(word, operands)
        return unit

    return rule


none, second = _always(ONE), _always(SECOND)
"""The units of a truth value and of a time, with any operands"""
compared, settled, direction = (_always(unit, agreed) for unit in (ONE, SECOND, RADIAN))
"""The units of a truth value, a time and an angle, with operands of one unit"""
angle = _always(RADIAN, ratio)
"""The unit of an angle, with an operand in 1 or rad"""


DIGITS = 4
"""Significant digits in a sentence"""
EXACT_DIGITS = 9
"""Significant digits of what was set, as of a period"""
PREFIXES = (("", 1.0), ("m", 1e-3), ("µ", 1e-6), ("n", 1e-9))
WITH_PREFIX = ("s", "m")
"""Units that take a prefix"""
MAX_NAMED = 3
"""Names, or values, in a sentence; more are counted"""


def quantity(value: float, unit: str | None, digits: int = DIGITS, like: float | None = None) -> str:
    """A value in its unit, as `71.75 ms`; with that many significant digits, and the prefix of a value `like` it."""
    if unit not in WITH_PREFIX:
        return f"{value:.{digits}g}{after(unit)}"
    value = float(f"{value:.{digits}g}")
    of = value if like is None else like
    prefix, size = next((pair for pair in PREFIXES if abs(of) >= pair[1]), PREFIXES[-1 if of else 0])
    return f"{value / size:.{digits}g} {prefix}{unit}"


def time_text(value: float) -> str:
    """A time with a readable unit, exactly as it was set."""
    return quantity(value, "s", EXACT_DIGITS)


def counted(count: int, what: str) -> str:
    """So many of what a noun names, as `1 state` and `2 states`."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def some(texts: Iterable[str], separator: str = ", ") -> str:
    """The first few of some texts, and how many more there are."""
    known = list(texts)
    more = f" and {len(known) - MAX_NAMED} more" if len(known) > MAX_NAMED else ""
    return separator.join(known[:MAX_NAMED]) + more
