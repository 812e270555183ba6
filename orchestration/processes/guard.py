"""A process that is ended, with all that it has started, when it has taken more time or memory than it may."""

import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from orchestration.processes import confined

_POLL = 0.1
"""[s] between two looks"""
_SHARE = 0.1
"""of a limit that passes between two looks, at most"""


class Guard:
    """Watches a process until it is closed.

    Its time is that of the processor, and that in which all of it sleeps: a call that waits for ever is noticed, and
    how busy the machine is changes nothing. Processes that are confined by limits of their own count as awake only.
    Where the system says nothing of processes (not on Linux) it is the time of the wall, and memory is not limited.
    """

    def __init__(
        self,
        process: "subprocess.Popen[bytes]",
        *,
        time_limit: float | None = None,
        memory_limit: float | None = None,
        each: Callable[[], None] = lambda: None,
    ) -> None:
        """`time_limit` in seconds, `memory_limit` in MB; `each` is called at every look."""
        self.reached: str | None = None
        """The limit at which it was ended, in words"""
        self._process, self._time, self._memory, self._each = process, time_limit, memory_limit, each
        self._spent, self._counts = 0.0, False
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def begin(self) -> None:
        """From now on time counts."""
        self._counts = True

    def close(self) -> None:
        """Watch no longer."""
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        pause = _POLL if self._time is None else min(_POLL, _SHARE * self._time)
        last, before = time.monotonic(), _family(self._process.pid)
        while not self._over.wait(pause):
            self._each()
            now, family = time.monotonic(), _family(self._process.pid)
            if self._counts:
                self._spent += _taken(before, family, now - last)
            last, before = now, family
            self.reached = self._too_much(family)
            if self.reached is not None:
                self._end(family)
                return

    def _too_much(self, family: "dict[int, _Process]") -> str | None:
        if self._time is not None and self._spent > self._time:
            return f"it takes more than the time limit of {self._time:g} s"
        if self._memory is not None and sum(each.memory for each in family.values()) > self._memory * 1e6:
            return f"it takes more memory than the limit of {self._memory:g} MB"
        return None

    def _end(self, family: "dict[int, _Process]") -> None:
        for pid in family:
            with suppress(OSError):
                os.kill(pid, 9)
        self._process.kill()


@contextmanager
def time_limited(process: "subprocess.Popen[bytes]", limit: float | None) -> Iterator[Guard | None]:
    """A process that is ended if it takes more than `limit` [s] while the block runs; None: it is not watched."""
    if limit is None:
        yield None
        return
    guard = Guard(process, time_limit=limit)
    guard.begin()
    try:
        yield guard
    finally:
        guard.close()


@dataclass(frozen=True, kw_only=True)
class _Process:
    parent: int
    state: str
    """one letter, as the system has it"""
    processor: float
    """[s] that it has had of it"""
    memory: int
    """[byte] resident"""


def _taken(before: dict[int, _Process], now: dict[int, _Process], passed: float) -> float:
    """The time [s] that a family has taken while so much `passed`."""
    if not now:
        return passed
    limited = {pid for pid in now if confined.is_confined(pid)}
    computed = sum(
        each.processor - (before[pid].processor if pid in before else 0.0)
        for pid, each in now.items()
        if pid not in limited
    )
    if computed > 0.0:
        return computed
    return passed if all(each.state == "S" for each in now.values()) else 0.0


def _family(pid: int) -> dict[int, _Process]:
    """A process and what it has started, and so on, as far as it lives; nothing where the system does not say."""
    known = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError, ValueError, IndexError):
            known[int(path.parent.name)] = _read(path)
    family, waiting = {}, [pid]
    while waiting:
        one = waiting.pop()
        if one in known:
            family[one] = known[one]
            waiting += [other for other, each in known.items() if each.parent == one and other not in family]
    return family


def _read(path: Path) -> _Process:
    fields = path.read_text(errors="replace").rpartition(")")[2].split()
    return _Process(
        state=fields[0],
        parent=int(fields[1]),
        processor=(int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"),
        memory=int(fields[21]) * os.sysconf("SC_PAGE_SIZE"),
    )
