"""What `test_fork_server` has forked: does what its first argument says, and sends what is asked."""

import atexit
import ctypes
import os
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path

from orchestration.foundation.processes.channel import Parent
from tests.patience import PATIENCE

IMPORTED_BY = os.getpid()
"""The process that has imported this module"""
tempfile.gettempdir()  # which is remembered


def main(what: str, *arguments: str) -> None:
    """`look`, `fail`, `exit`, `kill`, `print`, `look late`, `leave` or `end in parts`."""
    if what == "look late":
        while os.getppid() == IMPORTED_BY:
            time.sleep(0.01)
        for _ in Parent():
            pass
        time.sleep(PATIENCE)
    if what == "look":
        shown = Path("/proc/self/environ").read_bytes().split(b"\0")
        Parent().send(
            {
                "arguments": arguments,
                "imported by": IMPORTED_BY,
                "process": os.getpid(),
                "session": os.getsid(0),
                "folder": os.getcwd(),
                "path": sys.path[0],
                "variable": os.environ.get("OF_ITS_OWN"),
                "other variable": os.environ.get("OF_ANOTHER"),
                "temporary": tempfile.gettempdir(),
                "families": [each.decode() for each in shown if each.startswith(b"QUADCOSIM_FAMILY=")],
                "interrupt": signal.getsignal(signal.SIGINT) is signal.SIG_IGN,  # `Parent` has set it so
                "loaded": "colorsys" in sys.modules,
                "open": sorted(os.listdir("/proc/self/fd")),
            }
        )
    if what == "leave":  # a process in a session and an environment of its own, whose parent has ended
        told, telling = os.pipe()
        if os.fork() == 0:
            os.setsid()
            if os.fork() == 0:
                os.write(telling, str(os.getpid()).encode())
                os.execve("/bin/sleep", ["sleep", str(PATIENCE)], {})
            os._exit(0)
        parent = Parent()
        parent.send(int(os.read(told, 20)))
        for _ in parent:
            pass
    if what == "fail":
        raise KeyError("what was wrong")
    if what == "exit":
        sys.exit(int(arguments[0]))
    if what == "kill":
        os.kill(os.getpid(), int(arguments[0]))
    if what == "print":
        print(arguments[0], file=sys.stderr)
    if what == "end in parts":
        os.dup2(2, 1)
        print("of Python")
        ctypes.CDLL(None).puts(b"of C")
        atexit.register(print, "at exit")
        if "thread" in arguments:
            threading.Timer(0.1, print, ("of a thread",)).start()
