"""The time that a process and its family have taken."""

import os
from collections.abc import Mapping

from orchestration.processes.family import Member


class Taken:
    """What is found of it between one look at the family and the next; neither time ever falls."""

    def __init__(self) -> None:
        self.own = 0.0
        """[s] in which it computed or slept, on the wall's clock: those in which it waited for a processor do not
        count, unless for one that it has itself: all processors for a second are a second."""
        self.processor = 0.0
        """[s] of a processor that it had, of all its threads together"""
        self._ahead = 0.0
        """[s] by which `own` is too large: the system tells of a wait when it has ended, perhaps after some looks"""

    def count(self, before: Mapping[int, Member], now: Mapping[int, Member], passed: float) -> None:
        """That of `passed` [s], at whose ends these members lived; none if one of them is limited by itself."""
        if any(each.limited for each in now.values()):
            return
        computed = waited = 0.0
        for pid, each in now.items():
            old = before.get(pid)
            computed += max(0.0, each.processor - (0.0 if old is None else old.processor))
            waits = {} if old is None else old.waits
            waited = max(waited, *(wait - waits.get(thread, 0.0) for thread, wait in each.waits.items()), 0.0)
        self._ahead += max(0.0, waited - passed)
        taken = max(0.0, passed - waited, computed / (os.cpu_count() or 1))
        told_before = min(self._ahead, taken)
        self._ahead -= told_before
        self.own += taken - told_before
        self.processor += computed
