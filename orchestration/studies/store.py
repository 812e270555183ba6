"""The rows of a study in one SQLite file: written by the coordinator alone, readable by anyone meanwhile."""

import hashlib
import json
import marshal
import math
import shutil
import sqlite3
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.workers.row import Row

FIXED = ("outcome", "good", "horizon", "diverged", "divergence_time", "steps")
"""Metrics of every system, beside its objectives; the wall time of a run is its duration."""
TEXTS = ("outcome",)
"""Metrics that are words; all others are numbers."""
MOST_OBJECTIVES = 1000
"""that SQLite has columns for"""

_RUN = ("key", "status", "message", "seed", "duration", "machine")
SETTINGS = "settings"
"""The column that has the value of each axis, as JSON"""
_DESIGN_WIDTH = 4
"""columns of the table of the design"""
_OWN = ("design_index", *_RUN, "checksum", SETTINGS)
_ORIGINS = ("guid.", "version.")
OBJECTIVES = "objectives"
"""What a store is about says them by this name; they are written when it is made."""
UNITS = "units"
"""likewise those of metrics that have one"""
# Runs are found by what determines them, so that they stay when the design around them changes.
_ABOUT = "CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL, checksum TEXT NOT NULL)"


def store_path(study: str, folder: str | Path | None = None) -> Path:
    """Where the rows of a study are: `results/NAME/study.sqlite` unless a folder is given."""
    return Path(folder or Path("results") / study) / "study.sqlite"


def _tables(metrics: Iterable[str]) -> dict[str, str]:
    typed = ", ".join(f"{_quoted(name)} {'TEXT' if name in TEXTS else 'REAL'}" for name in metrics)
    return {
        "about": _ABOUT,
        "design": "CREATE TABLE design (design_index INTEGER PRIMARY KEY, key TEXT NOT NULL, settings TEXT NOT NULL, "
        "checksum TEXT NOT NULL)",
        "runs": "CREATE TABLE runs (key TEXT PRIMARY KEY, status TEXT NOT NULL, message TEXT, seed INTEGER NOT NULL, "
        f"duration REAL, machine TEXT, {typed}, checksum TEXT NOT NULL)",
    }


def _quoted(name: str) -> str:
    doubled = name.replace('"', '""')
    return f'"{doubled}"'


def metrics_with(objectives: Iterable[str]) -> tuple[str, ...]:
    """The metrics of a row, in the order of a run's metrics."""
    return (*FIXED[:3], *objectives, *FIXED[3:])


def is_column(name: str, objectives: Iterable[str]) -> bool:
    """Whether the table of runs has a column of that name, whatever the axes are."""
    return name in (*_OWN, *metrics_with(objectives)) or name.startswith(_ORIGINS)


def expect_columns(objectives: Iterable[str]) -> None:
    """Raise `UsageError` for objectives that cannot be columns: SQLite tells no capitals from small letters."""
    taken = [*_OWN, *FIXED]
    for name in objectives:
        lower = name.lower()
        if not name or "\0" in name or lower in map(str.lower, taken) or lower.startswith(_ORIGINS):
            raise UsageError(f"objectives.{name}: the table of runs has a column of that name, expected another")
        taken.append(name)
    if len(taken) > MOST_OBJECTIVES:
        raise UsageError(f"objectives: {len(taken)} columns, expected at most {MOST_OBJECTIVES}")


@dataclass(frozen=True, kw_only=True)
class DesignPoint:
    """One place of a design: which run, and with which value of each axis."""

    index: int
    key: str
    settings: Mapping[str, Any]


