"""Where P_d(t) comes from in a run: the controller's built-in trajectory, or a CSV file."""

import csv
from pathlib import Path
from typing import Protocol

import numpy as np

from fmu_kit.scalar import ScalarOps
from fmu_kit.trajectory import Trajectory
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


def _read_table(path: Path) -> tuple[Floats, Floats]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: expected a readable CSV file: {error}") from error
    header = [name.strip() for name in rows[0]] if rows else []
    missing = [name for name in ("time", *REFERENCE) if name not in header]
    if missing:
        raise UsageError(f"{path}: no column {', '.join(missing)}; expected time, {', '.join(REFERENCE)}")
    body = [row for row in rows[1:] if row]
    if len(body) < 2 or any(len(row) != len(header) for row in body):
        raise UsageError(f"{path}: expected at least two rows, each of {len(header)} numbers")
    try:
        table = np.array([[float(cell) for cell in row] for row in body])
    except ValueError as error:
        raise UsageError(f"{path}: expected numbers only: {error}") from error
    if not np.isfinite(table).all():
        raise UsageError(f"{path}: expected finite numbers only")
    time = table[:, header.index("time")].copy()
    if not (np.diff(time) > 0.0).all():
        raise UsageError(f"{path}: expected times that increase")
    return time, table[:, [header.index(name) for name in REFERENCE]].copy()
