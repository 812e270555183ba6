"""What `faults.c` is told: which call fails, on files of which folder or by libraries of which, and how."""

import ctypes
import errno
import os
import shutil
import struct
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import platformdirs

SOURCE = Path(__file__).with_name("faults.c")
VARIABLE = "QUADCOSIM_TESTS_FAULTS"
CALLS = ("write", "open", "rename", "fsync", "mmap", "ftruncate", "malloc")
KILL, SHORT = -1, -2
ENDLESS = 2**62
_HEAD = struct.Struct(f"{len(CALLS)}q5q")
_PATH_MAX = 4096
LIBRARIES = platformdirs.user_cache_dir("quadcosim")
"""Where what was compiled from the C of engines, timetable and scheduler is"""


@dataclass(frozen=True)
class Fault:
    """What happens at a call."""

    call: str
    how: int
    text: str
    stays: bool = False
    """Whether later calls fail, too"""


FAULTS = (
    Fault("write", errno.ENOSPC, "the disk is full", stays=True),
    Fault("write", errno.EIO, "an input/output error"),
    Fault("write", SHORT, "half is written"),
    Fault("write", KILL, "killed"),
    Fault("open", errno.EMFILE, "too many open files"),
    Fault("open", KILL, "killed"),
    Fault("rename", errno.EIO, "an input/output error"),
    Fault("rename", KILL, "killed"),
    Fault("fsync", errno.EIO, "an input/output error"),
    Fault("fsync", KILL, "killed"),
    Fault("mmap", errno.ENOMEM, "no memory"),
    Fault("ftruncate", errno.ENOSPC, "the disk is full"),
    Fault("malloc", errno.ENOMEM, "no memory"),
)
KILLED = Fault("write", KILL, "killed")


class Plan:
    """A file that processes with the shim share: what is to fail, and how many calls there were."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def write(self, folder: Path, fault: Fault | None = None, n: int = 0) -> None:
        """The `n`-th call is to have this fault; without one, calls are counted only."""
        what: tuple[int, ...] = (-1, 0, 0, 0)
        if fault is not None:
            what = (CALLS.index(fault.call), n, ENDLESS if fault.stays else n, fault.how)
        head = _HEAD.pack(*[0] * len(CALLS), 0, *what)
        folders = ((os.fsencode(each) + b"/").ljust(_PATH_MAX, b"\0") for each in (folder, LIBRARIES))
        self.path.write_bytes(head + b"".join(folders))

    def load(self) -> None:
        """Let it hold in this process, which has the shim, and in those that it starts."""
        os.environ[VARIABLE] = str(self.path)
        ctypes.CDLL(None).faults_load(os.fsencode(self.path))

    def calls(self) -> dict[str, int]:
        """How many calls of each kind there were."""
        return dict(zip(CALLS, _HEAD.unpack_from(self.path.read_bytes())))

    @property
    def struck(self) -> int:
        """How many of them failed."""
        return int(_HEAD.unpack_from(self.path.read_bytes())[len(CALLS)])


def lack() -> str | None:
    """Why there is no shim on this machine; None if there can be."""
    if sys.platform != "linux":
        return "calls of the operating system are made to fail on Linux only"
    return None if shutil.which("cc") else "no C compiler called cc"


def compile_into(folder: Path) -> Path:
    """The shim as a library."""
    library = folder / "faults.so"
    words = ("cc", "-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", str(SOURCE), "-o", str(library), "-ldl")
    subprocess.run(words, check=True)
    return library
