"""How long a process has waited for a processor: on a busy machine that is no time of its own."""

import contextlib
import os
import time
from pathlib import Path

_NANOSECONDS = 1e9


def waits(process: int) -> dict[int, float]:
    """Seconds for which it could run and was not let to, by thread that lives.

    None for a process that is gone, and where the system does not say (it does on Linux).
    """
    found = {}
    with contextlib.suppress(OSError):
        for thread in Path(f"/proc/{process}/task").iterdir():
            with contextlib.suppress(OSError, ValueError, IndexError):  # it may end meanwhile
                found[int(thread.name)] = int((thread / "schedstat").read_text().split()[1]) / _NANOSECONDS
    return found


def own_clock() -> float:
    """Seconds on a clock of this process that stands still while it waits for a processor."""
    return time.monotonic() - max(waits(os.getpid()).values(), default=0.0)
