"""What becomes what at the end of a connection: types by rule, units by a factor that the file states."""

from dataclasses import dataclass

from orchestration.fmi.model import Kind, Model, Variable

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

    def __str__(self) -> str:
        return f"scale = {self.scale:.12g}" + (f" and offset = {self.offset:.12g}" if self.offset else "")


class OtherQuantity(Exception):
    """Two units that no factor turns into each other."""


def conversion(sender: Model, output: Variable, receiver: Model, into: Variable) -> Conversion | None:
    """How the unit of an output becomes that of an input; None if an FMU does not define a unit that differs.

    Where a unit is missing, nothing is converted. Raises `OtherQuantity`.
    """
    if not (output.unit and into.unit) or output.unit == into.unit:
        return Conversion()
    ends = []
    for model, variable in ((sender, output), (receiver, into)):
        unit = next((u for u in model.description.unitDefinitions if u.name == variable.unit), None)
        base = getattr(unit, "baseUnit", None)
        if base is None:
            return None
        exponents = tuple(getattr(base, key) for key in ("kg", "m", "s", "A", "K", "mol", "cd", "rad"))
        ends.append((exponents, float(base.factor), float(base.offset)))
    (kinds, factor, offset), (others, by, plus) = ends
    if kinds != others:
        raise OtherQuantity
    return Conversion(scale=factor / by, offset=(offset - plus) / by)
