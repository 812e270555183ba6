"""How files, flags and axes write what is drawn: a table of TOML where a number could be."""

import dataclasses
import functools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeGuard

from orchestration.basics.documents import toml_of
from orchestration.basics.errors import at_place
from orchestration.basics.typed_tables import parsed, table_of
from orchestration.system.distribution import Distribution, Varying

DistributionTable = table_of(Distribution, file=(str | None, None))
"""With the path of a trace as it is written"""


def with_distributions(place: str, table: Any, folder: Path) -> dict[str, Any]:
    """The keys of a table of a file, those that are drawn as what they are drawn from; `place` ends with its dot."""
    keys: dict[str, Any] = table.model_dump()
    for key in keys:
        drawn = getattr(table, key)
        if isinstance(drawn, DistributionTable):
            keys[key] = _made(f"{place}{key}", drawn, folder)
    return keys


def parsed_fields(of: Any, place: str, keys: Mapping[str, Any]) -> dict[str, Any]:
    """New values of fields of a record, those that are drawn from the table, or the text of one, as that says.

    Relative paths of traces start at the current folder. Raises `UsageError` for a table that cannot be.
    """
    kind: type = type(of)
    varying = may_vary(kind)
    return {key: _meant(f"{place}{key}", value) if key in varying else value for key, value in keys.items()}


@functools.cache
def may_vary(kind: type) -> frozenset[str]:
    """The fields of a record that are a number, or how it is distributed."""
    return frozenset(field.name for field in dataclasses.fields(kind) if field.type == Varying)


def is_table(value: object) -> TypeGuard[str]:
    """Whether it is the text of a table."""
    return isinstance(value, str) and value.lstrip().startswith("{")


def as_text(table: Mapping[str, Any], folder: Path) -> str:
    """The text of a table of a file, its trace by a path from the current folder."""
    told = {**table, "file": str(folder / str(table["file"]))} if "file" in table else table
    return f"{{{', '.join(f'{key} = {json.dumps(value, default=str)}' for key, value in told.items())}}}"


def trace_path(value: str) -> str | None:
    """What a table that is given as text calls the file of its trace; None for one without, or that is none."""
    file = toml_of(f"value = {value}", value)["value"].get("file")
    return None if file is None else str(Path(file))


def _meant(place: str, value: Any) -> Any:
    if is_table(value):
        value = toml_of(f"value = {value}", f"{place} = {value}")["value"]
    return _made(place, _parsed(place, value), Path()) if isinstance(value, Mapping) else value


def _parsed(place: str, table: Mapping[str, Any]) -> Any:
    with at_place(place):
        return parsed(table, DistributionTable)


def _made(place: str, table: Any, folder: Path) -> Distribution:
    keys = table.model_dump() | {"file": None if table.file is None else folder / table.file}
    with at_place(place):
        return Distribution(**keys)
