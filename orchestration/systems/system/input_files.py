"""The files that a system reads beside its FMUs: tables of sources, traces of distributions."""

from collections.abc import Iterator
from pathlib import Path

from orchestration.systems.system.distribution import Distribution, distributions
from orchestration.systems.system.model import System
from orchestration.systems.system.placement import SHARED


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
