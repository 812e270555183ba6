"""What a process may take."""

import math
import sys
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a process that handles a foreign file may take."""

    time: float = 60.0
    """[s] in which it computes or sleeps; not those in which it waits for a processor, which are known on Linux"""
    memory: float = 2000.0
    """[MB] resident, of the process and what it starts together; enforced on Linux"""
    size: float = 1000.0
    """[MB] that an archive unpacks to, and that any one file may grow to"""
    output: float = 10.0
    """[MB] written to standard output and standard error"""


UNLIMITED = Limits(time=math.inf, memory=math.inf, size=math.inf, output=math.inf)


def restrict(size: float) -> None:
    """For the limited process itself: no file of more than `size` MB, and no core dump."""
    if sys.platform == "win32":
        return
    import resource

    for kind, limit in ((resource.RLIMIT_FSIZE, int(min(size * 1e6, 2.0**62))), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        resource.setrlimit(kind, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))
