"""An .fmu of this kit as an archive: what is where in it, what it says of itself, and how it is written."""

import hashlib
import json
import re
import uuid
import zipfile
from pathlib import Path

from fmu_kit.loader import GUID_FILE
from fmu_kit.variants import Variant

PAGE = "documentation/index.html"
"""The documentation of an FMU, by its place in the archive."""
ICONS = {2: "model.png", 3: "terminalsAndIcons/icon.png"}
"""The icon of an FMU, by the version of FMI (2.0.4, section 2.3; 3.0, section 2.5)."""

NATIVE_TABLES = "sources/tables.h"
"""Of an FMU without Python inside: the file of its sources that has the GUID."""
SOURCE_HASH_FILE = "resources/source_hash.txt"
VARIANT_FILE = "resources/variant.json"
"""Of a slave with values that are fixed: that slave, and the values."""
_STAMP = (1980, 1, 1, 0, 0, 0)


def read_source_hash(fmu: Path) -> str | None:
    """The source hash that an .fmu carries; None if it is not one of ours or not readable."""
    try:
        with zipfile.ZipFile(fmu) as archive:
            return archive.read(SOURCE_HASH_FILE).decode().strip()
    except (OSError, KeyError, zipfile.BadZipFile):
        return None


def read_variant(fmu: Path) -> tuple[str, Variant] | None:
    """Of which slave, as `module:Class`, an .fmu is which variant; None if it is none of ours or not readable."""
    try:
        with zipfile.ZipFile(fmu) as archive:
            slave, text = json.loads(archive.read(VARIANT_FILE))
            return str(slave), Variant.parse(text)
    except (OSError, KeyError, TypeError, ValueError, AttributeError, zipfile.BadZipFile):
        return None


def content_guid(files: dict[str, bytes]) -> str:
    """A GUID from the content of an FMU: all files but that of the GUID, in the description all but it and the date.

    Of an FMU that was written out as C, the libraries do not count: compiled anywhere, it is the same FMU.
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
    """Write a zip of `files` by name, `first` at its head: the same content, the same bytes.

    Stored, not compressed: the bytes must not depend on a version of zlib.
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name in sorted(files, key=lambda name: (name != first, name)):
            entry = zipfile.ZipInfo(name, _STAMP)
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, files[name])
