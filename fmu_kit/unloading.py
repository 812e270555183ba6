"""How an FMU leaves a host that is a Python program, without breaking its heap.

The library of pythonfmu 0.7.0 holds a static pointer. As the process ends, its destructor frees what it points
to, and a function of the library that runs later releases it once more: now and then the host ends with
SIGABRT, all work done. Once the pointer has been released by a call, both do nothing.
"""

import atexit
import os
import sys
from pathlib import Path

_libraries: set[str] = set()


def release_at_exit(resources: str | None, model: str) -> None:
    """Have the library that runs this FMU let go before the process ends; called for every instance.

    Not where Python was started by the library itself: there, letting go is to end Python.
    """
    if resources is None or not sys.orig_argv or not sys.platform.startswith("linux"):
        return
    if not _libraries:
        atexit.register(_release)
    _libraries.add(str(Path(resources).parent / "binaries" / "linux64" / f"{model}.so"))


def _release() -> None:
    import ctypes  # not sooner: where it cannot be imported, the FMU does without

    for library in _libraries:
        try:
            loaded = ctypes.CDLL(library, os.RTLD_NOLOAD)
        except OSError:  # unloaded before the end, which does no harm
            continue
        loaded.finalizePythonInterpreter()
