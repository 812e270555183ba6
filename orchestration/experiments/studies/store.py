"""The rows of a study in one SQLite file, written by the coordinator alone and readable by others meanwhile."""

import json
import math
import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmu_kit.scratch import temporary_folder
from orchestration.experiments.studies import store_columns as columns
from orchestration.experiments.studies import store_integrity as integrity
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.simulation.workers.row import Row


def note_on_engines(engines: Mapping[str, int]) -> str | None:
    """What to say of runs by several engines, with their numbers; None for one engine."""
    if len(engines) < 2:
        return None
    numbers = ", ".join(f"{count} by {name}" for name, count in sorted(engines.items()))
    return f"runs of several engines, which differ in last bits: {numbers}"


def store_path(study: str, folder: str | Path | None = None) -> Path:
    """The path of a study's store; default: `results/NAME/study.sqlite`."""
    return Path(folder or Path("results") / study) / "study.sqlite"


@dataclass(frozen=True, kw_only=True)
class DesignPoint:
    """One point of a design: the key of its run and the value of each axis."""

    index: int
    key: str
    settings: Mapping[str, Any]


class Store:
    """A study's store, open for reading, or for writing by one coordinator at a time.

    Its methods raise `QuadcosimError` in one line if the file cannot be used.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection, objectives: Iterable[str]) -> None:
        self.path = path
        self._connection = connection
        self._is_whole = False
        self.metrics = columns.metrics_with(objectives)
        """Metrics of a row"""
        self.columns = ("design_index", *columns.RUN, *self.metrics)
        """Columns of the table of runs, besides the axes"""

    def about(self) -> dict[str, str]:
        """The entries that describe the study, by name."""
        with integrity.store_errors(self.path):
            return dict(self._connection.execute("SELECT name, value FROM about"))

    def describe(self, about: Mapping[str, str], design: Iterable[DesignPoint] | None = None) -> None:
        """Write entries that describe the study, and the points of its design; rows of runs remain."""
        with integrity.store_errors(self.path), self._connection:
            self._insert("about", about.items())
            if design is not None:
                self._connection.execute("DELETE FROM design")
                self._insert("design", ((point.index, point.key, json.dumps(point.settings)) for point in design))

    def missing(self, *, failed_too: bool = False) -> dict[int, str]:
        """Indices and keys of the design whose runs have no row, or a failed one; of equal runs the first."""
        return self._pairs(
            "SELECT min(design_index), key FROM design LEFT JOIN runs USING (key) "
            "WHERE status IS NULL OR (? AND status = 'failed') GROUP BY key ORDER BY 1",
            failed_too,
        )

    def missing_counts(self) -> dict[str, int]:
        """The keys of the runs of the design that have no row, each with its number of points."""
        return self._pairs(
            "SELECT key, count(*) FROM design LEFT JOIN runs USING (key) WHERE status IS NULL GROUP BY key"
        )

    def counts(self) -> dict[str, int]:
        """The number of points of the design by the status of their rows."""
        return self._pairs("SELECT status, count(*) FROM design JOIN runs USING (key) GROUP BY status")

    def engines(self) -> dict[str, int]:
        """The number of points of the design by the engine of their rows, failed ones aside."""
        return self._pairs(
            "SELECT engine, count(*) FROM design JOIN runs USING (key) WHERE engine IS NOT NULL GROUP BY engine"
        )

    def _pairs(self, query: str, *values: bool) -> dict[Any, Any]:
        """The two columns of a query over a store that is whole, the second by the first."""
        self.expect_whole()
        with integrity.store_errors(self.path):
            return dict(self._connection.execute(query, values))

    def add(self, rows: Iterable[Row]) -> None:
        """Write rows in one transaction, replacing rows of the same runs."""
        rows = list(rows)
        with integrity.store_errors(self.path), self._connection:
            self._insert("design", ((row.index, row.key, json.dumps(row.settings)) for row in rows))
            self._insert("runs", (_values(row, self.metrics) for row in rows))

    def rows(self) -> Iterator[dict[str, Any]]:
        """All rows sorted by design index, as values by column; `settings` is a dictionary."""
        for block in self.blocks():
            for values in zip(*block.values(), strict=True):
                row = dict(zip(block, values, strict=True))
                yield {**row, columns.SETTINGS: json.loads(row[columns.SETTINGS])}

    def blocks(self, most: int = 20_000) -> Iterator[dict[str, tuple[Any, ...]]]:
        """All rows sorted by design index, at most `most` at a time, as values by column.

        `settings` is the JSON text of each row. Checks each row that it yields; raises `QuadcosimError`, at the latest
        at the end, if anything is not as it was written.
        """
        runs, points = set[str](), 0
        with integrity.store_errors(self.path):
            cursor = self._connection.execute(
                "SELECT design.*, runs.* FROM design JOIN runs USING (key) ORDER BY design_index"
            )
            while rows := cursor.fetchmany(most):
                integrity.expect_written(self.path, "design", (row[: columns.DESIGN_WIDTH] for row in rows))
                integrity.expect_written(self.path, "runs", (row[columns.DESIGN_WIDTH :] for row in rows))
                index, _, settings, _, *values, _ = zip(*rows, strict=True)
                points += len(index)
                runs.update(values[0])
                yield dict(zip((*self.columns, columns.SETTINGS), (index, *values, settings), strict=True))
        if (points, len(runs)) != (self._number("design"), self._number("runs")):
            self.expect_whole()  # rows without counterpart were not read, as happens with a damaged key

    def expect_whole(self) -> None:
        """Raise `QuadcosimError` unless every row has its checksum; checks once."""
        if self._is_whole:
            return
        with integrity.store_errors(self.path):
            for table in ("design", "runs"):
                integrity.expect_written(self.path, table, self._connection.execute(f"SELECT * FROM {table}"))
        self._is_whole = True

    def _number(self, table: str) -> int:
        with integrity.store_errors(self.path):
            (number,) = self._connection.execute(f"SELECT count(*) FROM {table}").fetchone()
        return int(number)

    def _insert(self, table: str, rows: Iterable[tuple[Any, ...]]) -> None:
        _insert(self._connection, table, rows)


def _create_tables(connection: sqlite3.Connection, objectives: list[str]) -> None:
    """Create all tables in one transaction, unless they exist; unused tables for other objectives are replaced."""
    schema, existing = integrity.schema_of(connection), integrity.objectives_of(connection)
    if existing == objectives or (schema and not _is_unused(connection, schema, existing)):
        return
    with connection:
        connection.execute("BEGIN IMMEDIATE")  # else each of these statements is a separate transaction
        for table in schema:
            connection.execute(f"DROP TABLE {table}")
        for statement in columns.tables_for(objectives).values():
            connection.execute(statement)
        _insert(connection, "about", [(columns.OBJECTIVES, json.dumps(objectives))])


def _is_unused(connection: sqlite3.Connection, schema: Mapping[str, str], objectives: list[str] | None) -> bool:
    """Whether a database is a store without a description of a study and without rows."""
    if objectives is None or schema != columns.tables_for(objectives):
        return False
    query = "SELECT EXISTS (SELECT 1 FROM about WHERE name != ?) OR EXISTS (SELECT 1 FROM runs)"
    return not connection.execute(query, (columns.OBJECTIVES,)).fetchone()[0]


def _insert(connection: sqlite3.Connection, table: str, rows: Iterable[tuple[Any, ...]]) -> None:
    complete = ((*row, integrity.checksum(row)) for row in rows)
    first = next(complete, None)
    if first is not None:
        marks = ", ".join("?" * len(first))
        statement = f"INSERT OR REPLACE INTO {table} VALUES ({marks})"
        connection.execute(statement, first)
        connection.executemany(statement, complete)


@contextmanager
def locked_database(path: Path, what: str) -> Iterator[sqlite3.Connection]:
    """The SQLite file at `path`, locked for this process until the end of the block; created if missing.

    `what` is the name of what writes into it.
    """
    import filelock

    with integrity.store_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = filelock.FileLock(f"{path}.lock", timeout=0)
        try:
            lock.acquire()
        except filelock.Timeout:
            raise QuadcosimError(f"{path}: another {what} is writing into it; expected to be the only one") from None
    try:
        with integrity.store_errors(path):
            connection = sqlite3.connect(path, timeout=10.0)
        with closing(connection):
            with integrity.store_errors(path):
                connection.execute("PRAGMA journal_mode=WAL")
                connection.execute("PRAGMA synchronous=NORMAL")
            yield connection
            with integrity.store_errors(path):
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    finally:
        lock.release()


@contextmanager
def open_for_writing(path: Path, objectives: Iterable[str]) -> Iterator[Store]:
    """The store at `path`, locked for this process until the end of the block; created if missing.

    A new store has columns for these objectives; one that describes a study keeps its own.
    """
    with locked_database(path, "sweep") as connection:
        with integrity.store_errors(path):
            _create_tables(connection, list(objectives))
            opened = Store(path, connection, integrity.expect_sound(path, connection))
        opened.expect_whole()
        yield opened


@contextmanager
def open_for_reading(path: Path) -> Iterator[Store]:
    """The store at `path`, also while a sweep writes into it, and in folders without write access.

    Its rows are checked when they are read.
    """
    if not path.is_file():
        raise UsageError(f"{path}: expected the store of a study; there is no such file")
    with temporary_folder() as folder:
        try:
            connection = _read_only(path)
        except sqlite3.OperationalError:  # WAL writes beside the file, so open a copy
            with integrity.store_errors(path):
                for suffix in ("", "-wal"):
                    if Path(f"{path}{suffix}").is_file():
                        shutil.copyfile(f"{path}{suffix}", folder / f"{path.name}{suffix}")
                connection = _read_only(folder / path.name)
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            raise QuadcosimError(f"{path}: expected the store of a study: {integrity.error_text(error)}") from error
        with closing(connection):
            with integrity.store_errors(path):
                opened = Store(path, connection, integrity.expect_sound(path, connection))
            yield opened


def _read_only(path: Path) -> sqlite3.Connection:
    """A connection that changes nothing; it may write, so that the last one takes away the log beside the file."""
    connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=rw", uri=True, timeout=10.0)
    try:
        connection.execute("PRAGMA query_only=ON")
        integrity.schema_of(connection)
    except BaseException:
        connection.close()
        raise
    return connection


def _values(row: Row, metrics: Iterable[str]) -> tuple[Any, ...]:
    measured = {name: (row.metrics or {}).get(name) for name in metrics}
    return (
        row.key, row.status, row.message, row.seed, _real(row.duration), row.machine, row.engine,
        *(_text(value) if name in columns.TEXTS else _real(value) for name, value in measured.items()),
    )  # fmt: skip


def _text(value: Any) -> str | None:
    return None if value is None else str(value)


def _real(value: Any) -> float | None:
    """A number as SQLite stores it: with one zero, and NULL for NaN."""
    return None if value is None or math.isnan(value) else float(value) + 0.0
