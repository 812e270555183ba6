"""The values of sources over time, as constants, tables, noise, gusts and motions, and their feeds to components."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Protocol

import numpy as np

from fmu_kit.scalar import ScalarOps
from fmu_kit.trajectory import Trajectory
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.basics.times import NANOSECONDS, Grid, exact_nanoseconds, instants_of
from orchestration.systems.signals.dryden import DRAWS, Dryden

if TYPE_CHECKING:
    from orchestration.systems.signals.motions import Motion


class SourceValues(Protocol):
    """The values of a source over time."""

    def at(self, t: float) -> Sequence[float]:
        """One value for each of its signals at `t` [s]; times must not decrease from call to call."""

    def over(self, t: Floats) -> Floats:
        """The values at times `t` [s], shape (n,), as an array of shape (n, number of signals)."""

    def at_each(self, t: Floats) -> Floats:
        """As `over`, with the bits of `at`."""


class ConstantValues:
    """Constant values."""

    def __init__(self, values: Sequence[float]) -> None:
        self._values = list(values)

    def at(self, t: float) -> Sequence[float]:
        """The values."""
        return self._values

    def over(self, t: Floats) -> Floats:
        """The values, a row for each time."""
        return np.tile(np.array(self._values), (len(t), 1))

    at_each = over


class TableValues:
    """Columns (n, m) over times (n,) [s], linear between rows; ends are held. Of rows of one time the last counts."""

    def __init__(self, time: Floats, columns: Floats) -> None:
        self.time, self.columns = time, columns

    def at(self, t: float) -> Sequence[float]:
        """The values at `t` [s]."""
        i = min(max(int(np.searchsorted(self.time, t, side="right")) - 1, 0), len(self.time) - 2)
        share = (t - self.time[i]) / (self.time[i + 1] - self.time[i])
        values: Floats = self.columns[i] + min(max(share, 0.0), 1.0) * (self.columns[i + 1] - self.columns[i])
        result: list[float] = values.tolist()
        return result

    def over(self, t: Floats) -> Floats:
        """The values at times `t`."""
        return np.column_stack([np.interp(t, self.time, column) for column in self.columns.T])

    def at_each(self, t: Floats) -> Floats:
        """As `over`, by the operations of `at`."""
        i = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.time) - 2)
        share = np.clip((t - self.time[i]) / (self.time[i + 1] - self.time[i]), 0.0, 1.0)
        return self.columns[i] + share[:, None] * (self.columns[i + 1] - self.columns[i])


class HeldValues(TableValues):
    """A table whose rows hold until the next."""

    def at(self, t: float) -> Sequence[float]:
        """The values at `t` [s]."""
        row: list[float] = self.columns[max(int(np.searchsorted(self.time, t, side="right")) - 1, 0)].tolist()
        return row

    def over(self, t: Floats) -> Floats:
        """The values at times `t`."""
        return self.columns[np.maximum(np.searchsorted(self.time, t, side="right") - 1, 0)]

    at_each = over


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
"""Scalars that are numpy arrays, with one value for each point."""


class BuiltIn:
    """The positions [m], inertial, of the trajectory that is built into controllers."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory

    def at(self, t: float) -> Sequence[float]:
        """x, y, z at `t` [s]."""
        p = self._trajectory.position(t)
        return p.x, p.y, p.z

    def over(self, t: Floats) -> Floats:
        """x, y, z at times `t`."""
        return np.column_stack(list(self._trajectory.position(t, NUMPY)))

    def at_each(self, t: Floats) -> Floats:
        """As `over`, one by one: the mathematical functions of numpy differ from those of Python."""
        return np.array([self.at(time) for time in t.tolist()]).reshape(len(t), 3)


def _elementwise(function: Callable[[float], float]) -> Callable[[Floats], Floats]:
    """The function over an array, with the bits that it has for single values."""
    return lambda x: np.array([function(value) for value in x.tolist()])


EXACT = replace(NUMPY, sin=_elementwise(math.sin), cos=_elementwise(math.cos))
"""Functions of `NUMPY`, the mathematical ones those of Python: many points at once have the bits of single ones"""


