"""Reads tables over time from CSV files."""

import csv
import itertools
import math
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from orchestration.foundation.basics.documents import readable
from orchestration.foundation.basics.errors import A_FLOAT, UsageError, shown, told_apart
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, seconds

LONGEST_LINE = 2**17
"""The most characters of a line, so that a file without line ends is not read whole"""


@dataclass(frozen=True, kw_only=True)
class TableRows:
    """The numbers of a CSV file by column, with the line of each row."""

    path: Path
    columns: Mapping[str, Floats]
    """Columns (n,) by name, in the order of the file"""
    lines: Sequence[int]
    rounded: Mapping[tuple[str, int], str]
    """Texts of the large numbers that no float is, by column and row"""

    def error(self, row: int, column: str, expected: str) -> UsageError:
        """The error for an invalid value."""
        value = shown(self.rounded.get((column, row), float(self.columns[column][row])))
        return UsageError(f"{self.path}: line {self.lines[row]}: {column} = {value}: expected {expected}")

    def expect_exact(self, column: str) -> None:
        """Raise `UsageError` for a large number of a column that no float is."""
        for row in (at for name, at in self.rounded if name == column):
            raise self.error(row, column, A_FLOAT)

    def expect_increasing_times(self, *, jumps: bool = False) -> None:
        """Raise `UsageError` for a time that is not later than the one before; with `jumps` it may equal that.

        The last one may not: a line needs two times.
        """
        steps = np.diff(self.columns[TIME])
        wrong = steps < 0.0 if jumps else steps <= 0.0
        wrong[-1] = steps[-1] <= 0.0
        if wrong.any():
            raise self.error(1 + int(wrong.argmax()), TIME, "times that increase")


TIME = "time"
EXACT = 2.0**53
"""Up to here a float represents every integer"""


def read_table(
    path: Path, columns: Sequence[str], stop_time: float, *, begin: float = 0.0, held: bool = False
) -> tuple[Floats, Floats]:
    """Times (n,) [s] from its time `begin` on, and the values of `columns` (n, m), of a CSV file with a column `time`.

    Rows of one time jump. Raises `UsageError` if a column is missing, a value is not finite, time decreases or the
    table does not cover `begin` to begin + stop_time, unless its ends are `held`; times are then whole nanoseconds.
    """
    rows = read_rows(path, (TIME, *columns))
    rows.expect_increasing_times(jumps=True)
    time = rows.columns[TIME]
    if not held and (time[0] > begin or time[-1] < begin + stop_time):
        first, start = told_apart(time[0], begin)
        last, stop = told_apart(time[-1], begin + stop_time)
        end = stop if begin else f"stop_time = {stop}"
        raise UsageError(f"{path}: covers {first} to {last} s, expected {start} to {end} s")
    time = time - begin
    if held:
        time = seconds(np.rint(time * NANOSECONDS))  # as the instants of the run: 3 * 0.1 is no time after 0.3
        if time[-1] <= time[-2]:
            raise rows.error(len(time) - 1, TIME, "a time that is a nanosecond later, at the least")
    return time, np.column_stack([rows.columns[name] for name in columns])


def read_rows(path: Path, columns: Sequence[str]) -> TableRows:
    """A CSV file that has at least these columns; one whose cells have several numbers is as many, as u[1] and u[2].

    Raises `UsageError` for a missing column and, naming line and column, for a value that is no finite number.
    """
    with _opened(path) as lines:
        return _read_rows(path, lines, columns)


def words_of(path: Path, column: str) -> Iterator[tuple[int, str]]:
    """The lines and the cells of a column of a CSV file that are no numbers."""
    with _opened(path) as lines:
        at = _names(lines).index(column)
        for cells in lines:
            if at < len(cells) and not _is_finite(cells[at]):
                yield lines.line_num, cells[at].strip()


def header_of(path: Path) -> list[str]:
    """The names of the columns of a CSV file; raises `UsageError` for one that cannot be read."""
    with _opened(path) as lines:
        header = _names(lines)
    if TIME not in header:
        _expect_commas(path, header)
    return header


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    with readable(path, "CSV file"), path.open(newline="", encoding="utf-8-sig") as file:
        try:
            yield csv.reader(iter(lambda: _line(file), ""), strict=True)
        except csv.Error as error:
            raise UsageError(f"{path}: expected CSV: {error}") from error


