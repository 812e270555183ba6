"""Distributions in files, flags and axes: a table of TOML in place of a number."""

import dataclasses
import functools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeGuard

from orchestration.foundation.basics.documents import toml_of
from orchestration.foundation.basics.errors import at_place
from orchestration.foundation.basics.typed_tables import parsed, table_of
from orchestration.systems.system.distribution import Distribution, Varying

DistributionTable = table_of(Distribution, file=(str | None, None))
"""The path of a trace is text, as written"""


def with_distributions(place: str, table: Any, folder: Path) -> dict[str, Any]:
    """The keys of a table of a file, with distributions in place of their tables; `place` ends with its dot."""
    keys: dict[str, Any] = table.model_dump()
    for key in keys:
        value = getattr(table, key)
        if isinstance(value, DistributionTable):
            keys[key] = _distribution(f"{place}{key}", value, folder)
    return keys


def parsed_fields(of: Any, place: str, keys: Mapping[str, Any]) -> dict[str, Any]:
    """New values of fields of a record, with distributions in place of their tables, or of the text of these.

    Relative paths of traces start at the current folder. Raises `UsageError` for an invalid table.
    """
    kind: type = type(of)
    varying = may_vary(kind)
    return {key: _parsed_field(f"{place}{key}", value) if key in varying else value for key, value in keys.items()}


@functools.cache
def may_vary(kind: type) -> frozenset[str]:
    """The fields of a record that are a number or a distribution."""
    return frozenset(field.name for field in dataclasses.fields(kind) if field.type == Varying)


def is_table(value: object) -> TypeGuard[str]:
    """Whether a value is the text of a table."""
    return isinstance(value, str) and value.lstrip().startswith("{")


def as_text(table: Mapping[str, Any], folder: Path) -> str:
    """The text of a table of a file, its trace by a path from the current folder."""
    keys = {**table, "file": str(folder / str(table["file"]))} if "file" in table else table
    return f"{{{', '.join(f'{key} = {json.dumps(value, default=str)}' for key, value in keys.items())}}}"


def trace_path(value: str) -> str | None:
    """The path of the trace in the text of a table; None without one."""
    file = toml_of(f"value = {value}", value)["value"].get("file")
    return None if file is None else str(Path(file))


def _parsed_field(place: str, value: Any) -> Any:
    if is_table(value):
        value = toml_of(f"value = {value}", f"{place} = {value}")["value"]
    return _distribution(place, _parsed(place, value), Path()) if isinstance(value, Mapping) else value


def _parsed(place: str, table: Mapping[str, Any]) -> Any:
    with at_place(place):
        return parsed(table, DistributionTable)


def _distribution(place: str, table: Any, folder: Path) -> Distribution:
    keys = table.model_dump() | {"file": None if table.file is None else folder / table.file}
    with at_place(place):
        return Distribution(**keys)
