"""Ends a process and its descendants when it exceeds a limit."""

import contextlib
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Mapping
from typing import Protocol

from orchestration.foundation.processes.family import Family, Member, Process
from orchestration.foundation.processes.resource_limits import Limits


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


_POLL = 0.05
"""Time between two checks [s], unless the time limit is short or checking is slow"""
_SHARE = 0.1
"""Largest share of the time limit between two checks"""
_PATIENCE = 2.0
"""Time in which a process that is out of time may tell where it is [s]"""
_EFFORT = 0.05
"""Largest share of a processor used for checking"""


class Counted(Protocol):
    """An output stream whose bytes are counted."""

    count: int
    """Bytes so far"""


class Watch:
    """Checks a process and its family against limits, in a thread, until the process ends or the watch is closed.

    Time counts while it computes or sleeps: a call that waits forever is noticed, and the load of the machine does not
    matter. A limit of `allow` applies to this time or to the processor time of all threads, whichever is larger. Time
    in which a descendant with its own limit lives does not count. On systems other than Linux it is wall-clock time,
    and memory is unlimited.
    """

    def __init__(
        self,
        process: Process,
        family: Family,
        limits: Limits,
        output: Counted | None,
    ) -> None:
        """`output` is its output, if that is read."""
        self.reached: str | None = None
        """The limit that it exceeded, in words"""
        self.out_of_time = False
        """Whether that is a limit of time"""
        self._process, self._family, self._limits, self._output = process, family, limits, output
        self._used = UsedTime()
        self._time, self._time_message = limits.time, "it takes longer than the limit of {:g} s"
        self._since: tuple[float, float] | None = (0.0, math.inf)  # of `UsedTime`; None: from the next check
        self._lock, self._over = threading.Lock(), threading.Event()
        self._thread: threading.Thread | None = None
        if math.isfinite(min(limits.time, limits.memory, limits.output)):
            self._start()

    @property
    def spent(self) -> float:
        """[s] of its own time."""
        return self._used.own

    @property
    def excess_output(self) -> str | None:
        """The limit of output, in words, if its output so far exceeds it."""
        if self._output is None or self._output.count <= self._limits.output * 1e6:
            return None
        return f"it writes more than the limit of {self._limits.output:g} MB to its standard output and error"

    def allow(self, seconds: float | None) -> None:
        """Limit its time from now on to `seconds`, whatever it has used; None: no limit."""
        with self._lock:
            self.reached = None
            self._time, self._since = math.inf if seconds is None else seconds, None
            self._time_message = "it takes more than the time limit of {:g} s"
        if seconds is not None and self._thread is None:
            self._start()

    def close(self) -> None:
        """Stop checking."""
        self._over.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def _start(self) -> None:
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def _watch(self) -> None:
        last, before, pause = time.monotonic(), self._family.members(), self._pause(0.0)
        while not self._over.wait(pause):
            now, members = time.monotonic(), self._family.members()
            self._used.count(before, members, now - last)
            last, before = now, members
            with self._lock:
                if self._process.poll() is None:
                    self.reached = self._exceeded(sum(each.memory for each in members.values()))
                if self.reached is not None or self._process.poll() is not None:
                    if self.out_of_time:
                        self._ask_for_place()
                    self._family.kill(self._process)  # also after it has ended: others may hold its pipes open
                    return
            pause = self._pause(time.monotonic() - now)

    def _ask_for_place(self) -> None:
        """Have the process tell where it is, if it can (`report_crashes`), and end by that."""
        if sys.platform == "linux":
            with contextlib.suppress(OSError):
                self._process.send_signal(signal.SIGPROF)
            until = time.monotonic() + _PATIENCE
            while self._process.poll() is None and time.monotonic() < until:
                time.sleep(0.01)

    def _pause(self, cost: float) -> float:
        return max(min(_POLL, _SHARE * self._time), cost / _EFFORT)

    def _exceeded(self, memory: int) -> str | None:
        """The limit that is exceeded, in words."""
        own, processor = self._since = self._since or (self._used.own, self._used.processor)
        self.out_of_time = max(self._used.own - own, self._used.processor - processor) > self._time
        if self.out_of_time:
            return self._time_message.format(self._time)
        if self.excess_output is not None:
            return self.excess_output
        if memory > self._limits.memory * 1e6:
            return f"it takes more memory than the limit of {self._limits.memory:g} MB"
        return None
