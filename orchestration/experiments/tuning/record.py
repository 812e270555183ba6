"""The record of a tuning in one SQLite file: the costs of points and the results of searches, so that none is repeated.

A search takes its points from its seed and the costs before. So one that was interrupted takes the same points again,
whose costs are here, and ends with the same result to the bit.
"""

import dataclasses
import json
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from orchestration.experiments.studies import store_columns as integrity
from orchestration.experiments.studies.store import locked_database
from orchestration.experiments.tuning.tuning_problem import Costs, SearchResult
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.simulator import Floats

_TABLES = {
    "points": "CREATE TABLE points (period REAL, shares TEXT NOT NULL, cost REAL NOT NULL, checksum TEXT NOT NULL)",
    "searches": "CREATE TABLE searches (period REAL, seed INTEGER NOT NULL, result TEXT NOT NULL, "
    "checksum TEXT NOT NULL)",
}
Result = TypeVar("Result", bound=SearchResult)


class Record:
    """The record of one tuning; its methods raise `QuadcosimError` in one line if the file cannot be used."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path, self._connection = path, connection
        self._costs = {(period, shares): cost for period, shares, cost in self._rows("points")}

    def results(self, kind: type[Result]) -> list[Result]:
        """The results of finished searches, of class `kind`."""
        return [kind(**json.loads(result)) for _, _, result in self._rows("searches")]

    def add(self, result: SearchResult) -> None:
        """Keep the result of a search."""
        self._insert("searches", [(result.period, result.seed, json.dumps(dataclasses.asdict(result)))])

    def keeping(self, period: float | None, costs: Costs) -> Costs:
        """The same costs; those of points that are known for a period are not evaluated, others are kept."""

        def known_or_evaluated(points: Sequence[Floats]) -> list[float]:
            keys = [(period, json.dumps(point.tolist())) for point in points]
            missing = [(key, point) for key, point in zip(keys, points) if key not in self._costs]
            if missing:
                values = costs([point for _, point in missing])
                new = {key: float(value) for (key, _), value in zip(missing, values, strict=True)}
                self._insert("points", [(*key, value) for key, value in new.items()])
                self._costs |= new
            return [self._costs[key] for key in keys]

        return known_or_evaluated

    def _rows(self, table: str) -> list[tuple[Any, ...]]:
        with integrity.store_errors(self._path):
            rows = self._connection.execute(f"SELECT * FROM {table} ORDER BY rowid").fetchall()
        integrity.expect_written(self._path, table, rows)
        return [row[:-1] for row in rows]

    def _insert(self, table: str, rows: Sequence[tuple[object, ...]]) -> None:
        with integrity.store_errors(self._path), self._connection:
            self._connection.executemany(
                f"INSERT INTO {table} VALUES (?, ?, ?, ?)", [(*row, integrity.checksum(row)) for row in rows]
            )


@contextmanager
def open_record(path: Path) -> Iterator[Record]:
    """The record at `path`, locked for this process until the end of the block; created if missing."""
    with locked_database(path, "tuning") as connection:
        with integrity.store_errors(path):
            schema = integrity.schema_of(connection)
            if not schema:
                with connection:
                    connection.execute("BEGIN IMMEDIATE")
                    for statement in _TABLES.values():
                        connection.execute(statement)
            elif schema != _TABLES:
                raise QuadcosimError(
                    f"{path}: no record of a tuning by this version of quadcosim; expected one: take another folder, "
                    "or remove it"
                )
            integrity.expect_no_damage(path, connection)
        yield Record(path, connection)
