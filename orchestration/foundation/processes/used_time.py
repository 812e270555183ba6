"""The time used by a process and its family."""

import os
from collections.abc import Mapping

from orchestration.foundation.processes.family import Member


class UsedTime:
    """Used time, summed over the intervals between two observations of the family; neither time decreases."""

    def __init__(self) -> None:
        self.own = 0.0
        """Wall-clock time in which it computed or slept [s]: waiting for a processor does not count, unless for one
        that it occupies itself (all processors for a second are a second)."""
        self.processor = 0.0
        """Processor time of all its threads together [s]"""
        self._excess = 0.0
        """Time by which `own` is too large [s]: the system reports a wait only when it has ended"""

    def count(self, before: Mapping[int, Member], now: Mapping[int, Member], passed: float) -> None:
        """Add an interval of `passed` [s] between two observations; none if a member has its own time limit."""
        if any(each.limited for each in now.values()):
            return
        computed = waited = 0.0
        for pid, each in now.items():
            old = before.get(pid)
            computed += max(0.0, each.processor - (0.0 if old is None else old.processor))
            waits = {} if old is None else old.waits
            waited = max(waited, *(wait - waits.get(thread, 0.0) for thread, wait in each.waits.items()), 0.0)
        self._excess += max(0.0, waited - passed)
        used = max(0.0, passed - waited, computed / (os.cpu_count() or 1))
        correction = min(self._excess, used)
        self._excess -= correction
        self.own += used - correction
        self.processor += computed
