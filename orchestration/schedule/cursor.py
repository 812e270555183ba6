"""Where a run is in its timetable: all of what happens when that a pause has to keep is how many instants are past."""

from collections.abc import Iterator

from orchestration.schedule.schedule import Instant, Schedule
from orchestration.schedule.timetable import Timetable

INSTANTS = 2**13
"""Of one schedule, about: so many are made at once"""
TOGETHER = 2**9
"""of these so many are made into objects, few enough to stay in the processor's cache"""


class Cursor:
    """A timetable, gone through from its begin to its end."""

    def __init__(self, timetable: Timetable) -> None:
        self.at = 0
        """the instant of the schedule that comes next"""
        self._timetable, self._before = timetable, 0
        self._schedule: Schedule | None = None

    @property
    def past(self) -> int:
        """How many instants are past."""
        return self._before + self.at

    def schedule(self) -> Schedule | None:
        """Where the next instant is; None at the end.

        Raises `UsageError` if the run cannot go through it.
        """
        if self._schedule is None or self.at == len(self._schedule):
            self._schedule, self._before, self.at = self._timetable.next_schedule(INSTANTS), self.past, 0
        return self._schedule

    def instants(self) -> Iterator[Instant]:
        """Those to come, each past as soon as it is given."""
        while (schedule := self.schedule()) is not None:
            for instant in schedule.part(self.at, self.at + TOGETHER).instants():
                self.at += 1
                yield instant

    def move_to(self, past: int) -> Iterator[Schedule]:
        """Go on until so many are past; gives what is passed over."""
        while self.past < past and (schedule := self.schedule()) is not None:
            begin, self.at = self.at, min(len(schedule), self.at + past - self.past)
            yield schedule.part(begin, self.at)
