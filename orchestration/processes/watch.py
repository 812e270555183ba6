"""A process is ended, with all that it has started, when it has taken more than it may."""

import math
import subprocess
import threading
import time
from typing import Protocol

from orchestration.processes.family import Family
from orchestration.processes.limits import Limits
from orchestration.processes.taken import Taken

_POLL = 0.05
"""[s] between two looks, at least"""
_SHARE = 0.1
"""of a limit of time that passes between two looks, at most"""
_EFFORT = 0.05
"""of a processor that looking takes, at most"""


class Counted(Protocol):
    """What is read as it comes."""

    count: int
    """Bytes so far"""


class Watch:
    """Looks at a process and its family until it ends or is closed; in a thread, if there is something to look at.

    Time is that in which it computes or sleeps: a call that waits for ever is noticed, and how busy the machine is
    changes nothing. Of what is allowed it is the time of a processor, of all threads, if that is more. That in which a
    process with a limit of its own lives does not count. Where the system says nothing of processes (not on Linux) it
    is the time of the wall, and memory is not limited.
    """

    def __init__(
        self,
        process: "subprocess.Popen[bytes]",
        family: Family,
        limits: Limits,
        output: Counted | None,
    ) -> None:
        """`output` is what it prints, if that is read."""
        self.reached: str | None = None
        """The limit at which it was ended, in words"""
        self.out_of_time = False
        """Whether that is a limit of time"""
        self._process, self._family, self._limits, self._output = process, family, limits, output
        self._taken = Taken()
        self._time, self._late = limits.time, "it takes longer than the limit of {:g} s"
        self._since: tuple[float, float] | None = (0.0, math.inf)  # of `Taken`; None: that of the next look
        self._lock, self._over = threading.Lock(), threading.Event()
        self._thread: threading.Thread | None = None
        if math.isfinite(min(limits.time, limits.memory, limits.output)):
            self._start()

    @property
    def spent(self) -> float:
        """[s] of its own time."""
        return self._taken.own

    @property
    def said_too_much(self) -> str | None:
        """The limit of output that is passed by what it has printed so far, in words; None: it is not."""
        if self._output is None or self._output.count <= self._limits.output * 1e6:
            return None
        return f"it writes more than the limit of {self._limits.output:g} MB to its standard output and error"

    def allow(self, seconds: float | None) -> None:
        """From now on it may take so much time, whatever it has taken; None: as much as it likes."""
        with self._lock:
            self.reached = None
            self._time, self._since = math.inf if seconds is None else seconds, None
            self._late = "it takes more than the time limit of {:g} s"
        if seconds is not None and self._thread is None:
            self._start()

    def close(self) -> None:
        """Look no longer."""
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
            self._taken.count(before, members, now - last)
            last, before = now, members
            with self._lock:
                if self._process.poll() is None:
                    self.reached = self._too_much(sum(each.memory for each in members.values()))
                if self.reached is not None or self._process.poll() is not None:
                    self._family.kill(self._process)  # also if it has ended itself: others hold its pipes open
                    return
            pause = self._pause(time.monotonic() - now)

    def _pause(self, cost: float) -> float:
        return max(min(_POLL, _SHARE * self._time), cost / _EFFORT)

    def _too_much(self, memory: int) -> str | None:
        own, processor = self._since = self._since or (self._taken.own, self._taken.processor)
        self.out_of_time = max(self._taken.own - own, self._taken.processor - processor) > self._time
        if self.out_of_time:
            return self._late.format(self._time)
        if self.said_too_much is not None:
            return self.said_too_much
        if memory > self._limits.memory * 1e6:
            return f"it takes more memory than the limit of {self._limits.memory:g} MB"
        return None
