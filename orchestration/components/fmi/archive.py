"""The archive of an FMU, opened once for all checks, and its model description."""

import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.foundation.processes import resource_limits

DESCRIPTION = "modelDescription.xml"


class UnreadableFmuError(QuadcosimError):
    """The file is too damaged to be checked; the text, without its path, states what was expected."""


class OtherVersionError(UnreadableFmuError):
    """It is an FMU of a version of FMI that is not checked."""


VERSIONS = {"2.0": 2, "3.0": 3}
"""Versions of FMI that are checked, as model descriptions write them"""
TOKENS = {1: "guid", 2: "guid", 3: "instantiationToken"}
"""Attribute by which a library identifies its description, by version of FMI"""


@dataclass(frozen=True, slots=True)
class Archive:
    """The content of an .fmu file."""

    path: Path
    entries: tuple[zipfile.ZipInfo, ...]
    """Entries of the archive; a name may occur more than once"""
    files: Mapping[str, bytes]
    """Content by name"""


class _Files(Mapping[str, bytes]):
    """The files of an archive, each read on access: together they may be larger than the memory."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        self._names = dict.fromkeys(archive.namelist())

    def __getitem__(self, name: str) -> bytes:
        if name not in self._names:
            raise KeyError(name)
        return self._archive.read(name)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def read_archive(path: Path, size_limit: float) -> Archive:
    """Open an archive after checking that it is intact; it stays open.

    Raises `UnreadableFmuError` if it is no archive, is damaged, unpacks to more than `size_limit` MB, or has no model
    description.
    """
    if not path.is_file():
        raise UnreadableFmuError("no such file")
    try:
        archive = zipfile.ZipFile(path)
        size = sum(entry.file_size for entry in archive.infolist()) / 1e6
        if size > size_limit:
            raise UnreadableFmuError(f"unpacks to {size:.0f} MB: expected at most {size_limit:g} MB (--size-limit)")
        damaged = archive.testzip()
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError, ValueError) as error:
        raise UnreadableFmuError(f"expected a zip archive that is whole: {error}") from error
    if damaged is not None:
        raise UnreadableFmuError(f"expected a zip archive that is whole: wrong CRC or header of {damaged}")
    files = _Files(archive)
    if DESCRIPTION not in files:
        raise UnreadableFmuError(f"expected an FMU, with {DESCRIPTION} at the top of the archive")
    return Archive(path, tuple(archive.infolist()), files)


def expect_honest_size(path: Path) -> None:
    """Raise `UsageError` for an archive that would fill the disk (a zip bomb), by the sizes that it declares."""
    with zipfile.ZipFile(path) as archive:
        sizes = {entry.filename: entry.file_size for entry in archive.infolist()}  # zipfile unpacks no more than that
        unpacked = sum(entry.file_size for entry in archive.infolist())
    times = unpacked / path.stat().st_size
    if unpacked > resource_limits.UNPACKED.bytes and times > resource_limits.COMPRESSION.value:
        raise UsageError(
            f"{path}: unpacks to {unpacked / 1e6:.0f} MB, {times:.0f} times its size: expected at most "
            f"{resource_limits.UNPACKED}, or {resource_limits.COMPRESSION} its size"
        )
    if (size := sizes.get(DESCRIPTION, 0)) > resource_limits.DESCRIPTION.bytes:
        raise UsageError(
            f"{path}: {DESCRIPTION} has {size / 1e6:.0f} MB: expected at most {resource_limits.DESCRIPTION}"
        )


def read_root(archive: Archive) -> Element:
    """The model description, of any version of FMI; raises `UnreadableFmuError` for no XML."""
    try:
        return ElementTree.fromstring(archive.files[DESCRIPTION])
    except ElementTree.ParseError as error:
        raise UnreadableFmuError(f"{DESCRIPTION}: expected well-formed XML: {error}") from error


def read_checked_root(archive: Archive) -> Element:
    """The same of a version of FMI that is checked; raises `OtherVersionError` for another one."""
    root = read_root(archive)
    version = root.get("fmiVersion")
    if version not in VERSIONS:
        raise OtherVersionError(
            f"fmiVersion = {version}: expected {' or '.join(VERSIONS)}; an FMU of FMI {version} is not checked here"
        )
    return root


def version_of(root: Element) -> int:
    """The version of FMI of a model description: 2 or 3."""
    return VERSIONS[root.get("fmiVersion", "")]
