"""Computers and networks from files of tasks and messages."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.requests import can_database, task_table
from orchestration.systems.system.proposal import ProposedResources


def resources_of(arguments: Sequence[str]) -> tuple[ProposedResources, list[str]]:
    """The computers and networks of the files that have them, and the other arguments.

    Raises `UsageError` for a file that cannot be read, and where two have the same computer or network.
    """
    tables: dict[str, dict[str, Any]] = {}
    guessed: list[str] = []
    undecided: list[str] = []
    others = []
    for text in arguments:
        path = Path(text)
        if path.suffix.lower() == ".csv":
            _add(tables, "computers", path, task_table.computers_of(path))
        elif path.suffix.lower() in can_database.ENDINGS:
            bus = can_database.bus_of(path)
            _add(tables, "networks", path, bus.networks)
            guessed += bus.guessed
            undecided += bus.undecided
        else:
            others.append(text)
    return ProposedResources(tables=tables, guessed=tuple(guessed), undecided=tuple(undecided)), others


def _add(tables: dict[str, dict[str, Any]], table: str, path: Path, more: dict[str, Any]) -> None:
    for name in more:
        if name in tables.get(table, {}):
            raise UsageError(f"{path}: {table}.{name}: is in a file before it already; expected another name")
    tables.setdefault(table, {}).update(more)
