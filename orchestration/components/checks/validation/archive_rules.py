"""Rules on an archive, before anything in it is unpacked."""

import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import PurePosixPath

from orchestration.components.fmi.archive import Archive

_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_SYMBOLIC_LINK = 0o12


def can_be_unpacked(archive: Archive) -> bool:
    """Whether every file is unpacked inside the folder of the archive."""
    return not any(True for _ in paths(archive))


def paths(archive: Archive) -> Iterator[str]:
    """Names are relative, stay inside the archive and use forward slashes."""
    for entry in archive.entries:
        name = entry.orig_filename
        if name.startswith("/") or ".." in PurePosixPath(name).parts or "\\" in name or ":" in name:
            yield f"{name}: expected a relative path with forward slashes that stays inside the archive"


def entries(archive: Archive) -> Iterator[str]:
    """One entry for each name, and none that common tools cannot unpack (FMI 2.0.4, section 2.3)."""
    for name, count in Counter(entry.filename for entry in archive.entries).items():
        if count > 1:
            yield f"{name}: there are {count} entries of this name, expected one"
    for entry in archive.entries:
        if entry.compress_type not in _METHODS:
            yield f"{entry.filename}: compression method {entry.compress_type}, expected 0 (store) or 8 (deflate)"
        if entry.external_attr >> 28 == _SYMBOLIC_LINK:
            yield f"{entry.filename}: a symbolic link, expected a file"


RULES = (paths, entries)
