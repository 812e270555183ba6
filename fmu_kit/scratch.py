"""Working folders of processes, locked while the process lives, so that a later process can remove abandoned ones."""

import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

if sys.platform != "win32":
    import fcntl

PREFIX, SUFFIX = "quadcosim-", ".scratch"
_cleared: set[Path] = set()


class Scratch:
    """A new folder at `path`, locked before anything is in it.

    The lock is the operating system's, on the folder itself, and ends with the process however that ends. Windows and
    some network file systems have no such lock: folders of killed processes remain there.
    """

    def __init__(self, path: Path, *, mode: int = 0o777) -> None:
        self.path = path
        while True:
            path.mkdir(mode)
            self._lock = _locked(path, wait=True)
            if path.is_dir():
                break
            self.release()  # another process took the folder for an abandoned one before it was locked

    def release(self) -> None:
        """Release the lock."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def remove(self) -> None:
        """Remove the folder and its content."""
        shutil.rmtree(self.path, ignore_errors=True)
        self.release()


def temporary() -> Scratch:
    """A private folder for temporary files; the first call removes abandoned ones."""
    parent = Path(tempfile.gettempdir())
    if parent not in _cleared:
        _cleared.add(parent)
        for path in abandoned(parent.glob(f"{PREFIX}*{SUFFIX}")):
            shutil.rmtree(path, ignore_errors=True)
    return Scratch(parent / f"{PREFIX}{os.urandom(6).hex()}{SUFFIX}", mode=0o700)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """As `temporary`, removed at the end of the block."""
    scratch = temporary()
    try:
        yield scratch.path
    finally:
        scratch.remove()


def abandoned(folders: Iterable[Path]) -> Iterator[Path]:
    """Those of `folders` whose process has ended; each stays locked until the next one is requested."""
    for folder in folders:
        lock = _locked(folder, wait=False)
        if lock is not None:
            try:
                yield folder
            finally:
                os.close(lock)


def _locked(folder: Path, *, wait: bool) -> int | None:
    """A lock on `folder`, held by this process until it is closed; None if unavailable."""
    if sys.platform == "win32":
        return None
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:  # removed meanwhile, or owned by another user
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle
