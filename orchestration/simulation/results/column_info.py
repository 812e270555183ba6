"""Unit and description of the columns of a run, as its FMUs declare them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from orchestration.components.fmi.model import Model
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System


@dataclass(frozen=True, kw_only=True)
class ColumnInfo:
    """Unit and description of one column."""

    unit: str | None = None
    """Unit as FMI writes it, N.m for instance"""
    text: str | None = None
    """the FMU's description"""

    def as_metadata(self) -> dict[str, str]:
        """Those that exist, by `unit` and `description`, as in the metadata of a Parquet column."""
        named = {"unit": self.unit, "description": self.text}
        return {name: text for name, text in named.items() if text}


def column_infos(system: System, models: Mapping[str, Model], columns: Iterable[str]) -> dict[str, ColumnInfo]:
    """By column; a source has those of the input that it feeds, a trajectory is a position in metres."""
    fed = {
        signal: end
        for name, source in system.sources.items()
        if source.to
        for signal, end in zip(source.signals(name), source.to, strict=True)
    }
    infos = {"time": ColumnInfo(unit="s", text="time")}
    for column in columns:
        if column in fed:
            infos[column] = _of(models, fed[column])
        elif component_of(column) in models:
            infos[column] = _of(models, column)
        elif column != "time":
            infos[column] = ColumnInfo(unit="m", text="desired position")
    return infos


def _of(models: Mapping[str, Model], signal: str) -> ColumnInfo:
    variable = models[component_of(signal)].variables.get(variable_of(signal))
    return ColumnInfo() if variable is None else ColumnInfo(unit=variable.unit, text=variable.description)
