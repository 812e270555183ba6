"""A process with all that it starts, wherever that goes: known by a variable that children inherit (Linux)."""

import contextlib
import os
import signal
import subprocess
import sys
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestration.processes.waiting import waits

_MARK = "QUADCOSIM_FAMILY"
"""Has the name of each family that a process is of, the outermost first"""
_LIMITED = "L"
"""At the end of the name of one that is limited in time"""
_ROUNDS = 50
"""How often what still lives is killed: it may go on to start processes meanwhile"""


@dataclass(frozen=True, kw_only=True)
class Member:
    """One process, as it is now."""

    limited: bool
    """Whether its time is limited by itself, in a family within this one"""
    processor: float
    """[s] that it has had of it"""
    waits: Mapping[int, float]
    """[s] for which it could run and was not let to, by thread"""
    memory: int
    """[byte] resident"""


class Family:
    """What will be started with `mark` in its environment."""

    def __init__(self, *, limited: bool) -> None:
        name = uuid.uuid4().hex + (_LIMITED if limited else "")
        self._names = "/".join(filter(None, (os.environ.get(_MARK), name)))

    @property
    def mark(self) -> dict[str, str]:
        """The variable that makes a process one of the family."""
        return {_MARK: self._names}

    def members(self) -> dict[int, Member]:
        """Those that live, by process; none where the system does not say."""
        found = {}
        for pid, inner in self._pids():
            with contextlib.suppress(OSError, ValueError, IndexError):  # it may end meanwhile
                fields = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()
                found[pid] = Member(
                    limited=_LIMITED in inner,
                    processor=(int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"),
                    waits=waits(pid),
                    memory=int(fields[21]) * os.sysconf("SC_PAGE_SIZE"),
                )
        return found

    def kill(self, first: "subprocess.Popen[bytes]") -> None:
        """End the process that was started `first`, and all others."""
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
        """Processes of the family, and the names of those within it that each is of."""
        mark = f"{_MARK}={self._names}".encode()
        for name in os.listdir("/proc") if os.path.isdir("/proc") else ():
            if name.isdigit():
                with contextlib.suppress(OSError):
                    _, found, rest = Path(f"/proc/{name}/environ").read_bytes().partition(mark)
                    if found:
                        yield int(name), rest.partition(b"\0")[0].decode("ascii", "replace")
