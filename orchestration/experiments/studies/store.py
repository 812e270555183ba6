"""The rows of a study in one SQLite file, written by the coordinator alone and readable by others meanwhile."""

import json
import shutil
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from fmu_kit.scratch import temporary_folder
from orchestration.experiments.studies import store_columns as columns
from orchestration.experiments.studies import store_columns as integrity
from orchestration.foundation.basics.errors import QuadcosimError, UsageError, shown
from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.simulation.workers.row import TEXT, Rows


def note_on_engines(engines: Mapping[str, int]) -> str | None:
    """How many runs are by which of several engines; None for one engine."""
    if len(engines) < 2:
        return None
    numbers = ", ".join(f"{count} by {name}" for name, count in sorted(engines.items()))
    return f"runs of several engines, whose metrics agree to 1e-12: {numbers}"


def store_path(study: str, folder: str | Path | None = None) -> Path:
    """The path of a study's store; default: `results/NAME/study.sqlite`. Raises `UsageError` for what is no path."""
    if not isinstance(folder, str | PathLike | None):
        raise UsageError(f"out = {shown(repr(folder))}: expected the path of a folder")
    return Path(folder or Path("results") / study) / "study.sqlite"


def store_folder(study: str, store: Path | None, out: Path | None) -> Path | None:
    """The folder of a study's store; default: `out` if it is there, else None, that of `store_path`.

    `store` may also be the path of its file.
    """
    if store is not None:
        return store.parent if store.name == store_path(study, store).name else store
    return out if out is not None and store_path(study, out).is_file() else None


DesignPoint = tuple[int, str, str]
"""One point of a design: its index, the key of its run, and the value of each axis as JSON"""


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
                self._insert("design", design)

    def missing(self, *, failed_too: bool = False) -> Integers:
        """Points of the design whose runs have no row, or a failed one, shape (n, 2); of equal runs the first.

        The index of each, and how many points lack the row of its run. Of a million no more is kept in memory.
        """
        self.expect_whole()
        query = (
            "SELECT min(design_index), count(*) * (status IS NULL) FROM design LEFT JOIN runs USING (key) "
            "WHERE status IS NULL OR (? AND status = 'failed') GROUP BY key ORDER BY 1"
        )
        with integrity.store_errors(self.path):
            rows = self._connection.execute(query, (failed_too,))
            return np.fromiter(rows, dtype=np.dtype((np.int64, 2)))

    def keys(self, indices: Integers) -> list[str]:
        """The keys of the runs of some points of the design, in order."""
        query = "SELECT design_index, key FROM design WHERE design_index BETWEEN ? AND ? ORDER BY design_index"
        wanted = {*indices.tolist()}
        with integrity.store_errors(self.path):
            rows = self._connection.execute(query, (int(indices.min()), int(indices.max())))
            return [key for index, key in rows if index in wanted]

    def counts(self) -> dict[str, int]:
        """The number of points of the design by the status of their rows."""
        return self._pairs("SELECT status, count(*) FROM design JOIN runs USING (key) GROUP BY status")

    def engines(self) -> dict[str, int]:
        """The number of points of the design by the engine of their rows, failed ones aside."""
        return self._pairs(
            "SELECT engine, count(*) FROM design JOIN runs USING (key) WHERE engine IS NOT NULL GROUP BY engine"
        )

    def outcomes(self) -> dict[str | None, int]:
        """The number of points of the design by the outcome of their rows; None: that of runs that have failed."""
        return self._pairs("SELECT outcome, count(*) FROM design JOIN runs USING (key) GROUP BY outcome")

    def _pairs(self, query: str) -> dict[Any, Any]:
        """The two columns of a query over a store that is whole, the second by the first."""
        self.expect_whole()
        with integrity.store_errors(self.path):
            return dict(self._connection.execute(query))

    def add(self, rows: Rows) -> None:
        """Write rows of points of the design in one transaction, replacing rows of the same runs."""
        with integrity.store_errors(self.path), self._connection:
            self._insert("runs", zip(*_columns(rows, self.metrics), strict=True))

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


def _columns(rows: Rows, metrics: Iterable[str]) -> Iterator[Sequence[Any]]:
    """The values of rows by column of the table of runs, as SQLite has them."""
    results, count = rows.results, len(rows)
    yield rows.key
    yield ["failed" if failed else "done" for failed in results.failed.tolist()]
    yield results.messages
    yield rows.seed
    yield _reals(results.durations)
    yield [results.machine] * count
    yield results.engines
    for name in metrics:
        if name == TEXT:
            yield results.texts
        else:
            yield _reals(results.numbers[name]) if name in results.numbers else [None] * count


def _reals(numbers: Floats) -> list[float | None]:
    """Numbers as SQLite stores them: with one zero, and NULL for NaN."""
    values: list[float | None] = (numbers + 0.0).tolist()
    for place in np.flatnonzero(np.isnan(numbers)).tolist():
        values[place] = None
    return values
