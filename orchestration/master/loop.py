"""The compiled loop as a library: made once by the C compiler of this machine, and kept in the user's cache."""

import ctypes
import functools
import hashlib
import os
import platform
import shutil
from pathlib import Path
from typing import Any

from fmu_kit.bundle import PackagingError
from fmu_kit.native.compiler import OPTIONS, compiled_here
from orchestration.errors import QuadcosimError

FILES = tuple(Path(__file__).with_name(name) for name in ("loop.c", "condition.h"))
"""What it is made of"""


@functools.cache
def library() -> Any:
    """The function `fly` of loop.c; raises `QuadcosimError` that says what stands in the way."""
    sources = {path.name: path.read_bytes() for path in FILES}
    path = _place(sources)
    try:
        if not path.is_file():
            _keep(path, compiled_here(sources, "loop.c", mathematics="libm"))
        fly = ctypes.CDLL(str(path)).fly
    except (PackagingError, OSError) as error:
        raise QuadcosimError(str(error)) from error
    fly.restype = ctypes.c_int
    fly.argtypes = (ctypes.c_void_p, ctypes.c_int64)
    return fly


def _place(sources: dict[str, bytes]) -> Path:
    """By all that decides what is in it."""
    import platformdirs

    cc = Path(shutil.which("cc") or "").resolve()
    compiler = (str(cc), cc.stat().st_size, cc.stat().st_mtime_ns)
    content = hashlib.sha256(repr((sorted(sources.items()), OPTIONS, compiler, platform.machine())).encode())
    return Path(platformdirs.user_cache_dir("quadcosim")) / "loop" / f"{content.hexdigest()}.so"


def _keep(path: Path, content: bytes) -> None:
    """Whole or not at all, whoever else makes it at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f"{path.name}.{os.getpid()}")
    fresh.write_bytes(content)
    fresh.replace(path)
