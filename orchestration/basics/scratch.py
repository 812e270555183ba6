"""Folders that a process works in: locked while it lives, so that the next one can clear those of the dead."""

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

if sys.platform != "win32":
    import fcntl

PREFIX, SUFFIX = "quadcosim-", ".scratch"
_cleared: set[Path] = set()


class Scratch:
    """A new folder at `path`, made under another name and locked before it takes this one.

    The lock is the system's, on the folder itself, and ends with the process however that ends; where there
    is none (on Windows) nobody clears what a killed process leaves.
    """

    def __init__(self, path: Path, *, mode: int = 0o777) -> None:
        self.path = path
        fresh = path.with_name(f"{path.name}.new")
        fresh.mkdir(mode)
        self._lock = _locked(fresh)
        fresh.rename(path)

    def release(self) -> None:
        """Leave the folder to others."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self.path, ignore_errors=True)
        self.release()


def temporary() -> Scratch:
    """A folder for temporary files that others cannot enter; the first one clears those that the dead left."""
    parent = Path(tempfile.gettempdir())
    if parent not in _cleared:
        _cleared.add(parent)
        for path in dead(parent.glob(f"{PREFIX}*{SUFFIX}")):
            shutil.rmtree(path, ignore_errors=True)
    return Scratch(parent / f"{PREFIX}{os.urandom(6).hex()}{SUFFIX}", mode=0o700)


def dead(folders: Iterator[Path]) -> Iterator[Path]:
    """Those of `folders` whose process is no more; each is locked until the next one is asked for."""
    for folder in folders:
        lock = _locked(folder)
        if lock is not None:
            try:
                yield folder
            finally:
                os.close(lock)


def _locked(folder: Path) -> int | None:
    """A lock on `folder`, held by this process until it is closed; None if another has it or there is none."""
    if sys.platform == "win32":
        return None
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:  # gone meanwhile, or somebody else's
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle
