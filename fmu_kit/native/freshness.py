"""Whether a native FMU is of today's sources: the hash that it carries, computed without importing any slave."""

from __future__ import annotations

from pathlib import Path

from fmu_kit.bundle import Target
from fmu_kit.documentation import TEMPLATE
from fmu_kit.native.compiler import compiler_version
from fmu_kit.packaging import hash_of, licences_and_icon

_HERE = Path(__file__).parent


def source_hash(target: Target) -> str:
    """The hash of all that decides the content of the FMU: its modules, all that writes C, and the compiler."""
    own = sorted(path for path in _HERE.iterdir() if path.suffix in (".py", ".c", ".h", ".html"))
    return hash_of(target, [*own, TEMPLATE], {"compiler": compiler_version()}, licences_and_icon(target))
