"""The files that a system reads beside its FMUs: tables of sources, traces of distributions."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import SHARED

Of = TypeVar("Of")


def input_files(system: System) -> dict[str, Path]:
    """The files, by the name of their source or the place of their distribution."""
    found = {name: source.file for name, source in system.sources.items() if source.file is not None}
    return found | {place: each.file for place, each in distributions_in(system) if each.file is not None}


def distributions_in(system: System) -> Iterator[tuple[str, Distribution]]:
    """All distributions and traces of a system, each with its place."""
    components = ((f"components.{name}", component) for name, component in system.components.items())
    connections = ((f"connections.{x.name}", x) for x in system.connections)
    shared = ((f"{table}.{name}", one) for table in SHARED for name, one in getattr(system, table).items())
    for place, part in (*components, *connections, *shared):
        yield from ((f"{place}.{path}", each) for path, each in distributions(part))


def distributions(of: Any) -> Iterator[tuple[str, Distribution]]:
    """The distributions in a part of a system, each with its path from there."""
    for field in fields(of):
        value = getattr(of, field.name)
        if isinstance(value, Distribution):
            yield field.name, value
        for name, part in _parts(field.name, value):
            yield from ((f"{name}.{path}", each) for path, each in distributions(part))


def with_traces_at(of: Of, paths: Mapping[str, Path]) -> Of:
    """A part of a system with its trace files at other paths; `paths` are by the present ones."""
    changes: dict[str, Any] = {}
    for field in fields(of):  # type: ignore[arg-type]
        value = getattr(of, field.name)
        if isinstance(value, Distribution):
            if value.file is not None:
                changes[field.name] = replace(value, file=paths[str(value.file)])
        elif is_dataclass(value):
            changes[field.name] = with_traces_at(value, paths)
        elif isinstance(value, Mapping) and any(map(is_dataclass, value.values())):
            changes[field.name] = {name: with_traces_at(part, paths) for name, part in value.items()}
    return replace(of, **changes) if changes else of  # type: ignore[type-var]


def _parts(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """The records in a value that may contain distributions, each with its path."""
    if isinstance(value, Mapping):
        yield from ((f"{name}.{key}", part) for key, part in value.items() if is_dataclass(part))
    elif is_dataclass(value) and not isinstance(value, Distribution):
        yield name, value
