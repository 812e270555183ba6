"""Libraries compiled from C files by the C compiler of this machine, once, and kept in the user's cache."""

import contextlib
import functools
import hashlib
import platform
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fmu_kit.new_files import write_atomically


def cached_library(folder: str, sources: Mapping[str, bytes], how: Any, compiled: Callable[[], bytes]) -> Path:
    """The path of the library that `compiled` makes of `sources`, in the cache's `folder`.

    `how`: all else that its content depends on. Raises `OSError` if it cannot be stored, and what `compiled` raises.
    """
    path = _cache_path(folder, sources, how)
    if not path.is_file():
        write_atomically(path, compiled())
    return path


def cached_content(folder: str, sources: Mapping[str, bytes], how: Any, compiled: Callable[[], bytes]) -> bytes:
    """The bytes of such a library, also where the cache is not writable; raises what `compiled` raises."""
    path = _cache_path(folder, sources, how)
    with contextlib.suppress(OSError):
        return path.read_bytes()
    library = compiled()
    with contextlib.suppress(OSError):
        write_atomically(path, library)
    return library


def _cache_path(folder: str, sources: Mapping[str, bytes], how: Any) -> Path:
    """The path of a library: a hash of all that its content depends on."""
    import platformdirs

    content = hashlib.sha256(repr((sorted(sources.items()), how, compiler(), processor())).encode())
    return Path(platformdirs.user_cache_dir("quadcosim")) / folder / f"{content.hexdigest()}.so"


def compiler() -> tuple[str, int, int]:
    """The compiler of this machine: its path, size and time of last change [ns]."""
    cc = Path(shutil.which("cc") or "").resolve()
    return str(cc), cc.stat().st_size, cc.stat().st_mtime_ns


@functools.cache
def processor() -> tuple[str, ...]:
    """The instruction sets of this machine: machines of a cluster share a cache, but may have different processors."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else [platform.processor()]
    return platform.machine(), *sorted({line for line in lines if line.lower().startswith(("flags", "features"))})
