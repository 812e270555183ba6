"""Processes forked from one that has already imported their module (Linux).

Importing a module of this project takes a new Python up to 0.4 s, a fork takes milliseconds. A server is a process that
has imported one module, and what its processes load, and does nothing but fork; there is one for each module and each
set of the variables that a process reads when it starts. A server ends with this process.
"""

import contextlib
import os
import pickle
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from orchestration.foundation.processes.family import room_for_names
from orchestration.foundation.processes.subprocesses import Module

LENGTH = struct.Struct("<Q")
"""Length of a request, sent before it"""
ANSWER = struct.Struct("<?q")
"""False and the process's id, or minus the error number if it cannot start; True and its exit code, at its end"""
_READ_AT_START = ("PYTHON", "LD_", "LC_", "LANG", "OPENBLAS_", "OMP_", "MKL_", "MALLOC_", "GLIBC_", "COVERAGE_", "TZ")
"""Prefixes of the environment variables that are read only when a process starts or loads a library"""
_SLOW_TO_LOAD = ("fmpy.validation", "lxml.etree", "numpy.ctypeslib", "platformdirs", "pydantic.dataclasses")
"""Modules that a forked process is expected to load if this process has"""
_PATIENCE = 10.0
"""Time within which an unused server must exit [s]"""
_STARTS_WITHIN = 60.0
"""Time within which a server must have forked [s], else it is replaced"""
_Pipes = tuple[IO[bytes] | None, IO[bytes] | None, IO[bytes] | None]


@dataclass(frozen=True, kw_only=True)
class ForkRequest:
    """What a forked process is to be."""

    arguments: tuple[str, ...]
    environment: Mapping[str, str]
    folder: str
    """its working directory"""
    umask: int


class ForkedProcess:
    """A process that a server has forked, with what `Child` uses of a `subprocess.Popen`."""

    def __init__(self, pid: int, pipes: _Pipes, channel: socket.socket) -> None:
        """`channel` is where its exit code will be reported."""
        self.pid = pid
        self.stdin, self.stdout, self.stderr = pipes
        self.returncode: int | None = None
        self._channel, self._reading = channel, threading.Lock()
        weakref.finalize(self, channel.close)  # not before: another thread may wait for it

    def poll(self) -> int | None:
        """Its exit code; None while it runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Its exit code, when it has ended; raises `subprocess.TimeoutExpired` after `timeout` [s]."""
        if self.returncode is None and not _readable(self._channel, timeout):
            raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0.0)
        with self._reading:
            if self.returncode is None:
                try:
                    _, self.returncode = _answer(self._channel)
                except (EOFError, ConnectionError):  # the server has ended, and this process with it
                    self.returncode = -signal.SIGKILL
        return self.returncode

    def send_signal(self, sig: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, sig)


