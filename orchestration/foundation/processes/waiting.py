"""How long a process has waited for a processor, which does not count as time used by it."""

import contextlib
import os
import time
from pathlib import Path

_NANOSECONDS = 1e9


def waits(process: int) -> dict[int, float]:
    """Seconds for which each living thread of a process was runnable but not running.

    Empty for a process that has ended, and on systems other than Linux.
    """
    seconds = {}
    with contextlib.suppress(OSError):
        for thread in Path(f"/proc/{process}/task").iterdir():
            with contextlib.suppress(OSError, ValueError, IndexError):  # it may end meanwhile
                seconds[int(thread.name)] = int((thread / "schedstat").read_text().split()[1]) / _NANOSECONDS
    return seconds


def own_clock() -> float:
    """Seconds on a clock of this process that stops while it waits for a processor."""
    return time.monotonic() - max(waits(os.getpid()).values(), default=0.0)
