"""An .fmu of this kit as an archive: the paths in it, the metadata that it carries, and writing it."""

import functools
import hashlib
import json
import re
import uuid
import zipfile
from pathlib import Path
from typing import Any

from fmu_kit.loader import GUID_FILE
from fmu_kit.new_files import new_file
from fmu_kit.variants import Variant

PAGE = "documentation/index.html"
"""The path of an FMU's documentation in its archive."""
ICONS = {2: "model.png", 3: "terminalsAndIcons/icon.png"}
"""The path of an FMU's icon, by version of FMI (2.0.4, section 2.3; 3.0, section 2.5)."""

NATIVE_TABLES = "sources/tables.h"
"""Source file that has the GUID in an FMU without Python inside"""
SOURCE_HASH_FILE = "resources/source_hash.txt"
VARIANT_FILE = "resources/variant.json"
"""File of the slave and its fixed values in the FMU of a variant"""
WRAPPED_FILE = "resources/wrapped.json"
"""File by which the FMU of a user's own C states its origin, and the period that the code believes"""
LANES_FOLDER = "resources/lanes/"
"""Folder of what the lanes of such an FMU are compiled from"""
_STAMP = (1980, 1, 1, 0, 0, 0)


def read_source_hash(fmu: Path) -> str | None:
    """The source hash stored in an .fmu; None if it was not made by this kit or is not readable."""
    found = _stored(fmu, SOURCE_HASH_FILE)
    return None if found is None else found.decode().strip()


def read_variant(fmu: Path) -> tuple[str, Variant] | None:
    """The slave, as `module:Class`, and the variant of it that an .fmu is; None if it is none or not readable."""
    try:
        slave, text = json.loads(_stored(fmu, VARIANT_FILE) or "")
        return str(slave), Variant.parse(text)
    except (TypeError, ValueError, AttributeError):
        return None


def read_wrapped(fmu: Path) -> dict[str, Any] | None:
    """What the FMU of a user's own C states of its origin; None if it is none or not readable."""
    try:
        found = json.loads(_stored(fmu, WRAPPED_FILE) or "")
    except ValueError:
        return None
    return found if isinstance(found, dict) else None


def _stored(fmu: Path, name: str) -> bytes | None:
    """A file of an archive, read once while that stays the same; None if it has none or is not readable."""
    try:
        about = fmu.stat()
        return _content(fmu, name, (about.st_ino, about.st_mtime_ns, about.st_ctime_ns, about.st_size))
    except (OSError, zipfile.BadZipFile):
        return None


@functools.lru_cache(maxsize=256)
def _content(fmu: Path, name: str, _: tuple[int, ...]) -> bytes | None:
    with zipfile.ZipFile(fmu) as archive:
        return archive.read(name) if name in archive.NameToInfo else None


def content_guid(files: dict[str, bytes]) -> str:
    """The GUID of an FMU's content: a hash of all files, without GUID and date of generation.

    The libraries of an FMU in C are left out: wherever it is compiled, it is the same FMU.
    """
    compiled = "binaries/" if NATIVE_TABLES in files else "\0"
    digest = hashlib.sha256()
    for name in sorted(name for name in files if name != GUID_FILE and not name.startswith(compiled)):
        content = files[name]
        if name == "modelDescription.xml":
            content = re.sub(rb'(guid|instantiationToken|generationDateAndTime)="[^"]*"', rb"", content)
        elif name == NATIVE_TABLES:
            content = re.sub(rb'#define GUID "[^"]*"', rb"", content)
        digest.update(name.encode() + b"\0" + hashlib.sha256(content).digest())
    return str(uuid.UUID(bytes=digest.digest()[:16]))


def write_archive(path: Path, files: dict[str, bytes], *, first: str) -> None:
    """Write a zip of `files` by name, beginning with `first`; the same content gives the same bytes.

    Files are stored uncompressed, so that the bytes do not depend on a version of zlib.
    """
    with new_file(path) as new, zipfile.ZipFile(new, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(files, key=lambda name: (name != first, name)):
            entry = zipfile.ZipInfo(name, _STAMP)
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, files[name])
