"""What is in an .fmu."""

import zipfile
from pathlib import Path

from fmu_kit.archive import write_archive
from fmu_kit.loader import BESIDE


def files_of(fmu: Path) -> dict[str, bytes]:
    """The content of every file, by its path in the archive."""
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def without_loader(fmu: Path, folder: Path) -> Path:
    """The FMU as it is packed where there is no compiler, in `folder`."""
    files = files_of(fmu)
    files[f"binaries/linux64/{fmu.stem}.so"] = files.pop(BESIDE)
    write_archive(folder / fmu.name, files, first="modelDescription.xml")
    return folder / fmu.name
