"""What is in an .fmu."""

import tempfile
import zipfile
from pathlib import Path

from fmu_kit.archive import write_archive
from fmu_kit.loader import BESIDE
from orchestration.components.checks.validation.fmu import Fmu, read_fmu
from orchestration.components.fmi.archive import DESCRIPTION, read_archive, read_checked_root


def files_of(fmu: Path) -> dict[str, bytes]:
    """The content of every file, by its path in the archive."""
    with zipfile.ZipFile(fmu) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def without_loader(fmu: Path, folder: Path) -> Path:
    """The FMU as it is packed where there is no compiler, in `folder`."""
    files = files_of(fmu)
    files[f"binaries/linux64/{fmu.stem}.so"] = files.pop(BESIDE)
    write_archive(folder / fmu.name, files, first=DESCRIPTION)
    return folder / fmu.name


def view_of(text: str) -> Fmu:
    """The view that rules check of an FMU that has this description and nothing else."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "m.fmu"
        write_archive(path, {DESCRIPTION: text.encode()}, first=DESCRIPTION)
        archive = read_archive(path, 1.0)
        return read_fmu(archive, read_checked_root(archive))
