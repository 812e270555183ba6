"""The rows of a study in one SQLite file: written by the coordinator alone, readable by anyone meanwhile."""

import json
import shutil
import sqlite3
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import filelock

from orchestration.errors import QuadcosimError, UsageError

METRICS = (
    "outcome", "horizon",
    "position_rmse", "position_iae", "position_itae", "position_max", "settling_time", "ultimate_bound",
    "attitude_error_rmse", "attitude_error_max", "control_effort.thrust", "control_effort.torque",
    "total_variation.thrust", "total_variation.torque", "energy_growth_share", "saturation_share", "diverged",
    "divergence_time", "steps",
)  # fmt: skip
"""Metrics of a row; the wall time of a run is its duration."""
TEXTS = ("outcome",)
"""Metrics that are words; all others are numbers."""

_TYPED = ", ".join(f'"{name}" {"TEXT" if name in TEXTS else "REAL"}' for name in METRICS)
_COLUMNS = ("design_index", "key", "status", "message", "settings", "seed", "duration", *METRICS)
_SCHEMA = f"""
CREATE TABLE IF NOT EXISTS about (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS runs (
    design_index INTEGER PRIMARY KEY, key TEXT NOT NULL, status TEXT NOT NULL, message TEXT, settings TEXT NOT NULL,
    seed INTEGER NOT NULL, duration REAL, {_TYPED}
);
"""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One run: its settings and what it came to."""

    index: int
    """place in the design"""
    key: str
    """hash of everything that determines the run"""
    settings: Mapping[str, Any]
    """the value of each axis"""
    seed: int
    metrics: Mapping[str, Any] | None
    """None if the run failed"""
    message: str | None
    """why it failed, or what diverged"""
    duration: float
    """wall-clock time of the run [s]"""

    @property
    def status(self) -> str:
        """`done` or `failed`; divergence is a result."""
        return "failed" if self.metrics is None else "done"


class Store:
    """A study's store, open for reading, or for writing by one coordinator at a time.

    Raises `QuadcosimError` in one line if the file cannot be used.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection

    def about(self) -> dict[str, str]:
        """What the store says of its study, by name."""
        with _explained(self.path):
            return dict(self._connection.execute("SELECT name, value FROM about"))

    def describe(self, about: Mapping[str, str]) -> None:
        """Write what the store is about."""
        with _explained(self.path), self._connection:
            self._connection.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", about.items())

    def statuses(self) -> dict[int, tuple[str, str]]:
        """Key and status of every row, by design index."""
        with _explained(self.path):
            found = self._connection.execute("SELECT design_index, key, status FROM runs")
            return {index: (key, status) for index, key, status in found}

    def counts(self) -> dict[str, int]:
        """How many rows have which status."""
        with _explained(self.path):
            return dict(self._connection.execute("SELECT status, count(*) FROM runs GROUP BY status"))

    def add(self, rows: Iterable[Row]) -> None:
        """Write rows in one transaction; a row of the same index is replaced."""
        values = [
            (
                row.index, row.key, row.status, row.message, json.dumps(row.settings), row.seed, row.duration,
                *((row.metrics or {}).get(name) for name in METRICS),
            )
            for row in rows
        ]  # fmt: skip
        marks = ", ".join("?" * len(_COLUMNS))
        with _explained(self.path), self._connection:
            self._connection.executemany(f"INSERT OR REPLACE INTO runs VALUES ({marks})", values)

    def rows(self) -> Iterator[dict[str, Any]]:
        """All rows sorted by design index, each a value by column; `settings` is a dictionary."""
        with _explained(self.path):
            cursor = self._connection.execute("SELECT * FROM runs ORDER BY design_index")
            for values in cursor:
                row = dict(zip(_COLUMNS, values, strict=True))
                row["settings"] = json.loads(row["settings"])
                yield row


@contextmanager
def open_for_writing(path: Path) -> Iterator[Store]:
    """The store at `path`, made if need be, for this process alone until the end of the block."""
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
                connection.executescript(_SCHEMA)
            yield Store(path, connection)
            with _explained(path):
                connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    finally:
        lock.release()


@contextmanager
def open_for_reading(path: Path) -> Iterator[Store]:
    """The store at `path`, also while a sweep writes into it, and also where nothing can be written."""
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
        except sqlite3.DatabaseError as error:
            raise QuadcosimError(f"{path}: expected the store of a study: {error}") from error
        with closing(connection):
            yield Store(path, connection)


def _read_only(path: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, timeout=10.0)
    try:
        connection.execute("SELECT count(*) FROM about").fetchone()
    except BaseException:
        connection.close()
        raise
    return connection


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """Say what is wrong with the store, in one line."""
    try:
        yield
    except (sqlite3.Error, OSError) as error:
        raise QuadcosimError(f"{path}: the store cannot be used: {error}") from error
