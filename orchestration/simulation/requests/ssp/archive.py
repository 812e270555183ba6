"""The files of an SSP: a folder with its SystemStructure.ssd; an archive is unpacked once into the user's cache."""

import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlsplit

from fmu_kit.new_files import new_files
from orchestration.components.fmi.archive import expect_honest_size
from orchestration.components.fmi.trust import content_hash
from orchestration.foundation.basics.documents import readable
from orchestration.foundation.basics.errors import UsageError

STRUCTURE = "SystemStructure.ssd"


@dataclass(frozen=True, kw_only=True)
class Package:
    """The files of an SSP."""

    structure: Path
    """its .ssd"""

    def file(self, source: str, base: Path | None = None) -> Path:
        """The file of a source in a document, relative to the .ssd or to `base`; raises `UsageError`."""
        parts = urlsplit(source)
        path = ((base or self.structure).parent / unquote(parts.path)).resolve()
        is_inside = path.is_relative_to(self.structure.parent.resolve())
        if parts.scheme not in ("", "file") or parts.netloc or not is_inside:
            raise UsageError(f"source {source}: expected a file of the SSP")
        if not path.is_file():
            raise UsageError(f"source {source}: there is no such file in the SSP")
        return path


def open_package(path: Path) -> Package:
    """The SSP of an .ssp or .ssd file; raises `UsageError` for anything else."""
    if path.suffix.lower() == ".ssd":
        return Package(structure=path)
    with readable(path, "SSP archive"):
        folder = _cache() / content_hash(path)[:20]
    if not folder.is_dir():
        _unpack(path, folder)
    if not (folder / STRUCTURE).is_file():
        raise UsageError(f"{path}: expected an SSP archive: it has no {STRUCTURE}")
    return Package(structure=folder / STRUCTURE)


def _cache() -> Path:
    import platformdirs

    return Path(platformdirs.user_cache_dir("quadcosim")) / "ssp"


def _unpack(path: Path, folder: Path) -> None:
    """Unpack all files or none; zipfile cuts names that lead out of the folder."""
    if not zipfile.is_zipfile(path):
        raise UsageError(f"{path}: expected an SSP archive, which is a zip file")
    try:
        expect_honest_size(path)
        with new_files(folder.parent) as new, zipfile.ZipFile(path) as archive:
            archive.extractall(new / folder.name)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError) as error:
        raise UsageError(f"{path}: expected an SSP archive: {error}") from error
    except OSError:
        if not folder.is_dir():  # else another process was first
            raise
