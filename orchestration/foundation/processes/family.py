"""A process with all its descendants, identified by an environment variable that children inherit (Linux)."""

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Protocol

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


class Process(Protocol):
    """A `subprocess.Popen`, as far as it is used here."""

    pid: int
    stdin: IO[bytes] | None
    stdout: IO[bytes] | None
    stderr: IO[bytes] | None

    def poll(self) -> int | None:
        """Its exit code; None while it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Its exit code, when it has ended; raises `subprocess.TimeoutExpired` after `timeout` [s]."""

    def send_signal(self, sig: int) -> None:
        """Send it a signal, unless it has ended."""


_MARK = "QUADCOSIM_FAMILY"
"""Lists the names of the families that a process belongs to, outermost first"""
_LIMITED = "L"
"""Suffix of the name of a family that is limited in time"""
_ROOM = "/" + 64 * "-"
"""Follows the names of a server that forks: room for one more"""
_ROUNDS = 50
"""Most rounds in which the remaining processes are killed: they may start others meanwhile"""


@dataclass(frozen=True, kw_only=True)
class Member:
    """The present state of one process."""

    limited: bool
    """Whether it belongs to an inner family with its own time limit"""
    processor: float
    """Processor time used [s]"""
    waits: Mapping[int, float]
    """Time for which it was runnable but not running [s], by thread"""
    memory: int
    """Resident memory [byte]"""


class Family:
    """The processes started with `mark` in their environment."""

    def __init__(self, *, limited: bool) -> None:
        name = uuid.uuid4().hex + (_LIMITED if limited else "")
        self._names = "/".join(filter(None, (os.environ.get(_MARK), name)))

    @property
    def mark(self) -> dict[str, str]:
        """The environment variable that makes a process a member."""
        return {_MARK: self._names}

    def members(self) -> dict[int, Member]:
        """Living members by process id; empty where there is no /proc."""
        members = {}
        for pid, inner in self._pids():
            with contextlib.suppress(OSError, ValueError, IndexError):  # it may end meanwhile
                fields = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()
                members[pid] = Member(
                    limited=_LIMITED in inner,
                    processor=(int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"),
                    waits=waits(pid),
                    memory=int(fields[21]) * os.sysconf("SC_PAGE_SIZE"),
                )
        return members

    def kill(self, first: Process) -> None:
        """Kill the process that was started `first`, and all others."""
        if sys.platform == "win32":
            subprocess.run(["taskkill", "/T", "/F", "/PID", str(first.pid)], capture_output=True, check=False)
            return
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(first.pid, signal.SIGKILL)
        for _ in range(_ROUNDS):
            alive = [pid for pid, _ in self._pids()]
            if not alive:
                break
            for pid in alive:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)

    def _pids(self) -> Iterator[tuple[int, str]]:
        """Process ids of the family, each with the names of its inner families."""
        mark = f"{_MARK}={self._names}".encode()
        for name in os.listdir("/proc") if os.path.isdir("/proc") else ():
            if name.isdigit():
                with contextlib.suppress(OSError):
                    _, match, rest = Path(f"/proc/{name}/environ").read_bytes().partition(mark)
                    if match:
                        yield int(name), rest.partition(b"\0")[0].decode("ascii", "replace")


def room_for_names() -> dict[str, str]:
    """The variable of a process that will fork members of one more family (`NamesInPlace`)."""
    return {_MARK: os.environ.get(_MARK, "") + _ROOM}


class NamesInPlace:
    """The names of this process's families where the system shows the environment that it was started with.

    A process that is forked shows that of the one that it was forked from, until it overwrites it (Linux).
    """

    def __init__(self) -> None:
        getenv = ctypes.CDLL(None).getenv
        getenv.restype = ctypes.c_void_p
        self._address = getenv(_MARK.encode())
        self._size = len(os.environ[_MARK])

    def write(self) -> None:
        """Overwrite them by those of the present environment."""
        names = os.environ[_MARK].encode()
        assert len(names) <= self._size
        ctypes.memset(self._address, 0, self._size)
        ctypes.memmove(self._address, names, len(names))
