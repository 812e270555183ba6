"""Where P_d(t) comes from in a run: the controller's built-in trajectory, or a CSV file."""

import csv
import math
from array import array
from pathlib import Path
from typing import Any, Protocol, TextIO

import numpy as np

from fmu_kit.scalar import ScalarOps
from fmu_kit.trajectory import Trajectory
from orchestration.documents import readable
from orchestration.errors import UsageError
from orchestration.simulator import Floats
from orchestration.wiring import REFERENCE

NUMPY = ScalarOps(
    sqrt=np.sqrt, tanh=np.tanh, sin=np.sin, cos=np.cos, sign=np.sign, maximum=np.maximum, where=np.where, all=np.all
)
"""Scalars that are numpy arrays, one value a point."""


class ReferencePath(Protocol):
    """The desired position over time."""

    def position(self, t: float) -> tuple[float, float, float]:
        """P_d [m], inertial, at `t` [s]."""

    def positions(self, t: Floats) -> Floats:
        """P_d [m], shape (n, 3), at times `t` [s], shape (n,)."""


class BuiltIn:
    """The trajectory that the controller FMU carries, with the run's parameters."""

    def __init__(self, trajectory: Trajectory) -> None:
        self.trajectory = trajectory

    def position(self, t: float) -> tuple[float, float, float]:
        """P_d [m] at `t` [s]."""
        p = self.trajectory.position(t)
        return p.x, p.y, p.z

    def positions(self, t: Floats) -> Floats:
        """P_d [m], shape (n, 3), at times `t`."""
        return np.column_stack(list(self.trajectory.position(t, NUMPY)))


class FromFile:
    """A table of `time` and all `reference.*` columns, linear between its rows.

    Raises `UsageError` if a column is missing, a value is not finite, time does not increase or the table
    does not cover [0, stop_time].
    """

    def __init__(self, path: Path, stop_time: float) -> None:
        self.time, self.columns = _read_table(path)
        if self.time[0] > 0.0 or self.time[-1] < stop_time:
            raise UsageError(
                f"{path}: covers {self.time[0]:g} to {self.time[-1]:g} s, expected 0 to stop_time = {stop_time:g} s"
            )

    def values(self, t: float) -> Floats:
        """All reference inputs at `t` [s], in the order of `wiring.REFERENCE`."""
        i = min(max(int(np.searchsorted(self.time, t, side="right")) - 1, 0), len(self.time) - 2)
        share = (t - self.time[i]) / (self.time[i + 1] - self.time[i])
        result: Floats = self.columns[i] + share * (self.columns[i + 1] - self.columns[i])
        return result

    def position(self, t: float) -> tuple[float, float, float]:
        """P_d [m] at `t` [s]."""
        x, y, z = self.values(t)[:3].tolist()
        return x, y, z

    def positions(self, t: Floats) -> Floats:
        """P_d [m], shape (n, 3), at times `t`."""
        return np.column_stack([np.interp(t, self.time, self.columns[:, axis]) for axis in range(3)])


LONGEST_LINE = 2**17
"""Characters of a line, so that a file without line ends is not read whole."""


def _read_table(path: Path) -> tuple[Floats, Floats]:
    with readable(path, "CSV file"), path.open(newline="", encoding="utf-8-sig") as file:
        try:
            header, table = _read_rows(path, csv.reader(iter(lambda: _line(file), ""), strict=True))
        except csv.Error as error:
            raise UsageError(f"{path}: expected CSV: {error}") from error
    time = table[:, header.index("time")].copy()
    if not (np.diff(time) > 0.0).all():
        raise UsageError(f"{path}: expected times that increase")
    return time, table[:, [header.index(name) for name in REFERENCE]].copy()


def _line(file: TextIO) -> str:
    line = file.readline(LONGEST_LINE + 1)
    if len(line) > LONGEST_LINE:
        raise csv.Error(f"a line has more than {LONGEST_LINE} characters")
    return line


def _read_rows(path: Path, lines: Any) -> tuple[list[str], Floats]:
    """The names of the columns, and the numbers below them, shape (number of rows, number of columns)."""
    header = [name.strip() for name in next(lines, [])]
    missing = [name for name in ("time", *REFERENCE) if name not in header]
    if missing:
        for separator, mark in ((";", "semicolons"), ("\t", "tabulators")):
            if any(separator in name for name in header):
                raise UsageError(f"{path}: columns separated by {mark}; expected commas, and points in numbers")
        raise UsageError(f"{path}: no column {', '.join(missing)}; expected time, {', '.join(REFERENCE)}")
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
