"""What is in an .fmu."""

import zipfile
from pathlib import Path


def files_of(fmu: Path) -> dict[str, bytes]:
    """The content of every file, by its path in the archive."""
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}
