"""The loader library of an FMU, compiled where there is a C compiler: with it, a host on Linux needs no Python before.

pythonfmu's library for Linux leaves the symbols of Python open, so a host that is not Python must have loaded a
libpython before it. `loader.c` does that itself. It is packed under the name of the model, pythonfmu's beside it.
"""

import functools
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from fmu_kit import libraries

SOURCE = Path(__file__).with_name("loader.c")
PLATFORM = "binaries/linux64"
BESIDE = f"{PLATFORM}/libpythonfmu-export.so"
"""Where pythonfmu's library is in an FMU that has a loader; `loader.c` opens it by this name."""
GUID_FILE = "resources/guid.txt"
"""What the loader compares the GUID with that a host gives."""

_OPTIONS = (
    *("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden"),
    *("-s", "-Wl,--build-id=none", "-Wl,-z,now"),  # nothing that differs from one build to the next
    *("-ldl", "-lpthread"),
)


class LoaderError(Exception):
    """The loader cannot be compiled here; the text says why."""


def compiler() -> str | None:
    """A C compiler for the one platform that has a loader, if this machine is of it and has one."""
    here = sys.platform == "linux" and platform.machine() == "x86_64"
    return shutil.which("cc") if here else None


def packed(files: dict[str, bytes], model: str) -> dict[str, bytes]:
    """An FMU's files, by their place, with the loader before pythonfmu's library for Linux.

    Raises `LoaderError` if there is no compiler, or one that fails.
    """
    name = f"{PLATFORM}/{model}.so"
    return {**files, name: compiled(), BESIDE: files[name]}


@functools.cache
def compiled() -> bytes:
    """The loader library: from one compiler, always the same bytes, which are kept in the user's cache."""
    cc = compiler()
    if cc is None:
        raise LoaderError("no C compiler that is called cc")
    return libraries.content("loader", {SOURCE.name: SOURCE.read_bytes()}, _OPTIONS, lambda: _compiled_by(cc))


def _compiled_by(cc: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder, "loader.so")
        command = [cc, "-x", "c", "-", "-o", str(library), *_OPTIONS]  # from no file, whose path it would hold
        done = subprocess.run(command, input=SOURCE.read_bytes(), capture_output=True, check=False)
        if done.returncode != 0:
            lines = done.stderr.decode(errors="replace").strip().splitlines() or ["no output"]
            raise LoaderError(f"{cc}: {lines[0]}")
        return library.read_bytes()
