"""The archive that an FMU is, and what must be true of it before anything in it is read or unpacked."""

import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator
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
    files: dict[str, bytes]
    """Content by name"""


def read_archive(path: Path) -> Archive:
    """All of the file; raises `UnreadableError` if it is no archive, or damaged, or has no model description."""
    try:
        with zipfile.ZipFile(path) as archive:
            entries = tuple(archive.infolist())
            files = {entry.filename: archive.read(entry) for entry in entries}
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError, ValueError) as error:
        raise UnreadableError(f"{path.name}: expected a zip archive that is whole: {error}") from error
    if DESCRIPTION not in files:
        raise UnreadableError(f"{path.name}: expected an FMU, with {DESCRIPTION} at the top of the archive")
    return Archive(path, entries, files)


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
