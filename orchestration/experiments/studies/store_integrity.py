"""Integrity of a study's store: checksums of rows, the schema of the file, and errors in one line."""

import hashlib
import json
import marshal
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from orchestration.experiments.studies.store_columns import ABOUT, OBJECTIVES, tables_for
from orchestration.foundation.basics.errors import QuadcosimError

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
