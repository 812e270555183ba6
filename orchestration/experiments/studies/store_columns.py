"""The tables and columns of a study's store, and whether a file has them."""

import hashlib
import json
import marshal
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.simulation.results.objectives import FIXED
from orchestration.simulation.workers.row import TEXT

TEXTS = (TEXT,)
"""Metrics that are texts; all others are numbers"""
MAX_OBJECTIVES = 1000
"""Largest number of columns, a limit of SQLite"""

RUN = ("key", "status", "message", "seed", "duration", "machine", "engine")
"""Columns of a run besides its metrics"""
SETTINGS = "settings"
"""Column with the value of each axis, as JSON"""
DESIGN_WIDTH = 4
"""Number of columns of the design table"""
_RESERVED = ("design_index", *RUN, "checksum", SETTINGS)
_ORIGINS = ("guid.", "version.")
OBJECTIVES = "objectives"
"""Name of the entry of `about` that lists the objectives, written when the store is created"""
UNITS = "units"
"""Name of the entry of `about` with the units of metrics"""
GUIDS = "guids"
"""Name of the entry of `about` with the GUIDs of FMUs"""
ABOUT = "CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL, checksum TEXT NOT NULL)"


def tables_for(objectives: Iterable[str]) -> dict[str, str]:
    """The SQL statements that create the tables, by table.

    Runs are identified by what determines them, so that rows remain valid when the design changes.
    """
    typed = ", ".join(f"{_quoted(name)} {'TEXT' if name in TEXTS else 'REAL'}" for name in metrics_with(objectives))
    return {
        "about": ABOUT,
        "design": "CREATE TABLE design (design_index INTEGER PRIMARY KEY, key TEXT NOT NULL, settings TEXT NOT NULL, "
        "checksum TEXT NOT NULL)",
        "runs": "CREATE TABLE runs (key TEXT PRIMARY KEY, status TEXT NOT NULL, message TEXT, seed INTEGER NOT NULL, "
        f"duration REAL, machine TEXT, engine TEXT, {typed}, checksum TEXT NOT NULL)",
    }


def _quoted(name: str) -> str:
    doubled = name.replace('"', '""')
    return f'"{doubled}"'


def metrics_with(objectives: Iterable[str]) -> tuple[str, ...]:
    """The metrics of a row, in their order."""
    return (*FIXED[:3], *objectives, *FIXED[3:])


def is_column(name: str, objectives: Iterable[str]) -> bool:
    """Whether the table of runs has a column of this name besides those of the axes."""
    return name in (*_RESERVED, *metrics_with(objectives)) or name.startswith(_ORIGINS)


def expect_columns(objectives: Iterable[str]) -> None:
    """Raise `UsageError` for objectives that are invalid as columns; SQLite ignores case."""
    taken = [*_RESERVED, *FIXED]
    for name in objectives:
        lower = name.lower()
        if not name or "\0" in name or lower in map(str.lower, taken) or lower.startswith(_ORIGINS):
            raise UsageError(f"objectives.{name}: the table of runs has a column of that name, expected another")
        taken.append(name)
    if len(taken) > MAX_OBJECTIVES:
        raise UsageError(f"objectives: {len(taken)} columns, expected at most {MAX_OBJECTIVES}")


_REMEDY = "expected it as it was written: put back a copy, or remove it"


def checksum(row: tuple[Any, ...]) -> str:
    """The checksum of a row's values as SQLite returns them.

    Version 2 of marshal writes exactly values and types, with every bit of a float, in a fifth of the time of `repr`;
    it has not changed since Python 2.5. Later versions depend on the identity of texts too.
    """
    return hashlib.sha256(marshal.dumps(row, 2)).hexdigest()[:16]


def expect_written(path: Path, table: str, rows: Iterable[tuple[Any, ...]]) -> None:
    """Raise `QuadcosimError` unless the last value of every row of a table is the checksum of the others."""
    for row in rows:
        if checksum(row[:-1]) != row[-1]:
            raise QuadcosimError(f"{path}: the store is damaged ({table}: {str(row[0])[:16]!r}); {_REMEDY}")


def expect_sound(path: Path, connection: sqlite3.Connection) -> list[str]:
    """The objectives of a store; raises `QuadcosimError` unless the file is a sound store of this version."""
    schema, objectives = schema_of(connection), objectives_of(connection)
    if not schema:
        raise QuadcosimError(f"{path}: expected the store of a study; nothing has been written into it yet")
    if objectives is None or schema != tables_for(objectives):
        raise QuadcosimError(
            f"{path}: no store of this version of quadcosim; expected one: take another folder, --out, or remove it"
        )
    expect_no_damage(path, connection)
    expect_written(path, "about", connection.execute("SELECT * FROM about"))
    return objectives


def expect_no_damage(path: Path, connection: sqlite3.Connection) -> None:
    """Raise `QuadcosimError` unless SQLite finds the file sound."""
    report = connection.execute("PRAGMA integrity_check(1)").fetchone()[0]
    if report != "ok":
        raise QuadcosimError(f"{path}: the store is damaged ({' '.join(report.split())}); {_REMEDY}")


def schema_of(connection: sqlite3.Connection) -> dict[str, str]:
    """The SQL statement of each table and index in a database."""
    return dict(connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL"))


def objectives_of(connection: sqlite3.Connection) -> list[str] | None:
    """The objectives that a store lists; None if the file has no valid list."""
    if schema_of(connection).get("about") != ABOUT:
        return None
    row = connection.execute("SELECT value FROM about WHERE name = ?", (OBJECTIVES,)).fetchone()
    try:
        names = json.loads(row[0]) if row else None
    except (TypeError, ValueError):
        return None
    return names if isinstance(names, list) and all(isinstance(name, str) for name in names) else None


def error_text(error: Exception) -> str:
    """The text of an error of SQLite, which may quote damaged bytes."""
    return "".join(letter if letter.isprintable() else "?" for letter in str(error))


@contextmanager
def store_errors(path: Path) -> Iterator[None]:
    """Turn errors of SQLite and the file system into one-line `QuadcosimError`s that name the store."""
    try:
        yield
    except (sqlite3.Error, OSError, ValueError, OverflowError) as error:
        is_damaged = isinstance(error, sqlite3.DatabaseError) and not isinstance(error, sqlite3.OperationalError)
        remedy = f"; {_REMEDY}" if is_damaged else ""
        raise QuadcosimError(f"{path}: the store cannot be used: {error_text(error)}{remedy}") from error
