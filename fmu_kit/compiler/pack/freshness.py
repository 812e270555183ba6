"""The hash by which a native FMU is recognised as up to date, computed without importing any slave."""

from __future__ import annotations

from pathlib import Path

from fmu_kit import compiler
from fmu_kit.bundle import Target
from fmu_kit.documentation import TEMPLATE
from fmu_kit.packaging import hash_of, licences_and_icon

_COMPILER = Path(compiler.__file__).parent


def source_hash(target: Target, version: int = 2) -> str:
    """The hash of all that the FMU of a version of FMI depends on: its modules and the code generator.

    The C compiler is not part of it: all of them make libraries that give the same bits.
    """
    own = sorted(path for path in _COMPILER.rglob("*") if path.suffix in (".py", ".c", ".h", ".html"))
    return hash_of(target, [*own, TEMPLATE], {"version": str(version)}, licences_and_icon(target, version))
