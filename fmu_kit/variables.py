"""Declarations of FMI variables: a slave lists them, and everything else is derived from the list."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

from fmu_kit.errors import require

Causality = Literal["input", "output", "parameter", "local"]
Variability = Literal["continuous", "discrete", "fixed", "tunable"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Variable:
    """One scalar variable of FMI 2.0; its value reference is its place in the slave's list.

    The type of `start` is the type of the variable. `minimum` and `maximum` are inclusive, `above` is an
    exclusive lower bound; they are checked for parameters when initialisation ends.
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

    @property
    def type(self) -> Literal["Real", "Integer", "Boolean"]:
        """The FMI type."""
        if isinstance(self.start, bool):
            return "Boolean"
        return "Integer" if isinstance(self.start, int) else "Real"

    @property
    def has_start(self) -> bool:
        """Whether the value is given from outside (`initial` exact) and not calculated."""
        return self.causality in ("input", "parameter")

    @property
    def bounds(self) -> str:
        """The allowed values, in words."""
        parts = []
        if self.above is not None:
            parts.append(f"> {self.above:g}")
        if self.minimum is not None:
            parts.append(f">= {self.minimum:g}")
        if self.maximum is not None:
            parts.append(f"<= {self.maximum:g}")
        return "a finite value" + (" " + " and ".join(parts) if parts else "")

    def check(self, value: float) -> None:
        """Raise `FmuError` if `value` is not finite or out of bounds."""
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
