"""Reads tables over time from CSV files."""

import csv
import math
from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from orchestration.documents import readable
from orchestration.errors import UsageError
from orchestration.simulator import Floats

LONGEST_LINE = 2**17
"""Characters of a line, so that a file without line ends is not read whole."""


def read_table(path: Path, columns: Sequence[str], stop_time: float) -> tuple[Floats, Floats]:
    """Times (n,) [s] and the values of `columns` (n, m) of a CSV file with a column `time`.

    Raises `UsageError` if a column is missing, a value is not finite, time does not increase or the table does
    not cover [0, stop_time].
    """
    with readable(path, "CSV file"), path.open(newline="", encoding="utf-8-sig") as file:
        try:
            header, table = _read_rows(path, csv.reader(iter(lambda: _line(file), ""), strict=True), columns)
        except csv.Error as error:
            raise UsageError(f"{path}: expected CSV: {error}") from error
    time = table[:, header.index("time")].copy()
    if not (np.diff(time) > 0.0).all():
        raise UsageError(f"{path}: expected times that increase")
    if time[0] > 0.0 or time[-1] < stop_time:
        raise UsageError(f"{path}: covers {time[0]:g} to {time[-1]:g} s, expected 0 to stop_time = {stop_time:g} s")
    return time, table[:, [header.index(name) for name in columns]].copy()


def _line(file: TextIO) -> str:
    line = file.readline(LONGEST_LINE + 1)
    if len(line) > LONGEST_LINE:
        raise csv.Error(f"a line has more than {LONGEST_LINE} characters")
    return line


def _read_rows(path: Path, lines: Any, columns: Sequence[str]) -> tuple[list[str], Floats]:
    """The names of the columns, and the numbers below them, shape (number of rows, number of columns)."""
    header = [name.strip() for name in next(lines, [])]
    missing = [name for name in ("time", *columns) if name not in header]
    if missing:
        for separator, mark in ((";", "semicolons"), ("\t", "tabulators")):
            if any(separator in name for name in header):
                raise UsageError(f"{path}: columns separated by {mark}; expected commas, and points in numbers")
        raise UsageError(f"{path}: no column {', '.join(missing)}; expected time, {', '.join(columns)}")
    numbers = array("d")
    for row in lines:
        if not row:
            continue
        place = f"{path}: line {lines.line_num}"
        if len(row) != len(header):
            raise UsageError(f"{place}: {len(row)} values, expected {len(header)} as in the header")
        try:
            numbers.extend(map(float, row))
        except ValueError as error:
            raise UsageError(f"{place}: expected numbers only: {error}") from error
        if not all(map(math.isfinite, numbers[-len(header) :])):
            raise UsageError(f"{place}: expected finite numbers only")
    if len(numbers) < 2 * len(header):
        raise UsageError(f"{path}: expected at least two rows of numbers")
    return header, np.array(numbers).reshape(-1, len(header))