class ForkServer:
    """The process that has imported a module."""

    def __init__(self, module: str, environment: Mapping[str, str]) -> None:
        with contextlib.ExitStack() as stack:
            own, its = (stack.enter_context(end) for end in socket.socketpair())
            self._process = subprocess.Popen(
                [sys.executable, "-m", "orchestration.foundation.processes.fork_server_process", module],
                env={**environment, **room_for_names()},
                stdin=its.fileno(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
            )  # fmt: skip
            stack.pop_all()
        its.close()
        self.pid = self._process.pid
        self._connection = own
        self.close = weakref.finalize(self, _end, own, self._process, os.getpid())

    @property
    def is_alive(self) -> bool:
        """Whether it can fork."""
        return self.close.alive and self._process.poll() is None

    def fork(self, request: ForkRequest, loads: list[str], piped: tuple[bool, bool, bool]) -> ForkedProcess:
        """A process that has loaded some modules; `piped` as in `forked`.

        Raises `ConnectionError` or `EOFError` if the server has ended or does not answer, `OSError` if it cannot fork.
        """
        with contextlib.ExitStack() as own, contextlib.ExitStack() as its:
            channel, answering = socket.socketpair()  # of this process alone: an interrupt here disturbs no other
            own.enter_context(channel)
            descriptors = [its.enter_context(answering).fileno()]
            pipes: list[IO[bytes] | None] = []
            for stream, is_piped in enumerate(piped):
                end, pipe = _ends(stream, is_piped)
                its.callback(os.close, end)
                descriptors.append(end)
                pipes.append(None if pipe is None else own.enter_context(pipe))
            socket.send_fds(self._connection, [" ".join(loads).encode()], descriptors)
            its.close()
            content = pickle.dumps(request)
            channel.settimeout(_STARTS_WITHIN)
            try:
                with contextlib.suppress(ConnectionError):  # if it could not fork, it has answered why
                    channel.sendall(LENGTH.pack(len(content)) + content)
                has_ended, number = _answer(channel)
            except TimeoutError:  # it is stopped
                raise ConnectionError("the process to fork from does not answer") from None
            channel.settimeout(None)
            if has_ended:
                raise OSError(f"a process has ended before it could start, with exit code {number}")
            if number < 0:
                raise OSError(-number, os.strerror(-number))
            own.pop_all()
        stdin, stdout, stderr = pipes
        return ForkedProcess(number, (stdin, stdout, stderr), channel)


servers: dict[tuple[object, ...], ForkServer] = {}
"""Servers by module and variables"""
_lock = threading.Lock()


def forked(
    module: Module, *, environment: Mapping[str, str], folder: Path | None, piped: tuple[bool, bool, bool]
) -> ForkedProcess:
    """A process in a new session that runs `main` of a module.

    `piped` states which of its standard streams are pipes to this process; of the others, input is empty, output is
    discarded, and errors go where those of this process go. Raises `OSError` if it cannot be started, as
    `ConnectionError` if the server ends, perhaps because importing the module ends it.
    """
    request = ForkRequest(
        arguments=module.arguments, environment=dict(environment), folder=str(folder or os.getcwd()), umask=_umask()
    )
    loads = [module.name, *module.loads, *(name for name in _SLOW_TO_LOAD if name in sys.modules)]
    for _ in range(2):  # the server may just have been killed
        server = _server_for(module.name, environment)
        try:
            return server.fork(request, loads, piped)
        except (ConnectionError, EOFError):
            server.close()
        except OSError:
            if server.close.alive:  # else another thread has closed it meanwhile
                raise
    raise ConnectionError(f"the process from which {module.name} is forked has ended")


def _server_for(module: str, environment: Mapping[str, str]) -> ForkServer:
    key = (module, *sorted(item for item in environment.items() if item[0].startswith(_READ_AT_START)))
    with _lock:
        server = servers.get(key)
        if server is None or not server.is_alive:
            server = servers[key] = ForkServer(module, environment)
        return server


def _end(connection: socket.socket, process: "subprocess.Popen[bytes]", owner: int) -> None:
    """Close the connection to a server, which ends then; a fork of its owner only forgets it."""
    connection.close()
    if os.getpid() != owner:
        process.returncode = 0
        return
    try:
        process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:  # it is stopped
        process.kill()
        process.wait()


def _forget() -> None:
    """In a fork of this process: it starts servers of its own, and does not keep those of this process from ending."""
    for server in servers.values():
        server.close()
    servers.clear()
    _lock.release()


if sys.platform != "win32":
    os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_forget)


def exactly(connection: socket.socket, count: int) -> bytes:
    """So many bytes; raises `EOFError` if the other end is closed before."""
    content = b""
    while len(content) < count:
        block = connection.recv(count - len(content))
        if not block:
            raise EOFError
        content += block
    return content


def _answer(channel: socket.socket) -> tuple[bool, int]:
    has_ended, number = ANSWER.unpack(exactly(channel, ANSWER.size))
    return has_ended, number


def _ends(stream: int, is_piped: bool) -> tuple[int, IO[bytes] | None]:
    """Of a standard stream the file descriptor for the new process, and this process's end of its pipe."""
    if is_piped:
        reading, writing = os.pipe()
        return (reading, open(writing, "wb")) if stream == 0 else (writing, open(reading, "rb"))
    if stream == 2:
        with contextlib.suppress(OSError):  # it may be closed
            if os.get_inheritable(2):  # else it is not for errors: it was closed, and another file was opened
                return os.dup(2), None
    return os.open(os.devnull, os.O_RDONLY if stream == 0 else os.O_WRONLY), None


def _umask() -> int:
    """Of this process, from where the system shows it: `os.umask` cannot read it without changing it."""
    try:
        return int(Path("/proc/self/status").read_text().partition("Umask:")[2].split()[0], 8)
    except OSError:  # there is no /proc
        umask = os.umask(0o077)
        os.umask(umask)
        return umask


def _readable(channel: socket.socket, timeout: float | None) -> bool:
    poll = select.poll()
    poll.register(channel, select.POLLIN)
    return bool(poll.poll(None if timeout is None else 1000.0 * timeout))
