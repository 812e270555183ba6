"""Servers of `fork_server` that are forked from the command, which has imported their modules.

Those of the product are new Pythons: most of a command's time would be that of their imports.
"""

import atexit
import importlib
import os
import select
import signal
import socket
import subprocess
import sys
import traceback
import weakref
from collections.abc import Mapping
from contextlib import suppress

from orchestration.foundation.processes import family, fork_server, fork_server_process


class ForkedServer(fork_server.ForkServer):
    """A server, forked from this process."""

    def __init__(self, module: str, environment: Mapping[str, str]) -> None:
        own, its = socket.socketpair()
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        self.pid = os.fork()
        if self.pid == 0:
            _serve(module, its, environment)
        its.close()
        self._process, self._connection = _Process(self.pid), own  # type: ignore[assignment]
        self.close = weakref.finalize(self, fork_server._end, own, self._process, os.getpid())


class _Process:
    """What a server uses of a `subprocess.Popen`."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self._handle = os.pidfd_open(pid)

    def poll(self) -> int | None:
        with suppress(subprocess.TimeoutExpired):
            self.wait(0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        poll = select.poll()
        poll.register(self._handle, select.POLLIN)
        if self.returncode is None:
            if not poll.poll(None if timeout is None else 1000.0 * timeout):
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout or 0.0)
            self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self.returncode

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)


def install() -> None:
    """Use such servers in this process."""
    fork_server._server_for = _server_for


def _server_for(module: str, environment: Mapping[str, str]) -> fork_server.ForkServer:
    """As that of the product, whose lock is taken when this process forks."""
    server = fork_server.servers.get((module,))
    if server is None or not server.is_alive:
        server = fork_server.servers[module,] = ForkedServer(module, environment)
    return server


def _serve(module: str, connection: socket.socket, environment: Mapping[str, str]) -> None:
    """Be the server in this fork of the command, and end with it; without what the command does at its end."""
    code = 1
    try:
        atexit._clear()
        weakref.finalize._registry.clear()  # type: ignore[attr-defined]
        os.setsid()
        silent = os.open(os.devnull, os.O_WRONLY)
        for descriptor, number in ((connection.fileno(), 0), (silent, 1), (silent, 2)):
            os.dup2(descriptor, number)
        os.closerange(3, os.sysconf("SC_OPEN_MAX"))
        variables = {**environment, **family.room_for_names()}
        os.environ.clear()
        os.environ.update(variables)
        request = fork_server_process.main(module, socket.socket(fileno=os.dup(0)))
        if request is not None:
            importlib.import_module(module).main(*request.arguments)
            fork_server_process._leave()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)