class Moving:
    """Some `quantities` of a motion, each a derivative (0: position) of a coordinate x, y or z."""

    def __init__(self, motion: Callable[[Floats], Floats], quantities: Sequence[int]) -> None:
        """`motion` returns all of them at times (n,), shape (n, 15)."""
        self._motion, self._quantities = motion, list(quantities)

    def at(self, t: float) -> Sequence[float]:
        """The values at `t` [s]."""
        values: list[float] = self.over(np.array([t]))[0].tolist()
        return values

    def over(self, t: Floats) -> Floats:
        """The values at times `t`."""
        return self._motion(t)[:, self._quantities]

    at_each = over


def motion_values(motion: "Motion") -> Callable[[Floats], Floats]:
    """A motion of the library, at times (n,) [s] as an array (n, 15)."""

    def over(t: Floats) -> Floats:
        now = motion.at(t, EXACT)
        orders = (now.position, now.velocity, now.acceleration, now.jerk, now.snap)
        return np.column_stack([coordinate for order in orders for coordinate in order])

    return over


def gusts(air: Dryden, stop_time: float, stream: np.random.Generator) -> TableValues:
    """The wind from 0 to `stop_time` [s]: north, east, down [m/s]; a longer run begins with the same values."""
    count = math.ceil(stop_time / air.step) + 2
    values = air.velocities(stream.standard_normal((count, DRAWS)).tolist())
    return TableValues(air.step * np.arange(count, dtype=np.float64), np.array(values))


class Scaled:
    """Values times a factor."""

    def __init__(self, values: SourceValues, factor: float) -> None:
        self._values, self._factor = values, factor

    def at(self, t: float) -> Sequence[float]:
        """The values at `t` [s]."""
        return [self._factor * value for value in self._values.at(t)]

    def over(self, t: Floats) -> Floats:
        """The values at times `t`."""
        return self._factor * self._values.over(t)

    def at_each(self, t: Floats) -> Floats:
        """As `over`, with the bits of `at`."""
        return self._factor * self._values.at_each(t)


class WhiteNoise:
    """Normal values of variance intensity / period, each held over a period: white noise of that intensity.

    Value k is the k-th of the stream for each signal in turn, whenever it is evaluated.
    """

    def __init__(self, intensity: float, period: float, count: int, stream: np.random.Generator) -> None:
        self._sigma, self._period, self._count = math.sqrt(intensity / period), exact_nanoseconds(period), count
        self._grid = Grid(Fraction(0), self._period)  # that of the timetable
        self._stream, self._drawn = stream, np.zeros((0, count))

    def at(self, t: float) -> Sequence[float]:
        """The values held at `t` [s]."""
        index = self._index(round(t * NANOSECONDS))
        values: list[float] = self._upto(index)[index].tolist()
        return values

    def over(self, t: Floats) -> Floats:
        """The values held at times `t`."""
        times = instants_of(t)
        if self._period.denominator == 1:  # all at once
            indices = times // self._period.numerator
        else:
            indices = np.array([self._index(time) for time in times.tolist()])
        result: Floats = self._upto(int(indices.max()))[indices]
        return result

    at_each = over

    def _index(self, time: int) -> int:
        k = time * self._period.denominator // self._period.numerator
        return k + (self._grid[k + 1] <= time)

    def _upto(self, index: int) -> Floats:
        while len(self._drawn) <= index:
            block = self._sigma * self._stream.standard_normal((1024, self._count))
            self._drawn = np.vstack([self._drawn, block])
        return self._drawn


class Feed:
    """A source that sets some inputs of one component, to those of its values that are at `places`."""

    def __init__(
        self,
        component: str,
        values: SourceValues,
        places: Sequence[int],
        into: Floats,
        transfer: Transfer,
        *,
        count: int,
    ) -> None:
        self.component, self.into, self.transfer = component, into, transfer
        """the component, the array of the inputs, and the call that sets them"""
        self.size = len(places)
        self._at, self._values = values.at, values
        self._places = None if len(places) == count else list(places)

    def feeds(self, component: str) -> bool:
        """Whether it sets inputs of this component."""
        return component == self.component

    def write(self, t: float) -> None:
        """Set the inputs to the values at `t` [s]."""
        values = self._at(t)
        self.into[:] = values if self._places is None else [values[i] for i in self._places]
        self.transfer()

    def at_each(self, t: Floats) -> Floats:
        """The values that `write` sets at times `t` [s], shape (n,), to the bit; shape (n, number of inputs)."""
        values = self._values.at_each(t)
        return values if self._places is None else values[:, self._places]
