"""Quantities for display: their names, units, and values in these units."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import PREFIXES
from orchestration.simulation.results import display_names as labels
from orchestration.systems.system.requirements import is_number


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """A metric or a setting: its display name, and the unit in which its values are shown."""

    name: str
    unit: str | None = None
    """Unit in which values are shown, as FMI writes it; None: they have none, or it is unknown"""
    factor: float = 1.0
    """Factor by which stored values are multiplied to have that unit"""

    @property
    def title(self) -> str:
        """Its name with its unit in brackets, as on axes and in heads of tables."""
        return labels.with_unit(self.name, self.unit)

    def of(self, values: object) -> Floats:
        """Stored values in its unit; of the same shape."""
        return self.factor * np.asarray(values, float)

    def text_of(self, value: float, digits: int = 6) -> str:
        """A stored value as text, in its unit and with it, rounded as it is stored: to the digits of other texts."""
        return f"{self.factor * float(f'{value:.{digits}g}'):.{digits}g} {labels.unit(self.unit) or ''}".rstrip()


def quantity(name: str, unit: str | None, values: Iterable[Any]) -> Quantity:
    """A quantity with these values in `unit`; times have the prefix of the largest, as milliseconds below a second."""
    sizes = [abs(value) for value in values if is_number(value)]
    if unit != "s" or not sizes:
        return Quantity(name=name, unit=unit)
    prefix, size = next((pair for pair in PREFIXES if max(sizes) >= pair[1]), PREFIXES[-1 if max(sizes) else 1])
    return Quantity(name=name, unit=f"{prefix}s", factor=float(round(1.0 / size)))


def setting(path: str, values: Iterable[Any], unit: str | None = None) -> Quantity:
    """The quantity of a path of a scenario, system or study file; the `unit` of a store takes precedence."""
    return quantity(labels.setting(path), unit or unit_known(path), values)


def unit_known(path: str) -> str | None:
    """The unit of a path, as far as its words determine it."""
    return labels.unit_of_setting(path) or ("s" if is_in_seconds(path) else None)


def is_in_seconds(path: str) -> bool:
    """Whether a path sets a time [s]; the unit of a parameter is declared by its FMU."""
    table, _, rest = path.partition(".")
    is_parameter = ".parameters." in path or (table in ("controller", "plant") and bool(rest))
    is_of_values = table == "connections" and path.endswith(".offset")
    return not is_parameter and not is_of_values and path.rpartition(".")[2] in _SECONDS


_SECONDS = (
    *("period", "offset", "step", "plant_interval", "jitter", "delay", "delay_jitter", "stop_time"),
    *("execution", "deadline", "switch", "latency"),
)
