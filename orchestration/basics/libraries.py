"""Libraries that the C compiler of this machine makes of C files: made once, and kept in the user's cache."""

import hashlib
import os
import platform
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fmu_kit.bundle import PackagingError
from orchestration.basics.errors import QuadcosimError


def kept(folder: str, sources: Mapping[str, bytes], how: Any, compiled: Callable[[], bytes]) -> Path:
    """The library that `compiled` makes of `sources`, in the cache's `folder`; `how` is what else decides its content.

    Raises `QuadcosimError` that says what stands in the way.
    """
    try:
        path = _place(folder, sources, how)
        if not path.is_file():
            _keep(path, compiled())
    except (PackagingError, OSError) as error:
        raise QuadcosimError(str(error)) from error
    return path


def _place(folder: str, sources: Mapping[str, bytes], how: Any) -> Path:
    """By all that decides what is in it."""
    import platformdirs

    cc = Path(shutil.which("cc") or "").resolve()
    compiler = (str(cc), cc.stat().st_size, cc.stat().st_mtime_ns)
    content = hashlib.sha256(repr((sorted(sources.items()), how, compiler, platform.machine())).encode())
    return Path(platformdirs.user_cache_dir("quadcosim")) / folder / f"{content.hexdigest()}.so"


def _keep(path: Path, content: bytes) -> None:
    """Whole or not at all, whoever else makes it at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f"{path.name}.{os.getpid()}")
    fresh.write_bytes(content)
    fresh.replace(path)
