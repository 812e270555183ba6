"""The hash by which a native FMU is recognised as up to date, computed without importing any slave."""

from __future__ import annotations

import hashlib
from pathlib import Path

from fmu_kit import compiler
from fmu_kit.bundle import Target
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.documentation import TEMPLATE
from fmu_kit.packaging import hash_of, licences_and_icon

_COMPILER = Path(compiler.__file__).parent


def source_hash(target: Target, version: int = 2) -> str:
    """The hash of all that the FMU of a version of FMI depends on: its modules and the code generator.

    The C compiler is not part of it: all of them make libraries that give the same bits.
    """
    own = sorted(path for path in _COMPILER.rglob("*") if path.suffix in (".py", ".c", ".h", ".html"))
    return hash_of(target, [*own, TEMPLATE], {"version": str(version)}, licences_and_icon(target, version))


def wrapping_hash() -> str:
    """The hash of what is put around a user's own C."""
    digest = hashlib.sha256()
    packing = ("pack/in_double.py", "pack/user_objects.py", "pack/wrapping.py", "emit/user_code.py")
    for path in (*sorted(FOLDER.glob("*.[ch]")), *(_COMPILER / name for name in packing)):
        digest.update(path.read_bytes())
    return digest.hexdigest()
