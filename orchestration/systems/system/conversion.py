"""Conversions at the end of a connection: types by rule, units by a scale and an offset that the file states."""

from dataclasses import dataclass

from orchestration.components.fmi.read_description import Kind, Model, Variable
from orchestration.foundation.basics.unit_algebra import BaseUnits

BECOMES: dict[Kind, tuple[Kind, ...]] = {
    "Real": ("Real",),
    "Integer": ("Real", "Integer", "Enumeration"),
    "Enumeration": ("Real", "Integer", "Enumeration"),
    "Boolean": ("Real", "Integer", "Boolean"),
}
"""The kinds of inputs that an output of a kind can be connected to"""


@dataclass(frozen=True, kw_only=True)
class Conversion:
    """The receiver gets scale · value + offset, in its unit."""

    scale: float = 1.0
    offset: float = 0.0

    @property
    def is_none(self) -> bool:
        """Whether it leaves values unchanged."""
        return self == Conversion()

    def then(self, other: "Conversion") -> "Conversion":
        """This conversion followed by the other."""
        return Conversion(scale=other.scale * self.scale, offset=other.scale * self.offset + other.offset)

    def __call__(self, value: float) -> float:
        """A value, converted."""
        return self.scale * value + self.offset

    def __str__(self) -> str:
        return f"scale = {self.scale:.12g}" + (f" and offset = {self.offset:.12g}" if self.offset else "")


class OtherQuantity(Exception):
    """Two units are of different quantities."""


def between(one: BaseUnits, other: BaseUnits) -> Conversion:
    """The conversion from one unit to another; raises `OtherQuantity`."""
    if one.exponents != other.exponents:
        raise OtherQuantity
    return Conversion(scale=one.factor / other.factor, offset=(one.offset - other.offset) / other.factor)


def conversion(sender: Model, output: Variable, receiver: Model, into: Variable) -> Conversion | None:
    """The conversion from the unit of an output to that of an input; None if they differ and one is not defined.

    Where a unit is missing, nothing is converted. Raises `OtherQuantity`.
    """
    if not (output.unit and into.unit) or output.unit == into.unit:
        return Conversion()
    one, other = sender.base_units(output.unit), receiver.base_units(into.unit)
    return None if one is None or other is None else between(one, other)
