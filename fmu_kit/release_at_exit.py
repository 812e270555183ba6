"""Unloading an FMU from a host that is a Python program, without corrupting its heap.

The library of pythonfmu 0.7.0 has a static pointer. As the process ends, a destructor frees what it points to, and a
function of the library that runs later releases it again: sometimes the host then ends with SIGABRT after its work.
Once the pointer has been released by a call, both do nothing.
"""

import atexit
import os
import sys
from pathlib import Path

_libraries: set[str] = set()


def release_at_exit(resources: str | None, model: str) -> None:
    """Have the library of this FMU release its pointer before the process ends; called for every instance.

    Not where the library itself started Python, since releasing the pointer would end Python.
    """
    if resources is None or not sys.orig_argv or not sys.platform.startswith("linux"):
        return
    if not _libraries:
        atexit.register(_release)
    _libraries.add(str(Path(resources).parent / "binaries" / "linux64" / f"{model}.so"))


def _release() -> None:
    import ctypes  # imported late: an FMU works without it where it is missing

    for library in _libraries:
        try:
            loaded = ctypes.CDLL(library, os.RTLD_NOLOAD)
        except OSError:  # already unloaded, which is harmless
            continue
        loaded.finalizePythonInterpreter()
