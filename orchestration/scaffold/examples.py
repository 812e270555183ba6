"""`quadcosim examples`: writes the examples and studies that pages speak of, also where there is no checkout."""

import shutil
from pathlib import Path

from orchestration.basics.errors import UsageError
from orchestration.building import consent

FOLDERS = ("examples", "studies", "gains")
"""That belong together: studies read gains"""
KEPT = (".csv", ".md", ".py", ".toml")
"""Endings of what is written: no pictures, and no FMUs, which are built when they are flown"""
_SHIPPED = Path(__file__).parent / "shipped"
"""Where a wheel has them; `setup.py` puts them there"""


def write(where: Path) -> list[Path]:
    """Write the folders into `where`; their paths.

    Raises `UsageError` for a folder that is there already.
    """
    origin = _SHIPPED if _SHIPPED.is_dir() else Path(__file__).parents[2]
    written = [where / name for name in FOLDERS]
    for folder in written:
        if folder.exists():
            raise UsageError(f"{folder}: is there already; expected a folder that can be made")
    for name, folder in zip(FOLDERS, written):
        for file in sorted((origin / name).rglob("*")):
            if file.suffix in KEPT:
                copy = folder / file.relative_to(origin / name)
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, copy)
    for system in where.glob(f"{FOLDERS[0]}/*/system.toml"):
        consent.agree(system.parent)
    return written
