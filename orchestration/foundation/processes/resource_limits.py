"""Limits of what foreign files may ask for, and of the processes that handle them."""

import contextlib
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
    message: float = 64.0
    """Size of one message to the process that started it [MB]"""


@dataclass(frozen=True)
class FileLimit:
    """The most that a file may have of something, checked before memory or disk is taken."""

    value: float
    unit: str
    of: str
    """The name of what is limited"""

    def __str__(self) -> str:
        return f"{self.value:.0f} {self.unit}".rstrip()

    @property
    def bytes(self) -> int:
        """Of a limit in MB."""
        return int(self.value * 1e6)


UNPACKED = FileLimit(1000.0, "MB", "All files of an FMU or an SSP, unpacked, if that is also too much compressed")
COMPRESSION = FileLimit(20.0, "times", "Their size over that of the archive, if they are also too large")
DESCRIPTION = FileLimit(100.0, "MB", "`modelDescription.xml`")
DOCUMENT = FileLimit(16.0, "MB", "An XML document of an SSP")
ELEMENTS = FileLimit(100_000.0, "", "Elements of all arrays of an FMU")
OF_FILES = (UNPACKED, COMPRESSION, DESCRIPTION, DOCUMENT, ELEMENTS)
UNLIMITED = Limits(time=math.inf, memory=math.inf, size=math.inf, output=math.inf, message=2000.0)
"""Limits of processes that have none but that of a message, which may hold all signals of a run"""


_KINDS = ("RLIMIT_AS", "RLIMIT_DATA", "RLIMIT_FSIZE", "RLIMIT_NOFILE", "RLIMIT_STACK")
"""Limits that a process may lower for itself; that of time is set from outside"""


def own_limits() -> dict[int, tuple[int, int]]:
    """The limits of this process, soft and hard, by their numbers."""
    if sys.platform == "win32":
        return {}
    import resource

    return {kind: resource.getrlimit(kind) for kind in (getattr(resource, name) for name in _KINDS)}


def set_again(limits: dict[int, tuple[int, int]]) -> bool:
    """Set limits of this process as they were, as far as the system allows; returns whether they had changed."""
    changed = {kind: limits[kind] for kind, limit in own_limits().items() if limit != limits[kind]}
    for kind, (soft, hard) in changed.items():
        import resource

        try:
            resource.setrlimit(kind, (soft, hard))
        except (OSError, ValueError):  # a hard limit is lowered for good, unless by root
            lower = resource.getrlimit(kind)[1]
            with contextlib.suppress(OSError, ValueError):
                resource.setrlimit(kind, (lower, lower))
    return bool(changed)


def restrict(size: float) -> None:
    """Allow this process no file of more than `size` MB, no core dump, and no bytecode, half of which would be kept."""
    sys.dont_write_bytecode = True
    if sys.platform == "win32":
        return
    import resource

    for kind, limit in ((resource.RLIMIT_FSIZE, int(min(size * 1e6, 2.0**62))), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        resource.setrlimit(kind, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))
