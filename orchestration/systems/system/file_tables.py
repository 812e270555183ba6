"""A system as the tables of its file."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestration.components.building.models import PATHS
from orchestration.systems.system.component import OWN_PERIOD, OwnPeriod


def tables_of(system: Any) -> dict[str, Any]:
    """The tables of the file that loads as `system`, in any folder, without defaults."""
    tables: dict[str, Any] = {"stop_time": system.stop_time, "seed": system.seed, "optional": list(system.optional)}
    tables["components"] = {
        name: _without_defaults(component, keep=("fmu",)) for name, component in system.components.items()
    }
    for component, table in zip(system.components.values(), tables["components"].values()):
        if hasattr(component.sampling, "task"):
            del table["sampling"]  # which follows from the task
        if hasattr(component.sampling, "on"):
            del table["sampling"]["period"]
        if table["fmu"].endswith(PATHS):
            table["fmu"] = str(Path(table["fmu"]).absolute())
    tables["connections"] = [_connection_table(x) for x in system.connections]
    tables["sources"] = {name: _without_defaults(source) for name, source in system.sources.items()}
    tables["computers"] = {name: _with_parts(each, "tasks") for name, each in system.computers.items()}
    tables["networks"] = {name: _with_parts(each, "messages") for name, each in system.networks.items()}
    for key in ("objectives", "streams", "operating_point"):
        tables[key] = dict(getattr(system, key))
    tables["criterion"] = _without_defaults(system.criterion)
    return tables


def _connection_table(x: Any) -> dict[str, Any]:
    keys = _without_defaults(x, keep=("name", "scale") if x.stated else ("name",))
    keys.pop("stated", None)
    return {"name": keys.pop("name"), "from": keys.pop("start"), "to": keys.pop("end"), **keys}


def _with_parts(of: Any, key: str) -> dict[str, Any]:
    """A computer with its tasks, or a network with its messages."""
    parts = {name: _without_defaults(part) for name, part in getattr(of, key).items()}
    for part in parts.values():
        part.update({key: part.pop(name) for name, key in (("start", "from"), ("end", "to")) if name in part})
    return _without_defaults(of) | {key: parts}


def _without_defaults(of: Any, keep: tuple[str, ...] = ()) -> dict[str, Any]:
    result = {}
    for field in dataclasses.fields(of):
        value = getattr(of, field.name)
        if field.name in keep or (value is not None and value != field.default and value != {}):
            result[field.name] = in_toml(value)
    return result


def in_toml(value: Any) -> Any:
    """A value for TOML: a distribution as its table, paths absolute."""
    if dataclasses.is_dataclass(value):
        return _without_defaults(value)
    if isinstance(value, Path):
        return str(value.absolute())
    if isinstance(value, tuple):
        return list(value)
    if isinstance(value, Mapping):
        return {key: OWN_PERIOD if isinstance(one, OwnPeriod) else one for key, one in value.items()}
    return value
