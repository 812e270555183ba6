"""The files of systems and studies: FMUs and tables of sources, read once, so that what is hashed is what is run."""

import hashlib
import logging
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from orchestration.components.building import fmus
from orchestration.components.fmi.read_description import Model, read_model
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.records import replaced
from orchestration.systems.system.component import Component
from orchestration.systems.system.computers import Computer, Network
from orchestration.systems.system.connection import Connection, Source
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import SHARED

_NOTES = logging.getLogger("quadcosim")


@dataclass(frozen=True, kw_only=True)
class Files:
    """Files by the names that systems have for them."""

    fmus: Mapping[str, Path]
    tables: Mapping[str, Path]

    @cached_property
    def contents(self) -> dict[str, bytes]:
        """All files; raises `QuadcosimError` for one that cannot be read."""
        try:
            return {name: path.read_bytes() for name, path in {**self.fmus, **self.tables}.items()}
        except OSError as error:
            raise QuadcosimError(f"{error.filename}: expected a file that can be read: {error.strerror}") from error

    @cached_property
    def hashes(self) -> dict[str, str]:
        """The hash of each file."""
        return {name: hashlib.sha256(content).hexdigest() for name, content in self.contents.items()}

    @cached_property
    def models(self) -> dict[str, Model]:
        """The model of each FMU; raises `UsageError` for a file that is none."""
        assert self.contents is not None
        return {name: read_model(path) for name, path in self.fmus.items()}

    @cached_property
    def start_values(self) -> dict[str, dict[str, float]]:
        """The start values of all Real variables, by FMU and name."""
        return {
            name: {v.name: float(v.start) for v in model.variables.values() if v.kind == "Real" and v.start is not None}
            for name, model in self.models.items()
        }

    def models_of(self, system: System) -> dict[str, Model]:
        """The models of the components of a system."""
        return {name: self.models[component.fmu] for name, component in system.components.items()}

    def start_values_of(self, system: System) -> dict[str, float]:
        """The start values of all Real parameters, as COMPONENT.NAME."""
        return {
            f"{name}.{variable.name}": float(variable.start)
            for name, model in self.models_of(system).items()
            for variable in model.variables.values()
            if variable.kind == "Real" and variable.causality == "parameter" and variable.start is not None
        }


def files_of(system: System, fmus_too: Iterable[str] = (), tables_too: Iterable[str] = ()) -> Files:
    """The files of a system, FMUs built if need be; raises `UsageError` for an FMU that does not exist."""
    of_components = {system.fmus[name]: path for name, path in fmus.of_components(system.fmus).items()}
    tables = {**files_read_by(system), **{name: Path(name) for name in tables_too}}
    return Files(fmus=of_components | {name: fmus.locate(name) for name in fmus_too}, tables=tables)


def located(system: System) -> System:
    """The system with the paths of its FMUs: native twins where they can be built, else those that it names."""
    try:
        twins = fmus.native_twins(system)
        paths = fmus.of_components(twins.fmus)
    except QuadcosimError as error:
        _NOTES.debug("no native twins: %s", error)
        paths = fmus.of_components(system.fmus)
    components = {name: replaced(each, fmu=str(paths[name])) for name, each in system.components.items()}
    return replaced(system, components=components)


def files_read_by(system: System) -> dict[str, Path]:
    """The files that a system reads beside its FMUs, by its names for them."""
    return {str(file): file for file in input_files(system).values()}


def with_files(system: System, paths: Mapping[str, Path]) -> System:
    """`system` with its files at these paths, by its names for them, so that none is searched for."""
    return next(iter(all_with_files([system], paths)))


def all_with_files(systems: Iterable[System], paths: Mapping[str, Path]) -> list[System]:
    """Systems with their files at these paths; parts that they share stay shared."""
    located: dict[int, Any] = {}
    return [
        replaced(
            system,
            components={name: _at(each, paths, located) for name, each in system.components.items()},
            connections=tuple(_at(each, paths, located) for each in system.connections),
            sources={name: _at(each, paths, located) for name, each in system.sources.items()},
            computers={name: _at(each, paths, located) for name, each in system.computers.items()},
            networks={name: _at(each, paths, located) for name, each in system.networks.items()},
        )
        for system in systems
    ]


Part = TypeVar("Part", Component, Connection, Source, Computer, Network)


def _at(part: Part, paths: Mapping[str, Path], located: dict[int, Any]) -> Part:
    if id(part) not in located:
        fields: dict[str, Any] = {}
        if isinstance(part, Component):
            fields["fmu"] = str(paths[part.fmu])
        elif isinstance(part, Source) and part.file is not None:
            fields["file"] = paths[str(part.file)]
        moved = with_traces_at(part, paths)
        located[id(part)] = replaced(moved, **fields) if fields else moved
    result: Part = located[id(part)]
    return result


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
