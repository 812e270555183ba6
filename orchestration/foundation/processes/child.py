"""A child process: started, limited and ended with all its descendants, with messages to and from it."""

import contextlib
import math
import os
import secrets
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, TypeVar

from orchestration.foundation.processes.channel import LongError, read_frame, to_frame, write_frame
from orchestration.foundation.processes.family import Family, Process
from orchestration.foundation.processes.fork_server import forked
from orchestration.foundation.processes.limit_enforcement import Watch
from orchestration.foundation.processes.resource_limits import UNLIMITED, Limits
from orchestration.foundation.processes.subprocesses import Module
from orchestration.foundation.processes.subprocesses import environment as usual_environment
from orchestration.foundation.processes.typed_frames import FrameError, expect

Result = TypeVar("Result")

_KEPT = 16_384
"""Bytes kept of the end of the process's output"""
_SECRET = 16
"""Bytes of the secret with which its answers begin"""
_NO_MESSAGE = "it sends what is no message of quadcosim"
_OUT_OF_PROCESSOR = "it uses more processor time than the system allows (ulimit -t)"
_PATIENCE = 60.0
"""Time to wait for the exit of a process that has closed its channel [s]"""


@dataclass(frozen=True, kw_only=True)
class Ending:
    """How a process ended."""

    code: int | None
    """Exit code of the operating system; None: it was stopped"""
    reached: str | None = None
    """The limit at which it was stopped, in words"""
    out_of_time: bool = False
    """Whether that is a limit of time"""
    last_line: str = ""
    """Last line of its output, if that is kept"""

    @property
    def description(self) -> str:
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
        return self.ending.description


class Child:
    """A command in a separate process, which ends with the block, when it is closed or garbage-collected.

    It is a module that exchanges messages with its `Parent`; one that does not `communicate` is only waited for, and
    its standard output is discarded. It has its own session, so Ctrl-C reaches this process only. The end of its output
    is kept if the output is limited or the child does not communicate; else it goes to this process's standard error.
    """

    def __init__(
        self,
        what: Module | Sequence[str],
        *,
        environment: Mapping[str, str] | None = None,
        folder: Path | None = None,
        limits: Limits = UNLIMITED,
        communicates: bool = True,
    ) -> None:
        """`what` is a module of this project, or a command; `folder` is its working directory."""
        family = Family(limited=math.isfinite(limits.time))
        keeps = not communicates or math.isfinite(limits.output)
        environment = {**(usual_environment() if environment is None else environment), **family.mark}
        self._process = process = _started(what, environment, folder, (communicates, communicates, keeps))
        _limit_processor_time(process, limits)
        self.pid = process.pid
        self._is_limited = math.isfinite(limits.time)
        self._output = None if process.stderr is None else _Output(process.stderr)
        self._longest_message, self._secret = limits.message, b""
        self._watch = Watch(process, family, limits, self._output)
        self._end = weakref.finalize(self, _terminate, process, family, self._watch)

    @property
    def spent(self) -> float:
        """[s] of its time so far, if that is limited."""
        return self._watch.spent

    def allow(self, seconds: float | None) -> None:
        """Limit its time from now on to `seconds`, whatever it has used; None: no limit."""
        self._watch.allow(seconds)

    def interrupt(self) -> None:
        """Send it the signal of Ctrl-C."""
        with contextlib.suppress(OSError):
            self._process.send_signal(signal.SIGINT if sys.platform != "win32" else signal.SIGTERM)

    def send(self, content: object) -> None:
        """Send one message; raises `Died`, and what `pickle` raises."""
        assert self._process.stdin is not None
        secret = self._secret or secrets.token_bytes(_SECRET)
        frame = to_frame(content, secret)
        self._secret = secret
        try:
            write_frame(self._process.stdin, frame)
        except (OSError, ValueError):  # it has ended, or was closed by another thread
            raise Died(self._ending_now()) from None

    def receive(self, kind: Any = Any) -> Any:
        """The next message, which must fit `kind`, an annotation; raises `Died`, also if it does not."""
        assert self._process.stdout is not None
        try:
            return expect(read_frame(self._process.stdout, self._longest_message * 1e6, self._secret), kind)
        except FrameError as error:
            raise self._ended_for(error) from None
        except (EOFError, OSError, ValueError):  # it has ended, or was closed by another thread
            raise Died(self._ending_now()) from None

    def receive_by(self, handle: Callable[[Any], Result], kind: Any = Any) -> Result:
        """Pass the next message, as `receive`, to `handle`, which may raise `FrameError`: then this raises `Died`."""
        message = self.receive(kind)
        try:
            return handle(message)
        except FrameError as error:
            raise self._ended_for(error) from None

    def receive_all(self, handle: Callable[[Any], None], kind: Any = Any) -> Ending:
        """Pass all messages to `handle`, as `receive_by`; returns how the process ended."""
        while True:
            try:
                self.receive_by(handle, kind)
            except Died as death:
                return death.ending

    def ending(self, patience: float | None = None) -> Ending:
        """Wait for its end, at most `patience` [s], and then end it; returns how it ended."""
        code: int | None = None
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._process.wait(patience)
        self.close()
        last_line = "" if self._output is None else self._output.last_line()
        reached = self._watch.reached or self._watch.excess_output  # it may have ended between two checks
        if self._is_limited and sys.platform == "linux" and code == -signal.SIGXCPU:
            reached = reached or _OUT_OF_PROCESSOR
        return Ending(
            code=code if reached is None else None,
            reached=reached,
            out_of_time=self._watch.reached is not None and self._watch.out_of_time,
            last_line=last_line,
        )

    def close(self, patience: float = 0.0) -> None:
        """Close its input, and end it unless it ends within `patience` [s]."""
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

    def _ended_for(self, error: FrameError) -> Died:
        """Its death, of a message that is none: foreign code in it may write what it likes into its streams."""
        self.close()
        too_long = f"it sends more than {self._longest_message:g} MB at once"
        self._watch.reached = self._watch.reached or (too_long if isinstance(error, LongError) else _NO_MESSAGE)
        return Died(self._ending_now())

    def _ending_now(self) -> Ending:
        return self.ending(None if self._is_limited else _PATIENCE)


