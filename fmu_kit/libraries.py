"""Libraries that the C compiler of this machine makes of C files: made once, and kept in the user's cache."""

import contextlib
import functools
import hashlib
import os
import platform
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any


def kept(folder: str, sources: Mapping[str, bytes], how: Any, compiled: Callable[[], bytes]) -> Path:
    """The library that `compiled` makes of `sources`, in the cache's `folder`; `how` is what else decides its content.

    Raises `OSError` where it cannot be kept, and what `compiled` raises.
    """
    path = _place(folder, sources, how)
    if not path.is_file():
        _keep(path, compiled())
    return path


def content(folder: str, sources: Mapping[str, bytes], how: Any, compiled: Callable[[], bytes]) -> bytes:
    """The bytes of such a library, where nothing can be kept too; raises what `compiled` raises."""
    path = _place(folder, sources, how)
    with contextlib.suppress(OSError):
        return path.read_bytes()
    made = compiled()
    with contextlib.suppress(OSError):
        _keep(path, made)
    return made


def _place(folder: str, sources: Mapping[str, bytes], how: Any) -> Path:
    """By all that decides what is in it."""
    import platformdirs

    cc = Path(shutil.which("cc") or "").resolve()
    compiler = (str(cc), cc.stat().st_size, cc.stat().st_mtime_ns)
    content = hashlib.sha256(repr((sorted(sources.items()), how, compiler, _processor())).encode())
    return Path(platformdirs.user_cache_dir("quadcosim")) / folder / f"{content.hexdigest()}.so"


@functools.cache
def _processor() -> tuple[str, ...]:
    """What this machine's processor can do: machines of a cluster share a cache, and differ in their instructions."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text().splitlines() if about.is_file() else [platform.processor()]
    return platform.machine(), *sorted({line for line in lines if line.lower().startswith(("flags", "features"))})


def _keep(path: Path, content: bytes) -> None:
    """Whole or not at all, whoever else makes it at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = path.with_name(f"{path.name}.{os.getpid()}")
    fresh.write_bytes(content)
    fresh.replace(path)
