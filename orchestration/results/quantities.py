"""A quantity as people read it, wherever it is drawn or printed: its name, its unit, and its values in that unit."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.basics.simulator import Floats
from orchestration.results import display_names as labels

LONG = 1.0
"""[s]: times that are all shorter are read in milliseconds"""


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What is varied or set, in words, and how its values are read."""

    name: str
    unit: str | None = None
    """in which values are read, as FMUs write it; None: they have none, or none is known"""
    factor: float = 1.0
    """on values as they are kept, which makes them values in that unit"""

    @property
    def title(self) -> str:
        """Its name with its unit in brackets, as axes and heads of tables have it."""
        return labels.with_unit(self.name, self.unit)

    def of(self, values: object) -> Floats:
        """Values as they are kept, in its unit; of the same shape."""
        found: Floats = self.factor * np.asarray(values, float)
        return found

    def said(self, value: float, digits: int = 6) -> str:
        """A value as it is kept, in its unit and with it."""
        return f"{self.factor * value:.{digits}g} {labels.unit(self.unit) or ''}".rstrip()


def quantity(name: str, unit: str | None, values: Iterable[Any]) -> Quantity:
    """A quantity that takes these values, kept in this `unit`: times that are all below a second in milliseconds."""
    sizes = [abs(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    if unit == "s" and sizes and max(sizes) < LONG:
        return Quantity(name=name, unit="ms", factor=1e3)
    return Quantity(name=name, unit=unit)


def setting(path: str, values: Iterable[Any], unit: str | None = None) -> Quantity:
    """What a path of a scenario, system or study file sets; the `unit` that a store has goes first."""
    return quantity(labels.setting(path), unit or unit_known(path), values)


def unit_known(path: str) -> str | None:
    """The unit of what a path sets, as far as its words say it."""
    return labels.unit_of_setting(path) or ("s" if is_in_seconds(path) else None)


def is_in_seconds(path: str) -> bool:
    """Whether what a path sets is a time [s] by itself; what a parameter is in, its FMU says."""
    table, _, rest = path.partition(".")
    is_parameter = ".parameters." in path or (table in ("controller", "plant") and bool(rest))
    is_of_values = table == "connections" and path.endswith(".offset")
    return not is_parameter and not is_of_values and path.rpartition(".")[2] in _SECONDS


_SECONDS = (
    *("period", "offset", "step", "plant_interval", "jitter", "delay", "delay_jitter", "stop_time"),
    *("execution", "deadline", "switch", "latency"),
)
