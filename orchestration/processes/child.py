"""A process that this one starts, talks to, limits and ends, with all that it has started."""

import contextlib
import math
import os
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from orchestration.processes.channel import LongError, framed, receive, send
from orchestration.processes.family import Family
from orchestration.processes.limits import UNLIMITED, Limits
from orchestration.processes.subprocesses import environment as usual_environment
from orchestration.processes.watch import Watch

_KEPT = 16_384
"""Bytes of what the process prints that are kept, of the end"""
_LONGEST = 64.0
"""[MB] said at once by one whose output is limited, at most"""
_OUT_OF_PROCESSOR = "it takes more time of a processor than the system gives it (ulimit -t)"
_PATIENCE = 60.0
"""[s] for one that says no more, and so is about to end: why it did is asked for"""


@dataclass(frozen=True, kw_only=True)
class Ending:
    """How a process ended."""

    code: int | None
    """Exit code, as the operating system gives it; None: it was stopped"""
    reached: str | None = None
    """The limit that it was stopped at, in words"""
    out_of_time: bool = False
    """Whether that is a limit of time"""
    said: str = ""
    """The last line of what it printed, if that is kept"""

    @property
    def described(self) -> str:
        """In words, after `the process`."""
        if self.code is None:
            return "does not answer" if self.reached is None else f"was stopped: {self.reached}"
        if self.code < 0:
            return f"ended by {_signal(-self.code)}"
        return f"ended with exit code {self.code:#x}" if self.code > 255 else f"ended with exit code {self.code}"


class Died(Exception):
    """A process has ended without an answer."""

    def __init__(self, ending: Ending) -> None:
        super().__init__(ending)
        self.ending = ending

    def __str__(self) -> str:
        return self.ending.described


class Child:
    """A command in a process of its own, which ends with the block, when it is closed or no longer known.

    It is a module that talks to its `Parent`; one that does not `talk` is but waited for, and what it prints to
    standard output goes nowhere. Its session is its own: Ctrl-C is for this process. What it prints is kept if its
    output is limited, or if it does not talk; else it goes where this process's errors go.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        environment: Mapping[str, str] | None = None,
        folder: Path | None = None,
        limits: Limits = UNLIMITED,
        talks: bool = True,
    ) -> None:
        """`folder` is the current one there."""
        family = Family(limited=math.isfinite(limits.time))
        keeps = not talks or math.isfinite(limits.output)
        self._process = process = subprocess.Popen(
            command,
            env={**(usual_environment() if environment is None else environment), **family.mark},
            cwd=folder,
            stdin=subprocess.PIPE if talks else subprocess.DEVNULL,
            stdout=subprocess.PIPE if talks else subprocess.DEVNULL,
            stderr=subprocess.PIPE if keeps else None,
            start_new_session=True,
        )
        _limit_processor_time(process, limits)
        self.pid = process.pid
        self._is_limited = math.isfinite(limits.time)
        self._output = None if process.stderr is None else _Output(process.stderr)
        self._longest = math.inf if math.isinf(limits.output) else _LONGEST * 1e6
        self._watch = Watch(process, family, limits, self._output)
        self._end = weakref.finalize(self, _ended, process, family, self._watch)

    @property
    def spent(self) -> float:
        """[s] of its time so far, if that is limited."""
        return self._watch.spent

    def allow(self, seconds: float | None) -> None:
        """From now on it may take so much time, whatever it has taken; None: as much as it likes."""
        self._watch.allow(seconds)

    def interrupt(self) -> None:
        """As by Ctrl-C."""
        with contextlib.suppress(OSError):
            self._process.send_signal(signal.SIGINT if sys.platform != "win32" else signal.SIGTERM)

    def say(self, content: object) -> None:
        """One frame; raises `Died`, and what `pickle` does for what cannot be one."""
        assert self._process.stdin is not None
        frame = framed(content)
        try:
            send(self._process.stdin, frame)
        except (OSError, ValueError):  # it has ended, or was closed by another thread
            raise Died(self._last()) from None

    def hear(self) -> Any:
        """The next frame; raises `Died`."""
        assert self._process.stdout is not None
        try:
            return receive(self._process.stdout, self._longest)
        except LongError:
            self.close()
            self._watch.reached = self._watch.reached or f"it says more than {_LONGEST:g} MB at once"
            raise Died(self._last()) from None
        except EOFError:
            raise Died(self._last()) from None

    def heard_by(self, hear: Callable[[Any], None]) -> Ending:
        """Pass on all frames; how it has ended then."""
        while True:
            try:
                frame = self.hear()
            except Died as death:
                return death.ending
            hear(frame)

    def ending(self, patience: float | None = None) -> Ending:
        """Wait for its end, [s] if there is to be one; how it has ended, or was ended then."""
        code: int | None = None
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._process.wait(patience)
        self.close()
        said = "" if self._output is None else self._output.last_line()
        reached = self._watch.reached or self._watch.said_too_much  # it may have ended before anybody looked
        if self._is_limited and sys.platform == "linux" and code == -signal.SIGXCPU:
            reached = reached or _OUT_OF_PROCESSOR
        return Ending(
            code=code if reached is None else None,
            reached=reached,
            out_of_time=self._watch.reached is not None and self._watch.out_of_time,
            said=said,
        )

    def close(self, patience: float = 0.0) -> None:
        """End it, if it does not end itself in so many seconds when nobody asks it any more."""
        if self._end.alive and patience > 0.0:
            assert self._process.stdin is not None
            with contextlib.suppress(OSError):
                self._process.stdin.close()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(patience)
        self._end()

    def __enter__(self) -> "Child":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _last(self) -> Ending:
        return self.ending(None if self._is_limited else _PATIENCE)


class _Output:
    """What a process prints, read as it comes, of which only the end is kept."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.count = 0
        """Bytes so far"""
        self._stream = stream
        self._tail = b""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def last_line(self) -> str:
        """Of all; empty if there is none."""
        self._reader.join(timeout=1.0)  # no longer: who has escaped may hold the other end
        return (self._tail.decode("utf-8", "replace").strip().splitlines() or [""])[-1]

    def _read(self) -> None:
        while block := os.read(self._stream.fileno(), 65_536):
            self.count += len(block)
            self._tail = (self._tail + block)[-_KEPT:]
        self._stream.close()


def _signal(number: int) -> str:
    """Its name, if it has one: those of real time have none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _limit_processor_time(process: "subprocess.Popen[bytes]", limits: Limits) -> None:
    """Let the system end it, and each process that it starts, where nobody watches any more: we may be killed too.

    A limit that there is (`ulimit -t`) holds for them, and is left a second before its end: by SIGXCPU, which tells.
    """
    if sys.platform == "linux" and math.isfinite(limits.time):
        import resource

        seconds = math.ceil(limits.time * (os.cpu_count() or 1)) + 1  # its threads may use all cores until time is up
        there = [math.inf if one == resource.RLIM_INFINITY else one for one in resource.getrlimit(resource.RLIMIT_CPU)]
        hard = int(min(seconds + 1, there[1]))
        soft = int(max(1, min(seconds, there[0], hard - 1)))
        with contextlib.suppress(ProcessLookupError):
            resource.prlimit(process.pid, resource.RLIMIT_CPU, (soft, hard))


def _ended(process: "subprocess.Popen[bytes]", family: Family, watch: Watch) -> None:
    watch.close()
    family.kill(process)
    process.wait()
    for pipe in (process.stdin, process.stdout):
        with contextlib.suppress(OSError):
            if pipe is not None:
                pipe.close()
