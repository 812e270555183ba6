"""Resource limits of a process."""

import math
import sys
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Resource limits of a process that handles a foreign file."""

    time: float = 60.0
    """Time in which it computes or sleeps [s]; on Linux, time spent waiting for a processor does not count"""
    memory: float = 2000.0
    """Resident memory of the process and its descendants together [MB]; enforced on Linux"""
    size: float = 1000.0
    """Size that an archive unpacks to, and that any one file may grow to [MB]"""
    output: float = 10.0
    """Output written to standard output and standard error [MB]"""


UNLIMITED = Limits(time=math.inf, memory=math.inf, size=math.inf, output=math.inf)


def restrict(size: float) -> None:
    """Allow this process no file of more than `size` MB, and no core dump."""
    if sys.platform == "win32":
        return
    import resource

    for kind, limit in ((resource.RLIMIT_FSIZE, int(min(size * 1e6, 2.0**62))), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        resource.setrlimit(kind, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))
