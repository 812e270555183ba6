"""Computers from a table of tasks: a CSV file with a row for each task, and its keys as columns."""

import csv
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestration.foundation.basics.documents import readable
from orchestration.foundation.basics.errors import UsageError, expected_name, prefixed
from orchestration.systems.system.computers import Task

UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
"""Units of times, after the name of a column: `period [ms]`"""
TIMES = ("period", "offset", "jitter", "execution", "deadline")
TEXTS = ("component", "on", "read", "write", "overrun")
COLUMNS = ("name", "computer", "priority", *TIMES, *TEXTS)


def computers_of(path: Path) -> dict[str, Any]:
    """The table `computers` of a system file from a CSV file; without a column `computer`, all tasks are on one.

    Times are in seconds, or in the unit of their column: `period [ms]`. An empty cell stands for the default. Raises
    `UsageError`, naming the line, for an invalid value.
    """
    with readable(path, "CSV file"), path.open(newline="", encoding="utf-8-sig") as file:
        rows = csv.reader(file, strict=True)
        try:
            columns = [_column(path, name) for name in next(rows, [])]
            for needed in ("name", "execution"):
                if needed not in [name for name, _ in columns]:
                    raise UsageError(f"{path}: no column {needed}; expected some of {', '.join(COLUMNS)}")
            computers: dict[str, Any] = {}
            for row in rows:
                if any(cell.strip() for cell in row):
                    _add(computers, path, f"{path}: line {rows.line_num}", columns, row)
        except csv.Error as error:
            raise UsageError(f"{path}: expected CSV: {error}") from error
    if not computers:
        raise UsageError(f"{path}: expected a row for each task")
    return computers


def _column(path: Path, header: str) -> tuple[str, float]:
    """The key of a column, and the unit of its times [s]."""
    name, _, unit = header.strip().partition("[")
    name, unit = name.strip().lower(), unit.strip(" ]")
    if name not in COLUMNS:
        raise UsageError(f"{path}: column {header.strip()}: {expected_name(name, COLUMNS)}")
    if unit not in (UNITS if name in TIMES else ("",)):
        expected = ", ".join(filter(None, UNITS)) if name in TIMES else "none"
        raise UsageError(f"{path}: column {header.strip()}: unit {unit}: expected {expected}")
    return name, UNITS[unit]


def _add(computers: dict[str, Any], path: Path, place: str, columns: list[tuple[str, float]], row: list[str]) -> None:
    if len(row) != len(columns):
        raise UsageError(f"{place}: {len(row)} values, expected {len(columns)} as in the header")
    given = {name: (cell.strip(), unit) for (name, unit), cell in zip(columns, row, strict=True) if cell.strip()}
    keys = {name: _value(place, name, *cell) for name, cell in given.items() if name not in ("name", "computer")}
    if "name" not in given:
        raise UsageError(f"{place}: name: expected one for each task")
    name = given["name"][0]
    tasks: dict[str, Mapping[str, Any]] = computers.setdefault(
        given.get("computer", (path.stem, 1.0))[0], {"tasks": {}}
    )["tasks"]
    if name in tasks:
        raise UsageError(f"{place}: name = {name}: expected another one than those before it")
    with prefixed(f"{place}: {name}: "):
        task = Task(**keys)
    defaults = {field.name: field.default for field in dataclasses.fields(task)}
    tasks[name] = {key: value for key, value in keys.items() if value != defaults[key]}


def _value(place: str, name: str, cell: str, unit: float) -> Any:
    if name in TEXTS:
        return cell
    try:
        return int(cell) if name == "priority" else float(f"{float(cell) * unit:.15g}")
    except ValueError:
        expected = "a whole number" if name == "priority" else "a number"
        raise UsageError(f"{place}: {name} = {cell}: expected {expected}") from None
