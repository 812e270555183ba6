"""The file beside an SSP with the timing of a system, which SSP lacks."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fmu_kit.new_files import write_atomically
from orchestration.foundation.basics.documents import toml_of
from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.systems.system.file_tables import tables_of
from orchestration.systems.system.model import System

ENDING = ".timing.toml"
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

    return tomli_w.dumps({**before, **_timing_tables(system)})


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