def _started(
    what: Module | Sequence[str], environment: Mapping[str, str], folder: Path | None, piped: tuple[bool, bool, bool]
) -> Process:
    """In a new session; `piped` as in `forked`."""
    if isinstance(what, Module) and sys.platform == "linux":
        with contextlib.suppress(ConnectionError):  # a new Python shows what is wrong with the module
            return forked(what, environment=environment, folder=folder, piped=piped)
    unpiped = (subprocess.DEVNULL, subprocess.DEVNULL, None)
    stdin, stdout, stderr = (subprocess.PIPE if pipe else other for pipe, other in zip(piped, unpiped))
    return subprocess.Popen(
        what.command if isinstance(what, Module) else what,
        env=environment, cwd=folder, stdin=stdin, stdout=stdout, stderr=stderr, start_new_session=True,
    )  # fmt: skip


class _Output:
    """The output of a process, read as it comes; only its end is kept."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.count = 0
        """Bytes so far"""
        self._stream = stream
        self._tail = b""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def last_line(self) -> str:
        """The last line of the output; empty if there is none."""
        self._reader.join(timeout=1.0)  # no longer: an escaped process may hold the other end
        return (self._tail.decode("utf-8", "replace").strip().splitlines() or [""])[-1]

    def _read(self) -> None:
        while block := os.read(self._stream.fileno(), 65_536):
            self.count += len(block)
            self._tail = (self._tail + block)[-_KEPT:]
        self._stream.close()


def _signal(number: int) -> str:
    """The name of a signal; real-time signals have none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def _limit_processor_time(process: Process, limits: Limits) -> None:
    """Limit the processor time of it and its descendants by the system too, in case this process is killed.

    An existing limit (`ulimit -t`) remains, with the soft limit a second below the hard one: SIGXCPU identifies it.
    """
    if sys.platform == "linux" and math.isfinite(limits.time):
        import resource

        seconds = math.ceil(limits.time * (os.cpu_count() or 1)) + 1  # its threads may use all cores
        existing = [
            math.inf if one == resource.RLIM_INFINITY else one for one in resource.getrlimit(resource.RLIMIT_CPU)
        ]
        hard = int(min(seconds + 1, existing[1]))
        soft = int(max(1, min(seconds, existing[0], hard - 1)))
        with contextlib.suppress(ProcessLookupError):
            resource.prlimit(process.pid, resource.RLIMIT_CPU, (soft, hard))


def _terminate(process: Process, family: Family, watch: Watch) -> None:
    watch.close()
    family.kill(process)
    process.wait()
    for pipe in (process.stdin, process.stdout):
        with contextlib.suppress(OSError):
            if pipe is not None:
                pipe.close()
