"""Declarations of FMI variables: a slave lists them, and everything else is derived from the list."""

import enum
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

from fmu_kit.errors import require

Causality = Literal["input", "output", "parameter", "local"]
Variability = Literal["continuous", "discrete", "fixed", "tunable"]
Type = Literal["Real", "Integer", "Boolean", "Enumeration"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Variable:
    """One scalar variable of FMI 2.0; its value reference is its place in the slave's list.

    The type of `start` is the type of the variable; one that is a member of an `IntEnum` makes an Enumeration of the
    members, named in lower case, for a parameter only. `minimum` and `maximum` are inclusive, `above` is an exclusive
    lower bound; they are checked for parameters when initialisation ends.
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

    def __post_init__(self) -> None:
        """Raise `TypeError` for a start that no variable has, and an Enumeration whose range would not be checked."""
        if not isinstance(self.start, float | int):
            raise TypeError(f"{self.name}: start = {self.start!r}: expected a number or a truth value")
        if self.items and (self.causality != "parameter" or [*self.items.values()] != [*range(1, len(self.items) + 1)]):
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
        """Of an Enumeration, its values by name, in their order; nothing for other types."""
        return (
            {item.name.lower(): int(item) for item in type(self.start)} if isinstance(self.start, enum.IntEnum) else {}
        )

    @property
    def declared_type(self) -> str | None:
        """The name of the type that an Enumeration is of; None for other types."""
        return type(self.start).__name__ if self.items else None

    @property
    def has_start(self) -> bool:
        """Whether the value is given from outside (`initial` exact) and not calculated."""
        return self.causality in ("input", "parameter")

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


class _Kind(Protocol):
    def __call__(
        self, name: str, description: str, unit: str | None, start: float | int | bool = 0.0, **bounds: float
    ) -> Variable: ...


def _kind(causality: Causality, variability: Variability) -> _Kind:
    def declare(
        name: str, description: str, unit: str | None, start: float | int | bool = 0.0, **bounds: float
    ) -> Variable:
        return Variable(
            name=name,
            description=description,
            causality=causality,
            variability=variability,
            unit=unit,
            start=start,
            **bounds,
        )

    return declare


continuous_input = _kind("input", "continuous")
discrete_input = _kind("input", "discrete")
continuous_output = _kind("output", "continuous")
discrete_output = _kind("output", "discrete")
continuous_local = _kind("local", "continuous")
discrete_local = _kind("local", "discrete")
fixed_parameter = _kind("parameter", "fixed")
tunable_parameter = _kind("parameter", "tunable")


def vector(
    template: Variable, axes: Sequence[str] = ("x", "y", "z"), start: Iterable[float] | None = None
) -> list[Variable]:
    """`template` once for each axis, as `name.axis`, with the starts given or else that of the template."""
    starts = [template.start] * len(axes) if start is None else list(start)
    return [
        replace(template, name=f"{template.name}.{axis}", start=value) for axis, value in zip(axes, starts, strict=True)
    ]


QUATERNION_AXES = ("x", "y", "z", "w")
INERTIA_AXES = ("xx", "yy", "zz", "xy", "xz", "yz")
