"""The loader library of an FMU, compiled if there is a C compiler: with it, a host on Linux need not load Python.

pythonfmu's library for Linux leaves the symbols of Python undefined, so a host that is not Python must have loaded a
libpython before it. `loader.c` does that. It is packed under the name of the model, with pythonfmu's library beside it.
"""

import functools
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

from fmu_kit import libraries
from fmu_kit.scratch import temporary_folder

SOURCE = Path(__file__).with_name("loader.c")
PLATFORM = "binaries/linux64"
BESIDE = f"{PLATFORM}/libpythonfmu-export.so"
"""The path of pythonfmu's library in an FMU that has a loader; `loader.c` opens it by this name."""
GUID_FILE = "resources/guid.txt"
"""The file with the GUID, with which the loader compares that of the host."""

_OPTIONS = (
    *("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden"),
    *("-s", "-Wl,--build-id=none", "-Wl,-z,now"),  # nothing that differs between builds
    *("-ldl", "-lpthread"),
)


class LoaderError(Exception):
    """The loader cannot be compiled on this machine, for the reason that the text gives."""


def compiler() -> str | None:
    """The C compiler of this machine, if it is of the one platform that has a loader."""
    here = sys.platform == "linux" and platform.machine() == "x86_64"
    return shutil.which("cc") if here else None


def with_loader(files: dict[str, bytes], model: str) -> dict[str, bytes]:
    """An FMU's files, by path, with the loader in front of pythonfmu's library for Linux.

    Raises `LoaderError` if there is no compiler, or one that fails.
    """
    name = f"{PLATFORM}/{model}.so"
    return {**files, name: compiled(), BESIDE: files[name]}


@functools.cache
def compiled() -> bytes:
    """The loader library, from the user's cache; one compiler always makes the same bytes."""
    cc = compiler()
    if cc is None:
        raise LoaderError("no C compiler that is called cc")
    return libraries.cached_content("loader", {SOURCE.name: SOURCE.read_bytes()}, _OPTIONS, lambda: _compiled_by(cc))


def _compiled_by(cc: str) -> bytes:
    with temporary_folder() as folder:
        library = folder / "loader.so"
        command = [
            cc,
            "-x",
            "c",
            "-",
            "-o",
            str(library),
            *_OPTIONS,
        ]  # from stdin: the path of a file would be in the library
        environment = {**os.environ, "TMPDIR": str(folder)}
        done = subprocess.run(command, input=SOURCE.read_bytes(), env=environment, capture_output=True, check=False)
        if done.returncode != 0:
            lines = done.stderr.decode(errors="replace").strip().splitlines() or ["no output"]
            raise LoaderError(f"{cc}: {lines[0]}")
        return library.read_bytes()
