"""What becomes what at the end of a connection: types by rule, units by a factor that the file states."""

from dataclasses import dataclass
from fractions import Fraction

from orchestration.fmi.model import Kind, Model, Variable
from orchestration.units import BASE, BaseUnits

BECOMES: dict[Kind, tuple[Kind, ...]] = {
    "Real": ("Real",),
    "Integer": ("Real", "Integer", "Enumeration"),
    "Enumeration": ("Real", "Integer", "Enumeration"),
    "Boolean": ("Real", "Integer", "Boolean"),
}
"""Anything becomes a Real; a Boolean becomes a number; a Real becomes nothing else by itself"""


@dataclass(frozen=True, kw_only=True)
class Conversion:
    """What a receiver gets in its own unit is scale · value + offset."""

    scale: float = 1.0
    offset: float = 0.0

    @property
    def is_none(self) -> bool:
        """Whether values stay as they are."""
        return self == Conversion()

    def then(self, other: "Conversion") -> "Conversion":
        """This one, and the other on what comes of it."""
        return Conversion(scale=other.scale * self.scale, offset=other.scale * self.offset + other.offset)

    def __call__(self, value: float) -> float:
        """A value, converted."""
        return self.scale * value + self.offset

    def __str__(self) -> str:
        return f"scale = {self.scale:.12g}" + (f" and offset = {self.offset:.12g}" if self.offset else "")


class OtherQuantity(Exception):
    """Two units that no factor turns into each other."""


def between(one: BaseUnits, other: BaseUnits) -> Conversion:
    """From one unit to another; raises `OtherQuantity`."""
    if one.exponents != other.exponents:
        raise OtherQuantity
    return Conversion(scale=one.factor / other.factor, offset=(one.offset - other.offset) / other.factor)


def base_units(model: Model, name: str | None) -> BaseUnits | None:
    """What a unit is by an FMU's definitions; None if they do not say."""
    unit = next((u for u in model.description.unitDefinitions if u.name == name), None)
    base = getattr(unit, "baseUnit", None)
    if base is None:
        return None
    exponents = tuple(Fraction(getattr(base, key)) for key in BASE)
    return BaseUnits(exponents=exponents, factor=float(base.factor), offset=float(base.offset))


def conversion(sender: Model, output: Variable, receiver: Model, into: Variable) -> Conversion | None:
    """How the unit of an output becomes that of an input; None if an FMU does not define a unit that differs.

    Where a unit is missing, nothing is converted. Raises `OtherQuantity`.
    """
    if not (output.unit and into.unit) or output.unit == into.unit:
        return Conversion()
    one, other = base_units(sender, output.unit), base_units(receiver, into.unit)
    return None if one is None or other is None else between(one, other)
