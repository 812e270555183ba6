"""An FMI variable: all descriptions of a slave are derived from a list of them."""

import enum
import math
from dataclasses import dataclass, replace
from typing import Literal

from fmu_kit.errors import FmuError, require
from fmu_kit.units import DISPLAYED, QUANTITIES

Causality = Literal["input", "output", "parameter", "local"]
Variability = Literal["continuous", "discrete", "fixed", "tunable", "constant"]
Type = Literal["Real", "Integer", "Boolean", "Enumeration"]
INDEX = "_index"
"""The suffix by which the Integer of an Enumeration is named"""


@dataclass(frozen=True, kw_only=True, slots=True)
class Variable:
    """One scalar variable of FMI 2.0; its value reference is its position in the slave's list.

    The type of `start` is the type of the variable; a member of an `IntEnum` makes an Enumeration of the members, named
    in lower case, for a parameter only. `minimum` and `maximum` are inclusive, `above` is an exclusive lower bound;
    these are checked for parameters when initialisation ends. `nominal` is a typical size, `named_quantity` the
    quantity where it does not follow from the unit. Inputs and outputs of one `terminal` are connected together.
    """

    name: str
    description: str
    causality: Causality
    variability: Variability
    unit: str | None = None
    start: float | int | bool = 0.0
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    nominal: float | None = None
    named_quantity: str | None = None
    terminal: str | None = None

    def __post_init__(self) -> None:
        """Raise `TypeError` for an Enumeration that is not a parameter, or whose items are not numbered from 1."""
        is_parameter = self.causality == "parameter" or self.variability == "constant"
        if self.items and not (is_parameter and [*self.items.values()] == [*range(1, len(self.items) + 1)]):
            raise TypeError(f"{self.name}: expected an Enumeration to be a parameter, its items 1, 2, …")

    @property
    def type(self) -> Type:
        """The FMI type."""
        if isinstance(self.start, bool):
            return "Boolean"
        if isinstance(self.start, enum.IntEnum):
            return "Enumeration"
        return "Integer" if isinstance(self.start, int) else "Real"

    @property
    def items(self) -> dict[str, int]:
        """The values of an Enumeration by name, in order; empty for other types."""
        return (
            {item.name.lower(): int(item) for item in type(self.start)} if isinstance(self.start, enum.IntEnum) else {}
        )

    @property
    def declared_type(self) -> str | None:
        """The name of an Enumeration's type; None for other types."""
        return type(self.start).__name__ if self.items else None

    @property
    def quantity(self) -> str | None:
        """The quantity, as named or as follows from the unit; None if unknown."""
        return self.named_quantity or QUANTITIES.get(self.unit or "")

    @property
    def displayed_in(self) -> str | None:
        """The display unit; None where it is the unit itself, as for a variable with a named quantity."""
        return DISPLAYED[self.unit][0] if self.unit in DISPLAYED and self.named_quantity is None else None

    @property
    def is_settable(self) -> bool:
        """Whether the value is set from outside."""
        return self.causality in ("input", "parameter")

    @property
    def has_start(self) -> bool:
        """Whether the value is known before anything is computed (`initial` exact)."""
        return self.is_settable or self.variability == "constant"

    def fixed_at(self, value: float | int | bool | str) -> "Variable":
        """The parameter as a constant; raises `FmuError` if it is not a parameter or the value is not allowed."""
        require(self.causality == "parameter", self.name, f"a variable with causality {self.causality}", "a parameter")
        known: float | int | bool | str = self.items.get(value, value) if isinstance(value, str) else value
        if isinstance(known, str) or isinstance(known, bool) != (self.type == "Boolean"):
            raise FmuError(
                f"{self.name} = {value}: expected {'true or false' if self.type == 'Boolean' else self.bounds}"
            )
        if self.type != "Boolean":
            require(self.type == "Real" or known == int(known), self.name, value, self.bounds)
            self.check(known)
        return replace(self, causality="local", variability="constant", start=type(self.start)(known))

    @property
    def bounds(self) -> str:
        """The allowed values, in words."""
        if self.items:
            *others, last = (f"{value} ({name})" for name, value in self.items.items())
            return f"{', '.join(others)} or {last}" if others else last
        parts = []
        if self.above is not None:
            parts.append(f"> {self.above:g}")
        if self.minimum is not None:
            parts.append(f">= {self.minimum:g}")
        if self.maximum is not None:
            parts.append(f"<= {self.maximum:g}")
        kind = "a finite value" if self.type == "Real" else "a whole number"
        return kind + (" " + " and ".join(parts) if parts else "")

    def check(self, value: float) -> None:
        """Raise `FmuError` if `value` is not finite, out of bounds or no item of an Enumeration."""
        if self.items:
            require(1 <= value <= len(self.items), self.name, value, self.bounds)
            return
        inside = (
            math.isfinite(value)
            and (self.above is None or value > self.above)
            and (self.minimum is None or value >= self.minimum)
            and (self.maximum is None or value <= self.maximum)
        )
        require(inside, self.name, value, self.bounds)
