"""Files that appear whole or not at all: written beside their place, synchronised with the disk, then renamed.

What belongs together is written into one folder beside its place, `.quadcosim-MARK.new`, and moved together: if one of
the renames fails, those before it are taken back; if the process is killed between them, the next one that writes
there moves the rest. A folder whose process was killed before that is removed by the next.
"""

import errno
import os
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fmu_kit.scratch import Scratch, abandoned, temporary_folder

_HIDDEN = re.compile(r"\.quadcosim-[0-9a-f]{12}\.new")
_PRIVATE = re.compile(rf"{_HIDDEN.pattern}|quadcosim-[0-9a-f]{{12}}\.scratch")
_PARTIAL, _WHOLE, _OLD = "partial", "whole", "old"
"""Names in the folder beside the place: of files being written, of all of them, and of those that they replace"""
_OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)
_cleared: set[Path] = set()


class WriteError(OSError):
    """A file was not written; an older one is as it was."""

    def __str__(self) -> str:
        return f"{self.filename}: could not be written: {self.strerror}"


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write a file, which other processes and threads may write at the same time; raises `WriteError`."""
    with new_file(path) as new:
        new.write_bytes(content if isinstance(content, bytes) else content.encode())


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """The path to which the block writes what is to be at `path`; raises `WriteError`.

    A link stays one, to the new file; a device or a pipe receives the content at the end of the block.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        with temporary_folder() as folder:
            yield folder / path.name
            with (folder / path.name).open("rb") as content, path.open("wb") as device:
                shutil.copyfileobj(content, device)
        return
    place = Path(os.path.realpath(path)) if path.is_symlink() else path
    with new_files(place.parent, place.name) as folder:
        yield folder / place.name


@contextmanager
def new_files(folder: Path, name: str = "") -> Iterator[Path]:
    """The path of a folder into which the block writes what is to be in `folder`, which is made if need be.

    It appears there together, if the block succeeds; other files stay. Where `folder` is in such a folder, that one's
    block decides; in a temporary one of this process, files are written as they are. Raises `WriteError`, about the
    file `name` in it where only one is written.
    """
    if any(_PRIVATE.fullmatch(part) for part in folder.parts):
        folder.mkdir(parents=True, exist_ok=True)
        before = set(os.listdir(folder))
        try:
            yield folder
        except BaseException as error:
            for each in {name} if name else set(os.listdir(folder)) - before:  # a run may be kept without them
                _remove(folder / each)
            if isinstance(error, OSError) and error.filename is None and error.errno in _OF_THE_DISK:
                raise _write_error(error, folder / name) from error
            raise
        return
    new = NewFiles(folder)
    try:
        yield new.path
        new.publish()
    except OSError as error:
        told = new.error_of(error, name)
        if told is None:
            raise
        raise told from error
    finally:
        new.remove()


class NewFiles:
    """What is written into the folder `path`, and moved into `folder` by `publish`; raises `WriteError`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._made = [each for each in (folder, *folder.parents) if not each.exists()]
        try:
            if folder.exists() and not folder.is_dir():
                raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
            folder.mkdir(parents=True, exist_ok=True)
            clear(folder)
            self._scratch = Scratch(folder / f".quadcosim-{os.urandom(6).hex()}.new")
            self.path = self._scratch.path / _PARTIAL
            try:
                self.path.mkdir()
            except OSError:
                self._scratch.remove()
                raise
        except OSError as error:
            self._remove_folders()
            raise _write_error(error, folder) from error

    def publish(self, *, replaces_folders: bool = False) -> None:
        """Move all to its place, or nothing; a folder replaces one only if `replaces_folders`."""
        names = sorted(os.listdir(self.path))
        for name in names:
            _prepare(self.path / name, self.folder / name, replaces_folders=replaces_folders)
        for each in self.path.rglob("*"):
            _synchronise(each)
        whole, old = self._scratch.path / _WHOLE, self._scratch.path / _OLD
        old.mkdir()
        self.path.rename(whole)
        try:
            for name in names:
                _keep(self.folder / name, old / name)
                os.replace(whole / name, self.folder / name)
            _synchronise(self.folder)
        except BaseException:
            for name in names:
                if not os.path.lexists(whole / name):
                    os.replace(self.folder / name, whole / name)
                if os.path.lexists(old / name):
                    os.replace(old / name, self.folder / name)
            whole.rename(self.path)
            raise

    def error_of(self, error: OSError, name: str = "") -> WriteError | None:
        """The error in terms of the place of a file, by default `name`; None if it is not about these files."""
        if error.filename is None and error.errno in _OF_THE_DISK:
            place = self.folder / name
        elif error.filename is not None and Path(error.filename).is_relative_to(self._scratch.path):
            place = self.folder.joinpath(*Path(error.filename).relative_to(self._scratch.path).parts[1:])
        else:
            return None
        return _write_error(error, place)

    def remove(self) -> None:
        """Remove what has not been moved, and folders that were made for it."""
        whole = self._scratch.path / _WHOLE
        if whole.is_dir() and any(whole.iterdir()):  # taking it back failed, too: the next process moves the rest
            self._scratch.release()
        else:
            self._scratch.remove()
        self._remove_folders()

    def _remove_folders(self) -> None:
        for folder in self._made:
            with suppress(OSError):  # what is not empty stays
                folder.rmdir()


def _prepare(new: Path, place: Path, *, replaces_folders: bool) -> None:
    """Raise `OSError` if `new` may not replace what is at `place`, else give it the same permissions."""
    if new.is_dir():
        if place.exists() and not replaces_folders:
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(new))
    elif place.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(new))
    elif place.exists():
        if not os.access(place, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(new))
        shutil.copymode(place, new)


def _keep(place: Path, old: Path) -> None:
    """Keep what is at `place` as `old`; a folder is moved there, a file stays at its place, too."""
    if place.is_dir() and not place.is_symlink():
        os.replace(place, old)
    elif os.path.lexists(place):
        try:
            os.link(place, old, follow_symlinks=False)
        except OSError:  # a file system without links
            shutil.copy2(place, old, follow_symlinks=False)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def clear(folder: Path) -> None:
    """Finish what ended processes have begun: move sets that are complete to their place, remove the rest."""
    folder = folder.absolute()
    if folder in _cleared:
        return
    _cleared.add(folder)
    for path in abandoned(each for each in folder.glob(".quadcosim-*") if _HIDDEN.fullmatch(each.name)):
        with suppress(OSError):  # what cannot be moved now stays
            whole = path / _WHOLE
            for each in whole.iterdir() if whole.is_dir() else ():
                if each.is_file() or not (folder / each.name).exists():
                    os.replace(each, folder / each.name)
            shutil.rmtree(path, ignore_errors=True)


def _synchronise(path: Path) -> None:
    """Have the content of a file, or the names in a folder, on the disk."""
    if sys.platform == "win32" or path.is_symlink():
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno != errno.EINVAL:  # a file system that cannot
            raise
    finally:
        os.close(handle)


def _write_error(error: OSError, place: Path) -> WriteError:
    reason = os.strerror(error.errno) if error.errno else str(error)
    return WriteError(error.errno, reason, str(place))
