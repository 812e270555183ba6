"""`quadcosim examples`: writes the examples and studies of the documentation, also without a checkout."""

from pathlib import Path

from fmu_kit.new_files import new_files, write_atomically
from orchestration.components.building import consent
from orchestration.components.scaffold.folder import expect_new

FOLDERS = ("examples", "studies", "gains")
"""written together: studies read gains"""
KEPT = (".c", ".csv", ".h", ".md", ".py", ".toml")
"""Endings of the files that are written: no pictures, and no FMUs, which are built before a run"""
_SHIPPED = Path(__file__).parent / "shipped"
"""Their place in a wheel, where `setup.py` puts them"""


def write(where: Path) -> list[Path]:
    """Write the folders into `where`; their paths.

    Raises `UsageError` if one of them exists.
    """
    origin = _SHIPPED if _SHIPPED.is_dir() else Path(__file__).parents[3]
    written = [where / name for name in FOLDERS]
    for folder in written:
        expect_new(folder)
    with new_files(where) as new:
        for name in FOLDERS:
            for file in sorted((origin / name).rglob("*")):
                if file.suffix in KEPT:
                    write_atomically(new / file.relative_to(origin), file.read_bytes())
    for system in where.glob(f"{FOLDERS[0]}/*/system.toml"):
        consent.agree(system.parent)
    return written
