"""What the FMUs of a run say of its columns: unit and description, for whoever draws or writes them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from orchestration.fmi.model import Model
from orchestration.system.model import System
from orchestration.system.variable_names import component_of, variable_of


@dataclass(frozen=True, kw_only=True)
class Described:
    """One column."""

    unit: str | None = None
    """as FMI writes it, N.m for instance"""
    text: str | None = None
    """the FMU's description"""

    def as_words(self) -> dict[str, str]:
        """What there is, by `unit` and `description`, as the fields of a Parquet file have it."""
        named = {"unit": self.unit, "description": self.text}
        return {name: text for name, text in named.items() if text}


def described(system: System, models: Mapping[str, Model], columns: Iterable[str]) -> dict[str, Described]:
    """By column; a source is described by what it feeds, a trajectory is a position in metres."""
    fed = {
        signal: end
        for name, source in system.sources.items()
        if source.to
        for signal, end in zip(source.signals(name), source.to, strict=True)
    }
    found = {"time": Described(unit="s", text="time")}
    for column in columns:
        if column in fed:
            found[column] = _of(models, fed[column])
        elif component_of(column) in models:
            found[column] = _of(models, column)
        elif column != "time":
            found[column] = Described(unit="m", text="desired position")
    return found


def _of(models: Mapping[str, Model], signal: str) -> Described:
    variable = models[component_of(signal)].variables.get(variable_of(signal))
    return Described() if variable is None else Described(unit=variable.unit, text=variable.description)
