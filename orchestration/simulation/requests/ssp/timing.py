"""The file beside an SSP with the timing of a system, which SSP lacks."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fmu_kit.new_files import write_atomically
from orchestration.foundation.basics.documents import toml_of
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.systems.system.file_tables import tables_of
from orchestration.systems.system.files import input_files
from orchestration.systems.system.model import System

ENDING = ".timing.toml"
RESOURCES = "resources/"
"""The folder of an SSP with its files"""
ANNOTATION = "quadcosim.timing"
"""The type of the annotation of an SSP with the same content"""


def write(system: System, ssp: Path) -> Path:
    """Write the file beside an SSP with which it loads as `system`; return its path."""
    path = ssp.with_suffix(ENDING)
    write_atomically(path, as_text(system, ssp=ssp.name))
    return path


def as_text(system: System, **before: str) -> str:
    """The text of such a file, with other keys first."""
    import tomli_w

    packed = {str(path.absolute()): place for place, path in files_of(system).items()}
    return tomli_w.dumps(with_files({**before, **_timing_tables(system)}, packed.get))


def files_of(system: System) -> dict[str, Path]:
    """The files that an SSP has for its timing, tables and traces, by their place in it.

    Raises `UsageError` for different ones of one name.
    """
    found: dict[str, Path] = {}
    for path in input_files(system).values():
        other = found.setdefault(f"{RESOURCES}{path.name}", path)
        if other.absolute() != path.absolute():
            raise UsageError(f"{other} and {path}: expected files of different names")
    return found


def with_files(tables: Any, place: Callable[[str], str | None]) -> Any:
    """The tables with each `file` at another place, if it has one."""
    if isinstance(tables, list):
        return [with_files(each, place) for each in tables]
    if not isinstance(tables, Mapping):
        return tables
    return {
        key: (place(value) or value) if key == "file" and isinstance(value, str) else with_files(value, place)
        for key, value in tables.items()
    }


def from_text(text: str) -> dict[str, Any]:
    """The tables of the annotation of an SSP; raises `UsageError` if it is no TOML."""
    return toml_of(text, f"annotation {ANNOTATION}")


def _timing_tables(system: System) -> dict[str, Any]:
    """The tables of a system without what an SSP has: FMUs, their parameters, and conversions of connections."""
    tables = tables_of(system)
    in_ssp = {"components": ("fmu", "parameters"), "connections": ("scale", "offset")}
    for name, members in (("components", tables["components"].values()), ("connections", tables["connections"])):
        for table in members:
            for key in in_ssp[name]:
                table.pop(key, None)
    return {key: value for key, value in tables.items() if value not in ({}, [])}


def expect_tables(timing: Mapping[str, Any]) -> None:
    """Raise `UsageError` for a document whose tables have the wrong shape."""
    for kind in ("components", "sources", "computers"):
        for name, table in _expect(dict, kind, timing.get(kind, {})).items():
            _expect(dict, f"{kind}.{name}", table)
            for key in ("parameters",) if kind == "components" else ():
                _expect(dict, f"{kind}.{name}.{key}", table.get(key, {}))
    for index, table in enumerate(_expect(list, "connections", timing.get("connections", []))):
        _expect(dict, f"connections.{index}", table)
        _expect(str, f"connections.{index}.name", table.get("name", ""))
        for key in ("from", "to"):
            for end in (
                [table[key]]
                if isinstance(table.get(key), str)
                else _expect(list, f"connections.{index}.{key}", table.get(key, []))
            ):
                _expect(str, f"connections.{index}.{key}", end)


_WORDS = {dict: "a table", list: "a list", str: "a text"}


def _expect(kind: Any, place: str, value: Any) -> Any:
    if not isinstance(value, kind):
        raise UsageError(f"{place} = {shown(value)}: expected {_WORDS[kind]}")
    return value
