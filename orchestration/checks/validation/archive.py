"""The archive that an FMU is, and what must be true of it before anything in it is read or unpacked."""

import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from orchestration.errors import QuadcosimError

DESCRIPTION = "modelDescription.xml"
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_SYMBOLIC_LINK = 0o12


class UnreadableError(QuadcosimError):
    """The file is so damaged that the rules have nothing to look at; the text says what was expected."""


@dataclass(frozen=True, slots=True)
class Archive:
    """The content of an .fmu file."""

    path: Path
    entries: tuple[zipfile.ZipInfo, ...]
    """As they are listed, one name perhaps more than once"""
    files: Mapping[str, bytes]
    """Content by name"""


class _Files(Mapping[str, bytes]):
    """The files of an archive, each read when it is asked for: together they may be larger than the memory."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        self._names = dict.fromkeys(archive.namelist())

    def __getitem__(self, name: str) -> bytes:
        if name not in self._names:
            raise KeyError(name)
        return self._archive.read(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def read_archive(path: Path, size_limit: float) -> Archive:
    """The file, found whole; it is kept open.

    Raises `UnreadableError` if it is no archive, or damaged, or unpacks to more than `size_limit` MB, or has no
    model description.
    """
    try:
        archive = zipfile.ZipFile(path)
        size = sum(entry.file_size for entry in archive.infolist())
        if size > size_limit * 1e6:
            raise UnreadableError(
                f"{path.name}: unpacks to {size / 1e6:.0f} MB: expected at most {size_limit:g} MB (--size-limit)"
            )
        damaged = archive.testzip()
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError, ValueError) as error:
        raise UnreadableError(f"{path.name}: expected a zip archive that is whole: {error}") from error
    if damaged is not None:
        raise UnreadableError(f"{path.name}: expected a zip archive that is whole: wrong CRC or header of {damaged}")
    files = _Files(archive)
    if DESCRIPTION not in files:
        raise UnreadableError(f"{path.name}: expected an FMU, with {DESCRIPTION} at the top of the archive")
    return Archive(path, tuple(archive.infolist()), files)


def can_be_unpacked(archive: Archive) -> bool:
    """Whether every file lands in the folder that the archive is unpacked to."""
    return not any(True for _ in paths(archive))


# -- rules ----------------------------------------------------------------------------------------------


def paths(archive: Archive) -> Iterator[str]:
    """Names are relative, stay inside the archive and use forward slashes."""
    for entry in archive.entries:
        name = entry.orig_filename
        if name.startswith("/") or ".." in PurePosixPath(name).parts or "\\" in name or ":" in name:
            yield f"{name}: expected a relative path with forward slashes that stays inside the archive"


def entries(archive: Archive) -> Iterator[str]:
    """One entry for each name, and nothing that common tools cannot unpack (FMI 2.0.4, section 2.3)."""
    for name, count in Counter(entry.filename for entry in archive.entries).items():
        if count > 1:
            yield f"{name}: there are {count} entries of this name, expected one"
    for entry in archive.entries:
        if entry.compress_type not in _METHODS:
            yield f"{entry.filename}: compression method {entry.compress_type}, expected 0 (store) or 8 (deflate)"
        if entry.external_attr >> 28 == _SYMBOLIC_LINK:
            yield f"{entry.filename}: a symbolic link, expected a file"


RULES = (paths, entries)
