"""Components of fixed step: an instant between two of their points moves to the next one, or is an error."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Integers
from orchestration.foundation.basics.times import Grid, seconds


class Misalignment(NamedTuple):
    """An instant between two points of a component that may not move: the run ends there."""

    time: int
    """Time of that instant [ns]"""
    text: str


@dataclass(frozen=True, kw_only=True)
class FixedStep:
    """The grid of a component of fixed step, and whether instants between its points move to the next one."""

    name: str
    grid: Grid
    moves: bool

    def aligned(self, times: Integers, what: str, misaligned: list[Misalignment]) -> Integers:
        """`times` [ns] on the grid; if they may not move, the first between two points is added to `misaligned`."""
        points: Integers = np.array([self.grid.from_(time) for time in times.tolist()], dtype=np.int64)
        between = np.flatnonzero(points != times)
        if len(between) and not self.moves:
            time, point = int(times[between[0]]), int(points[between[0]])
            before = max(point - self.grid[1], 0)
            misaligned.append(
                Misalignment(
                    time,
                    f"{what} at t = {in_seconds(time)} s falls between two points of components.{self.name}, "
                    f"{self._steps}: expected {in_seconds(before)} s or {in_seconds(point)} s; "
                    'align = "next" moves it there',
                )
            )
        return points

    def expect_end(self, stop: int) -> None:
        """Raise `UsageError` unless `stop` [ns] is on the grid: the end never moves."""
        point = self.grid.from_(stop)
        if point != stop:
            raise UsageError(
                f"stop_time = {in_seconds(stop)}: falls between two points of components.{self.name}, {self._steps}: "
                f"expected {in_seconds(point - self.grid[1])} or {in_seconds(point)}"
            )

    @property
    def _steps(self) -> str:
        return f"which takes steps of {in_seconds(self.grid[1])} s only"


def in_seconds(time: int) -> str:
    """A time [ns] as text in seconds."""
    return f"{seconds(time):.9g}"
