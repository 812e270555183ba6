"""FMUs that may run in this process: those that were built here from this project's own sources.

They are known by the hash of the whole file, recorded when it is built: in the checkout that this process runs from, as
whoever can write there can change the sources too, else in the user's cache. What an archive says of itself does not
count, so that a copy is what its original is, and a file of which one byte differs is foreign.
"""

import contextlib
import functools
import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from fmu_kit.new_files import write_atomically
from orchestration.foundation.processes.subprocesses import checkout

_accepted: set[str] = set()
"""Hashes that this process knows without the records: of its own builds, or from its coordinator on another machine"""


def content_hash(path: Path) -> str:
    """SHA-256 of a file, read again only if it has changed."""
    status = path.stat()
    return _hash(path.absolute(), status.st_mtime_ns, status.st_size)


@functools.lru_cache(maxsize=256)
def _hash(path: Path, changed: int, size: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def record(path: Path) -> None:
    """Record an FMU that has just been built from this project's sources."""
    content = content_hash(path)
    accept([content])
    with contextlib.suppress(OSError):
        write_atomically(_folder() / content, path.name.encode("utf-8", "surrogateescape"))


def accept(contents: Iterable[str]) -> None:
    """Accept FMUs with these hashes in this process."""
    _accepted.update(contents)


def is_own(path: Path) -> bool:
    """Whether the FMU was built here from this project's sources."""
    return is_own_content(content_hash(path))


def is_own_content(content: str) -> bool:
    """Likewise of a file with this hash."""
    return content in _accepted or (_folder() / content).is_file()


def is_recordable() -> bool:
    """Whether what is built can be recorded for other processes."""
    folder = _folder()
    return os.access(next(each for each in (folder, *folder.parents) if each.is_dir()), os.W_OK)


def _folder() -> Path:
    root = checkout()
    if root is not None and os.access(root, os.W_OK):
        return root / ".cache" / "built"
    import platformdirs

    return Path(platformdirs.user_cache_dir("quadcosim")) / "built"
