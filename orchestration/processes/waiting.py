"""How long a process has waited for a processor: on a busy machine that is no time of its own."""

import contextlib
import os
import time
from pathlib import Path

_NANOSECONDS = 1e9


def waited(process: int) -> float:
    """Seconds for which it could run and was not let to, of its threads the one that waited longest.

    0 for a process that is gone, and where the system does not say (it does on Linux).
    """
    longest = 0
    with contextlib.suppress(OSError):
        for thread in Path(f"/proc/{process}/task").iterdir():
            with contextlib.suppress(OSError, ValueError, IndexError):  # it may end meanwhile
                longest = max(longest, int((thread / "schedstat").read_text().split()[1]))
    return longest / _NANOSECONDS


def own_clock() -> float:
    """Seconds on a clock of this process that stands still while it waits for a processor."""
    return time.monotonic() - waited(os.getpid())
