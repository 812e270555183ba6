"""The position of a run in its timetable: the number of past instants, which is all that a pause has to save of it."""

from collections.abc import Iterator

from orchestration.systems.schedule.schedule import Instant, Schedule
from orchestration.systems.schedule.timetable import Timetable

INSTANTS = 2**15
"""Approximate number of a schedule, made at once"""
TOGETHER = 2**9
"""Number made into objects at once, few enough to stay in the processor's cache"""


class Cursor:
    """Iterates over a timetable from its begin to its end."""

    def __init__(self, timetable: Timetable) -> None:
        self.at = 0
        """the next instant of the schedule"""
        self._timetable, self._before = timetable, 0
        self._schedule: Schedule | None = None

    @property
    def past(self) -> int:
        """The number of past instants."""
        return self._before + self.at

    def schedule(self) -> Schedule | None:
        """The schedule of the next instant; None at the end.

        Raises `UsageError` if the run cannot go through it.
        """
        if self._schedule is None or self.at == len(self._schedule):
            self._schedule, self._before, self.at = self._timetable.next_schedule(INSTANTS), self.past, 0
        return self._schedule

    def instants(self) -> Iterator[Instant]:
        """The instants to come, each past as soon as it is yielded."""
        while (schedule := self.schedule()) is not None:
            for instant in schedule.part(self.at, self.at + TOGETHER).instants():
                self.at += 1
                yield instant

    def move_to(self, past: int) -> Iterator[Schedule]:
        """Move on until so many instants are past; yields those skipped."""
        while self.past < past and (schedule := self.schedule()) is not None:
            begin, self.at = self.at, min(len(schedule), self.at + past - self.past)
            yield schedule.part(begin, self.at)
