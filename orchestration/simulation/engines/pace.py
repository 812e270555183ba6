"""The pace of a run: no instant is processed before its time by a clock on the wall, and none is left out."""

import time
from collections.abc import Callable

from orchestration.foundation.basics.times import seconds

LONGEST_SLEEP = 0.1
"""The longest time between two looks for an interruption [s]"""


class Pace:
    """Waits for instants; times of the run pass `rate` times as fast as those of the clock, from its start."""

    def __init__(
        self,
        rate: float,
        now: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._rate, self._now, self._sleep = rate, now, sleep
        self._begin: float | None = None
        self.largest_lateness = 0.0
        """The longest time by which an instant began too late [s]"""

    def wait(self, instant: int, interrupted: Callable[[], bool]) -> None:
        """Return at the time of an instant [ns], or at once if that is over, or after an interruption."""
        due = seconds(instant) / self._rate
        if self._begin is None:
            self._begin = self._now() - due
        while (left := self._begin + due - self._now()) > 0.0 and not interrupted():
            self._sleep(min(left, LONGEST_SLEEP))
        self.largest_lateness = max(self.largest_lateness, -left)
