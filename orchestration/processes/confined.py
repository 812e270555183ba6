"""A process for what is not to be trusted: limited in time, memory and output, and ended with all that it started."""

import contextlib
import math
import os
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from orchestration.processes.waiting import waited

_MARK = "QUADCOSIM_CONFINED"
"""Variable that tells a confined process, and what it starts, from all others; children inherit it."""
_KEPT = 16_384
"""Bytes of what the process says that are kept, of the end"""
_ROUNDS = 50
"""How often what still lives is killed: it may go on to start processes meanwhile"""
_OUT_OF_PROCESSOR = "it takes more time of a processor than the system gives it (ulimit -t)"


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a process that handles a foreign file may take."""

    time: float = 60.0
    """[s], those apart in which it waits for a processor that others have; these are known on Linux"""
    memory: float = 2000.0
    """[MB] resident, of the process and what it starts together; enforced on Linux"""
    size: float = 1000.0
    """[MB] that an archive unpacks to, and that any one file may grow to"""
    output: float = 10.0
    """[MB] written to standard output and standard error"""


@dataclass(frozen=True, kw_only=True)
class Ending:
    """How a process ended."""

    code: int | None
    """Exit code, as the operating system gives it; None: it was stopped"""
    reached: str | None
    """The limit that it was stopped at, in words"""
    out_of_time: bool
    """Whether that is the limit of time"""
    said: str
    """The last line of what it wrote to standard output or standard error"""

    @property
    def described(self) -> str:
        """In words, after `the process`."""
        return f"was stopped: {self.reached}" if self.code is None else ended(self.code)


def ended(code: int) -> str:
    """How a process ended by its exit code, in words, after `the process`."""
    if code < 0:
        return f"ended by {signal.Signals(-code).name}"
    return f"ended with exit code {code:#x}" if code > 255 else f"ended with exit code {code}"


def run(command: Sequence[str], environment: Mapping[str, str], limits: Limits) -> Ending:
    """A process to its end or to a limit; nothing that it started is left, however this ends."""
    mark = uuid.uuid4().hex
    process = subprocess.Popen(
        command, env={**environment, _MARK: mark}, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, start_new_session=True,
    )  # fmt: skip
    _limit_processor_time(process, limits)
    assert process.stdout is not None
    output = _Output(process.stdout)
    try:
        reached = _watched(process, output, limits, mark)
    finally:
        _kill_all(process, mark)
    said = output.text().strip().splitlines()
    return Ending(
        code=None if reached else process.returncode,
        reached=reached,
        out_of_time=reached == _late(limits),
        said=said[-1] if said else "",
    )


def is_confined(pid: int) -> bool:
    """Whether a process runs within limits of its own, as far as this system says (Linux)."""
    try:
        return f"\0{_MARK}=".encode() in b"\0" + Path(f"/proc/{pid}/environ").read_bytes()
    except OSError:
        return False


def restrict(size: float) -> None:
    """For the confined process itself: no file of more than `size` MB, and no core dump."""
    if sys.platform == "win32":
        return
    import resource

    for kind, limit in ((resource.RLIMIT_FSIZE, int(min(size * 1e6, 2.0**62))), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        resource.setrlimit(kind, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))


class _Output:
    """What a process writes, read as it comes, of which only the end is kept."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.count = 0
        """Bytes so far"""
        self._stream = stream
        self._tail = b""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def text(self) -> str:
        """The end of it."""
        self._reader.join(timeout=1.0)  # no longer: who has escaped may hold the other end
        return self._tail.decode("utf-8", "replace")

    def _read(self) -> None:
        while block := os.read(self._stream.fileno(), 65_536):
            self.count += len(block)
            self._tail = (self._tail + block)[-_KEPT:]
        self._stream.close()


def _watched(process: subprocess.Popen[bytes], output: _Output, limits: Limits, mark: str) -> str | None:
    """The limit that the process has reached; None if it has ended itself."""
    started, lost = time.monotonic(), 0.0
    pause = 0.05
    while True:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(pause)
            return _OUT_OF_PROCESSOR if sys.platform == "linux" and process.returncode == -signal.SIGXCPU else None
        looked = time.monotonic()
        family = list(_family(mark))
        lost = max(lost, *map(waited, family), 0.0)
        if time.monotonic() - started - lost > limits.time:
            return _late(limits)
        if output.count > limits.output * 1e6:
            return f"it writes more than the limit of {limits.output:g} MB to its standard output and error"
        if sum(map(_resident, family)) > limits.memory * 1e6:
            return f"it takes more memory than the limit of {limits.memory:g} MB"
        pause = max(0.05, 10.0 * (time.monotonic() - looked))


def _limit_processor_time(process: subprocess.Popen[bytes], limits: Limits) -> None:
    """Let the system end it, and each process that it starts, where nobody watches any more: we may be killed too.

    A limit that there is (`ulimit -t`) holds for them, and is left a second before its end: by SIGXCPU, which tells.
    """
    if sys.platform == "linux":
        import resource

        seconds = math.ceil(limits.time * (os.cpu_count() or 1)) + 1  # its threads may use all cores until time is up
        there = [math.inf if one == resource.RLIM_INFINITY else one for one in resource.getrlimit(resource.RLIMIT_CPU)]
        hard = int(min(seconds + 1, there[1]))
        soft = int(max(1, min(seconds, there[0], hard - 1)))
        with contextlib.suppress(ProcessLookupError):
            resource.prlimit(process.pid, resource.RLIMIT_CPU, (soft, hard))


def _late(limits: Limits) -> str:
    return f"it takes longer than the limit of {limits.time:g} s"


def _kill_all(process: subprocess.Popen[bytes], mark: str) -> None:
    if sys.platform == "win32":
        subprocess.run(["taskkill", "/T", "/F", "/PID", str(process.pid)], capture_output=True, check=False)
    else:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        for _ in range(_ROUNDS):
            alive = list(_family(mark))
            if not alive:
                break
            for pid in alive:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
    process.wait()


def _family(mark: str) -> Iterator[int]:
    """Processes that carry the mark, those in a session of their own too (Linux)."""
    label = f"{_MARK}={mark}".encode()
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if label in (folder / "environ").read_bytes():
                yield int(folder.name)


def _resident(pid: int) -> int:
    """Bytes of memory that a process has; 0 if it is gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")
