"""A server of `fork_server`: imports a module, and forks processes that run its `main`.

`python -m orchestration.foundation.processes.fork_server_process MODULE` serves until the other end of the
socket that is its standard input is closed. With names of modules to import come four file descriptors: the channel
from which a new process reads its `ForkRequest` and on which its id and its exit code are answered, and its standard
streams.
"""

import atexit
import contextlib
import ctypes
import errno
import gc
import importlib
import os
import pickle
import select
import signal
import socket
import sys
import tempfile
import threading
from pathlib import Path

from orchestration.foundation.processes import channel as parent_channel
from orchestration.foundation.processes.family import NamesInPlace
from orchestration.foundation.processes.fork_server import ANSWER, LENGTH, ForkRequest, exactly

_LONGEST = 4096
"""Most bytes of names of modules"""
_PR_SET_CHILD_SUBREAPER = 36
"""The number of the option in linux/prctl.h"""


def main(module: str, connection: socket.socket) -> ForkRequest | None:
    """Serve; returns its request in each forked process, and None in the server at its end."""
    names, own = NamesInPlace(), os.getpid()
    _import([module])
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    _adopt()
    woken, waking = os.pipe()
    os.set_blocking(waking, False)
    signal.set_wakeup_fd(waking)
    running: dict[int, socket.socket] = {}
    events = select.poll()
    for descriptor in (connection.fileno(), woken):
        events.register(descriptor, select.POLLIN)
    while True:
        readable = [descriptor for descriptor, _ in events.poll()]
        if woken in readable:
            os.read(woken, 4096)
            _report(running)
        if connection.fileno() not in readable:
            continue
        modules, descriptors, _, _ = socket.recv_fds(connection, _LONGEST, 4)  # up to the next descriptors
        if not modules:
            return None
        _import(modules.decode().split())
        channel, streams = socket.socket(fileno=descriptors[0]), descriptors[1:]
        try:
            pid = os.fork()
        except OSError as error:
            _report_failure(channel, error)
        else:
            if pid == 0:
                parent_channel.parent_id = own
                signal.set_wakeup_fd(-1)
                for each in (woken, waking):
                    os.close(each)
                for other in (connection, *running.values()):
                    other.close()
                try:
                    return _become(channel, streams, names)
                except (OSError, EOFError) as error:  # also if nobody waits for it any more
                    _report_failure(channel, error)
                    sys.exit(1)
            running[pid] = channel
        for stream in streams:
            os.close(stream)


def _import(modules: list[str]) -> None:
    """Import modules, before a process is forked that needs them."""
    gc.disable()  # takes a tenth of the time of importing
    for name in modules:
        with contextlib.suppress(Exception):  # a forked process imports it again, and reports what is wrong
            importlib.import_module(name)
    gc.freeze()  # what garbage collection does not touch is not copied by a forked process
    gc.enable()


def _report(running: dict[int, socket.socket]) -> None:
    """Answer the exit codes of processes that have ended, and end what they have left, which this one has adopted."""
    with contextlib.suppress(ChildProcessError):  # none is left
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            if ended[0] in running:
                with running.pop(ended[0]) as channel, contextlib.suppress(OSError):  # the reader may have ended
                    channel.sendall(ANSWER.pack(True, os.waitstatus_to_exitcode(ended[1])))
    with contextlib.suppress(OSError):  # the kernel may not say
        for pid in map(int, Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()):
            if pid not in running:
                os.kill(pid, signal.SIGKILL)


def _adopt() -> None:
    """Become the parent of descendants whose own has ended, also of those in sessions of their own (Linux).

    Each forked process adopts its descendants while it lives, and this server what it leaves.
    """
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _report_failure(channel: socket.socket, error: Exception) -> None:
    """Answer that a process cannot start."""
    with channel, contextlib.suppress(OSError):
        channel.sendall(ANSWER.pack(False, -(getattr(error, "errno", None) or errno.EIO)))


def _become(channel: socket.socket, streams: list[int], names: NamesInPlace) -> ForkRequest:
    """Give this fork the environment, folder and streams of its request, as if it had been started with them."""
    request: ForkRequest = pickle.loads(exactly(channel, *LENGTH.unpack(exactly(channel, LENGTH.size))))
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.setsid()
    _adopt()
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.environ.clear()
    os.environ.update(request.environment)
    names.write()
    os.umask(request.umask)
    os.chdir(request.folder)
    if not getattr(sys.flags, "safe_path", False):  # it is that of the server
        sys.path[0] = request.folder
    tempfile.tempdir = None
    with channel:  # whoever knows the id may end the process, with its session and its family
        channel.sendall(ANSWER.pack(False, os.getpid()))
    return request


def _leave() -> None:
    """End this fork as Python does, but without taking its modules down, which would copy the memory of the server.

    Returns if a thread is still to be waited for.
    """
    if any(not thread.daemon for thread in threading.enumerate() if thread is not threading.current_thread()):
        return
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):  # it is closed
            stream.flush()
    ctypes.CDLL(None).exit(0)  # with what libraries have to do at the end


if __name__ == "__main__":
    (name,) = sys.argv[1:]
    request = main(name, socket.socket(fileno=os.dup(0)))
    if request is not None:
        module = importlib.import_module(name)
        sys.argv = [str(module.__file__), *request.arguments]
        try:
            module.main(*request.arguments)
        except MemoryError:
            sys.exit(f"{name}: there is not enough memory")
        _leave()
