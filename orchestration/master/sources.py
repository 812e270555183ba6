"""The values of sources over time: constants, tables, held white noise, the built-in trajectory."""

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Protocol

import numpy as np

from fmu_kit.scalar import ScalarOps
from fmu_kit.trajectory import Trajectory
from orchestration.simulator import Floats
from orchestration.system.times import NANOSECONDS, Grid, exact_nanoseconds


class Values(Protocol):
    """What a source says at a time."""

    def at(self, t: float) -> Sequence[float]:
        """One value for each of its signals at `t` [s]; times are asked for in order."""

    def over(self, t: Floats) -> Floats:
        """The values at times `t` [s], shape (n,), as an array of shape (n, number of signals)."""

    def each(self, t: Floats) -> Floats:
        """As `over`, but to the bit what `at` says."""


class Constant:
    """The same values for ever."""

    def __init__(self, values: Sequence[float]) -> None:
        self._values = list(values)

    def at(self, t: float) -> Sequence[float]:
        """The values."""
        return self._values

    def over(self, t: Floats) -> Floats:
        """The values, a row for each time."""
        return np.tile(np.array(self._values), (len(t), 1))

    each = over


class Table:
    """Columns (n, m) over increasing times (n,) [s], linear between rows; the ends are held."""

    def __init__(self, time: Floats, columns: Floats) -> None:
        self.time, self.columns = time, columns

    def at(self, t: float) -> Sequence[float]:
        """The values at `t` [s]."""
        i = min(max(int(np.searchsorted(self.time, t, side="right")) - 1, 0), len(self.time) - 2)
        share = (t - self.time[i]) / (self.time[i + 1] - self.time[i])
        values: Floats = self.columns[i] + min(max(share, 0.0), 1.0) * (self.columns[i + 1] - self.columns[i])
        found: list[float] = values.tolist()
        return found

    def over(self, t: Floats) -> Floats:
        """The values at times `t`."""
        return np.column_stack([np.interp(t, self.time, column) for column in self.columns.T])

    def each(self, t: Floats) -> Floats:
        """As `over`, by the operations of `at`."""
        i = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.time) - 2)
        share = np.clip((t - self.time[i]) / (self.time[i + 1] - self.time[i]), 0.0, 1.0)
        values: Floats = self.columns[i] + share[:, None] * (self.columns[i + 1] - self.columns[i])
        return values


NUMPY = ScalarOps(
    sqrt=np.sqrt,
    tanh=np.tanh,
    sin=np.sin,
    cos=np.cos,
    atan2=np.arctan2,
    sign=np.sign,
    maximum=np.maximum,
    where=np.where,
    all=np.all,
)
"""Scalars that are numpy arrays, one value a point."""


class BuiltIn:
    """The positions [m], inertial, of the trajectory that controllers carry."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory

    def at(self, t: float) -> Sequence[float]:
        """x, y, z at `t` [s]."""
        p = self._trajectory.position(t)
        return p.x, p.y, p.z

    def over(self, t: Floats) -> Floats:
        """x, y, z at times `t`."""
        return np.column_stack(list(self._trajectory.position(t, NUMPY)))

    def each(self, t: Floats) -> Floats:
        """As `over`, one after the other: the mathematics of numpy is not that of Python."""
        return np.array([self.at(time) for time in t.tolist()]).reshape(len(t), 3)


class WhiteNoise:
    """Normal values of variance intensity / period, each held over a period: white noise of that intensity.

    Value k is the k-th of the stream for each signal in turn, whenever it is asked for.
    """

    def __init__(self, intensity: float, period: float, count: int, stream: np.random.Generator) -> None:
        self._sigma, self._period, self._count = math.sqrt(intensity / period), exact_nanoseconds(period), count
        self._grid = Grid(Fraction(0), self._period)  # the timetable's
        self._stream, self._drawn = stream, np.zeros((0, count))

    def at(self, t: float) -> Sequence[float]:
        """The values held at `t` [s]."""
        values: list[float] = self._upto(self._index(t))[self._index(t)].tolist()
        return values

    def over(self, t: Floats) -> Floats:
        """The values held at times `t`."""
        indices = np.array([self._index(time) for time in t.tolist()])
        result: Floats = self._upto(int(indices.max()))[indices]
        return result

    each = over

    def _index(self, t: float) -> int:
        time = round(t * NANOSECONDS)
        k = time * self._period.denominator // self._period.numerator
        return k + (self._grid[k + 1] <= time)

    def _upto(self, index: int) -> Floats:
        while len(self._drawn) <= index:
            block = self._sigma * self._stream.standard_normal((1024, self._count))
            self._drawn = np.vstack([self._drawn, block])
        return self._drawn