def _line(file: TextIO) -> str:
    line = file.readline(LONGEST_LINE + 1)
    if len(line) > LONGEST_LINE:
        raise csv.Error(f"a line has more than {LONGEST_LINE} characters")
    return line


def _names(lines: Any) -> list[str]:
    return [name.strip() for name in next(lines, [])]


def _read_rows(path: Path, lines: Any, columns: Sequence[str]) -> TableRows:
    names = _names(lines)
    first: list[str] = next(filter(None, lines), [])
    header = _elements(names, first)
    _expect_columns(path, header, columns, dict(zip(names, first)), lines.line_num)
    numbers, places, rounded = array("d"), list[int](), dict[tuple[str, int], str]()
    for cells in itertools.chain([first], lines):
        if not cells:
            continue
        row = cells if header is names else [number for cell in cells for number in cell.split() or [cell]]
        place = f"{path}: line {lines.line_num}"
        if len(row) != len(header):
            raise UsageError(f"{place}: {len(row)} values, expected {len(header)} as in the header")
        try:
            numbers.extend(map(_number, row))
        except ValueError as error:
            raise UsageError(f"{place}: {_first_invalid(header, row)}: expected numbers only") from error
        read = numbers[-len(header) :]
        if not all(map(math.isfinite, read)):
            raise UsageError(f"{place}: {_first_invalid(header, row)}: expected finite numbers only")
        if max(read) >= EXACT or min(read) <= -EXACT:
            for name, number, text in zip(header, read, row):
                if abs(number) >= EXACT and Decimal(text) != Decimal(number):
                    rounded[name, len(places)] = text
        places.append(lines.line_num)
    if len(places) < 2:
        raise UsageError(f"{path}: expected at least two rows of numbers")
    table = np.array(numbers).reshape(-1, len(header))
    named = {name: table[:, i].copy() for i, name in enumerate(header)}
    return TableRows(path=path, columns=named, lines=places, rounded=rounded)


def _elements(names: list[str], row: Sequence[str]) -> list[str]:
    """The names of the columns, those of arrays by elements: of columns with several numbers in their first cell."""
    counts = [len(cell.split()) for cell in row]
    if max(counts, default=1) <= 1 or len(counts) != len(names):
        return names
    return [
        name if count <= 1 else f"{name}[{i}]"
        for name, count in zip(names, counts)
        for i in range(1, max(count, 1) + 1)
    ]


def _expect_columns(
    path: Path, header: Sequence[str], columns: Sequence[str], first: Mapping[str, str], line: int
) -> None:
    """Raise `UsageError` for a missing column, with the cell of the `first` row if that has too few or many numbers."""
    missing = [name for name in columns if name not in header]
    if not missing:
        return
    _expect_commas(path, header)
    for name, cell in first.items():
        elements = [each for each in columns if each.rpartition("[")[0] == name]
        if name in missing or set(elements) & set(missing):
            counted = f"{len(elements)} numbers" if elements else "one number"
            raise UsageError(f"{path}: line {line}: {name} = {shown(cell)}: expected {counted}")
    raise UsageError(f"{path}: no column {', '.join(missing)}; expected {', '.join(columns)}")


def _expect_commas(path: Path, header: Sequence[str]) -> None:
    for separator, mark in ((";", "semicolons"), ("\t", "tabulators")):
        if any(separator in name for name in header):
            raise UsageError(f"{path}: columns separated by {mark}; expected commas, and points in numbers")


def _first_invalid(header: Sequence[str], row: Sequence[str]) -> str:
    """The first value of a row that is no finite number, with its column."""
    return next(f"{name} = {shown(text)}" for name, text in zip(header, row) if not _is_finite(text))


def _number(text: str) -> float:
    """The number of a cell; false and true, as files of outputs have them, are 0 and 1."""
    try:
        return float(text)
    except ValueError:
        truth = text.strip().lower()
        if truth in ("false", "true"):
            return float(truth == "true")
        raise


def _is_finite(text: str) -> bool:
    try:
        return math.isfinite(_number(text))
    except ValueError:
        return False