class Store:
    """A study's store, open for reading, or for writing by one coordinator at a time.

    Raises `QuadcosimError` in one line if the file cannot be used.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection, objectives: Iterable[str]) -> None:
        self.path = path
        self._connection = connection
        self._is_whole = False
        self.metrics = metrics_with(objectives)
        """of a row"""
        self.columns = ("design_index", *_RUN, *self.metrics)
        """of the table of runs, beside the axes"""

    def about(self) -> dict[str, str]:
        """What the store says of its study, by name."""
        with _explained(self.path):
            return dict(self._connection.execute("SELECT name, value FROM about"))

    def describe(self, about: Mapping[str, str], design: Iterable[DesignPoint] | None = None) -> None:
        """Write what the store is about, and which runs its design has; those that are there stay."""
        with _explained(self.path), self._connection:
            self._insert("about", about.items())
            if design is not None:
                self._connection.execute("DELETE FROM design")
                self._insert("design", ((place.index, place.key, json.dumps(place.settings)) for place in design))

    def missing(self, *, failed_too: bool = False) -> dict[int, str]:
        """The places of the design whose runs have no row, or a failed one, and their keys; of equal runs the first."""
        self.expect_whole()
        with _explained(self.path):
            found = self._connection.execute(
                "SELECT min(design_index), key FROM design LEFT JOIN runs USING (key) "
                "WHERE status IS NULL OR (? AND status = 'failed') GROUP BY key ORDER BY 1",
                (failed_too,),
            )
            return dict(found)

    def lacking(self) -> dict[str, int]:
        """The keys of the runs of the design that have no row, and how many of its places each has."""
        self.expect_whole()
        with _explained(self.path):
            return dict(
                self._connection.execute(
                    "SELECT key, count(*) FROM design LEFT JOIN runs USING (key) WHERE status IS NULL GROUP BY key"
                )
            )

    def counts(self) -> dict[str, int]:
        """How many places of the design have a row of which status."""
        self.expect_whole()
        with _explained(self.path):
            return dict(
                self._connection.execute("SELECT status, count(*) FROM design JOIN runs USING (key) GROUP BY status")
            )

    def add(self, rows: Iterable[Row]) -> None:
        """Write rows in one transaction; a row of the same run is replaced."""
        rows = list(rows)
        with _explained(self.path), self._connection:
            self._insert("design", ((row.index, row.key, json.dumps(row.settings)) for row in rows))
            self._insert("runs", (_values(row, self.metrics) for row in rows))

    def rows(self) -> Iterator[dict[str, Any]]:
        """All rows of the design sorted by its index, each a value by column; `settings` is a dictionary."""
        for block in self.blocks():
            for values in zip(*block.values(), strict=True):
                row = dict(zip(block, values, strict=True))
                yield {**row, SETTINGS: json.loads(row[SETTINGS])}

    def blocks(self, most: int = 20_000) -> Iterator[dict[str, tuple[Any, ...]]]:
        """All rows of the design sorted by its index, at most so many at a time; the values by column.

        `settings` is the JSON text of each row. Each row is checked on its way; raises `QuadcosimError`, at the end at
        the latest, if anything is not as it was written.
        """
        runs, places = set[str](), 0
        with _explained(self.path):
            cursor = self._connection.execute(
                "SELECT design.*, runs.* FROM design JOIN runs USING (key) ORDER BY design_index"
            )
            while found := cursor.fetchmany(most):
                self._expect_written("design", (row[:_DESIGN_WIDTH] for row in found))
                self._expect_written("runs", (row[_DESIGN_WIDTH:] for row in found))
                index, _, settings, _, *values, _ = zip(*found, strict=True)
                places += len(index)
                runs.update(values[0])
                yield dict(zip((*self.columns, SETTINGS), (index, *values, settings), strict=True))
        if (places, len(runs)) != (self._number("design"), self._number("runs")):
            self.expect_whole()  # what has no counterpart was not read; a damaged key looks like that

    def expect_whole(self) -> None:
        """Raise `QuadcosimError` unless every row has the checksum that it was written with; looks once."""
        if self._is_whole:
            return
        with _explained(self.path):
            for table in ("design", "runs"):
                self._expect_written(table, self._connection.execute(f"SELECT * FROM {table}"))
        self._is_whole = True

    def _expect_written(self, table: str, rows: Iterable[tuple[Any, ...]]) -> None:
        _expect_written(self.path, table, rows)

    def _number(self, table: str) -> int:
        with _explained(self.path):
            (number,) = self._connection.execute(f"SELECT count(*) FROM {table}").fetchone()
        return int(number)

    def _insert(self, table: str, rows: Iterable[tuple[Any, ...]]) -> None:
        _insert(self._connection, table, rows)


def _make_if_need_be(connection: sqlite3.Connection, objectives: list[str]) -> None:
    """Make the tables, all of them or none, whatever ends it; those that nothing was written into are made anew."""
    schema, made_for = _schema(connection), _objectives(connection)
    if made_for == objectives or (schema and not _is_unused(connection, schema, made_for)):
        return
    with connection:
        connection.execute("BEGIN IMMEDIATE")  # without it each of these statements is a transaction of its own
        for table in schema:
            connection.execute(f"DROP TABLE {table}")
        for statement in _tables(metrics_with(objectives)).values():
            connection.execute(statement)
        _insert(connection, "about", [(OBJECTIVES, json.dumps(objectives))])


def _is_unused(connection: sqlite3.Connection, schema: Mapping[str, str], objectives: list[str] | None) -> bool:
    """Whether a database is a store that says nothing of a study and has no rows yet."""
    if objectives is None or schema != _tables(metrics_with(objectives)):
        return False
    query = "SELECT EXISTS (SELECT 1 FROM about WHERE name != ?) OR EXISTS (SELECT 1 FROM runs)"
    return not connection.execute(query, (OBJECTIVES,)).fetchone()[0]


def _insert(connection: sqlite3.Connection, table: str, rows: Iterable[tuple[Any, ...]]) -> None:
    summed = ((*row, _checksum(row)) for row in rows)
    first = next(summed, None)
    if first is not None:
        marks = ", ".join("?" * len(first))
        statement = f"INSERT OR REPLACE INTO {table} VALUES ({marks})"
        connection.execute(statement, first)
        connection.executemany(statement, summed)


@contextmanager
def open_for_writing(path: Path, objectives: Iterable[str]) -> Iterator[Store]:
    """The store at `path`, made if need be with columns for these, for this process alone until the end of the block.

    One that is there has the objectives that it was made with, once it is about a study.
    """
    import filelock

    with _explained(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = filelock.FileLock(f"{path}.lock", timeout=0)
        try:
            lock.acquire()
        except filelock.Timeout:
            raise QuadcosimError(f"{path}: another sweep is writing into it; expected to be the only one") from None
    try:
        with _explained(path):
            connection = sqlite3.connect(path, timeout=10.0)
        with closing(connection):
            with _explained(path):
                connection.execute("PRAGMA journal_mode=WAL")
                connection.execute("PRAGMA synchronous=NORMAL")
                _make_if_need_be(connection, list(objectives))
                opened = Store(path, connection, _expect_sound(path, connection))
            opened.expect_whole()
            yield opened
            with _explained(path):
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    finally:
        lock.release()


@contextmanager
def open_for_reading(path: Path) -> Iterator[Store]:
    """The store at `path`, also while a sweep writes into it, and also where nothing can be written.

    Its rows are checked when they are read.
    """
    if not path.is_file():
        raise UsageError(f"{path}: expected the store of a study; there is no such file")
    with tempfile.TemporaryDirectory() as folder:
        try:
            connection = _read_only(path)
        except sqlite3.OperationalError:  # WAL needs to write beside the file; a copy can
            copy = Path(folder) / path.name
            with _explained(path):
                for suffix in ("", "-wal"):
                    if Path(f"{path}{suffix}").is_file():
                        shutil.copyfile(f"{path}{suffix}", f"{copy}{suffix}")
                connection = _read_only(copy)
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            raise QuadcosimError(f"{path}: expected the store of a study: {_line(error)}") from error
        with closing(connection):
            with _explained(path):
                opened = Store(path, connection, _expect_sound(path, connection))
            yield opened


def _read_only(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, timeout=10.0)
    try:
        _schema(connection)
    except BaseException:
        connection.close()
        raise
    return connection


# -- damage -----------------------------------------------------------------------------------------------


def _expect_sound(path: Path, connection: sqlite3.Connection) -> list[str]:
    """The objectives of a store; raises `QuadcosimError` unless the file is sound and says so of itself."""
    schema, objectives = _schema(connection), _objectives(connection)
    if not schema:
        raise QuadcosimError(f"{path}: expected the store of a study; nothing has been written into it yet")
    if objectives is None or schema != _tables(metrics_with(objectives)):
        raise QuadcosimError(
            f"{path}: no store of this version of quadcosim; expected one: take another --out, or remove it"
        )
    found = connection.execute("PRAGMA integrity_check(1)").fetchone()[0]
    if found != "ok":
        raise QuadcosimError(f"{path}: the store is damaged ({' '.join(found.split())}); {_REMEDY}")
    _expect_written(path, "about", connection.execute("SELECT * FROM about"))
    return objectives


def _expect_written(path: Path, table: str, rows: Iterable[tuple[Any, ...]]) -> None:
    """Raise `QuadcosimError` unless every row of a table has the checksum that it was written with, its last value."""
    for row in rows:
        if _checksum(row[:-1]) != row[-1]:
            raise QuadcosimError(f"{path}: the store is damaged ({table}: {str(row[0])[:16]!r}); {_REMEDY}")


def _objectives(connection: sqlite3.Connection) -> list[str] | None:
    """What a store says that its objectives are; None if it says nothing of the kind."""
    if _schema(connection).get("about") != _ABOUT:
        return None
    row = connection.execute("SELECT value FROM about WHERE name = ?", (OBJECTIVES,)).fetchone()
    try:
        found = json.loads(row[0]) if row else None
    except (TypeError, ValueError):
        return None
    return found if isinstance(found, list) and all(isinstance(name, str) for name in found) else None


_REMEDY = "expected it as it was written: put back a copy, or remove it"


def _schema(connection: sqlite3.Connection) -> dict[str, str]:
    return dict(connection.execute("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL"))


def _checksum(row: tuple[Any, ...]) -> str:
    """Of the values as SQLite gives them back.

    Version 2 of marshal says values and types and nothing else, every bit of a float among them, in a fifth of the
    time of `repr`; it has not changed since Python 2.5. Later versions also say which texts are one object.
    """
    return hashlib.sha256(marshal.dumps(row, 2)).hexdigest()[:16]


def _values(row: Row, metrics: Iterable[str]) -> tuple[Any, ...]:
    measured = {name: (row.metrics or {}).get(name) for name in metrics}
    return (
        row.key, row.status, row.message, row.seed, _real(row.duration), row.machine,
        *(_text(value) if name in TEXTS else _real(value) for name, value in measured.items()),
    )  # fmt: skip


def _text(value: Any) -> str | None:
    return None if value is None else str(value)


def _real(value: Any) -> float | None:
    """A number as SQLite keeps it: it has one zero, and NULL for what is none."""
    return None if value is None or math.isnan(value) else float(value) + 0.0


def _line(error: Exception) -> str:
    """What SQLite says, which may quote what is damaged."""
    return "".join(letter if letter.isprintable() else "?" for letter in str(error))


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Say what is wrong with the store, in one line."""
    try:
        yield
    except (sqlite3.Error, OSError, ValueError, OverflowError) as error:
        raise QuadcosimError(f"{path}: the store cannot be used: {_line(error)}") from error
