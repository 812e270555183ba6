"""The dependencies of the binary of an FMU, and those missing on a machine."""

import re
from collections.abc import Iterator

from orchestration.components.checks.doctor.binaries import Dependency, newest
from orchestration.components.checks.doctor.fmu import InspectedFmu, PlatformBinary
from orchestration.components.checks.doctor.machine import Libraries, Library, Machine

PYTHON_DLL = re.compile(r"python3\d*\.dll", re.IGNORECASE)
_RUNTIME_DLL = re.compile(r"(msvcp|vcruntime|concrt)\d+", re.IGNORECASE)
_API_SETS = ("api-ms-", "ext-ms-")
"""Names that Windows resolves itself; no such files exist."""

_REDISTRIBUTABLE = "the Microsoft Visual C++ Redistributable"


def part_for(fmu: InspectedFmu, machine: Machine) -> PlatformBinary | None:
    """The FMU's binary for this machine, if any."""
    parts = {part.platform: part for part in fmu.platforms}
    for part in map(parts.get, machine.platforms(fmu.version)):
        if part is not None and part.binary is not None:
            return part if part.binary.fits(machine.system, machine.architecture) else None
    return None


def missing_dependencies(
    part: PlatformBinary, libraries: Libraries, without: re.Pattern[str] | None = None
) -> list[str]:
    """Dependencies of a binary that are not found, or too old."""
    lacks = []
    for dependency in needed(part):
        if without is not None and without.fullmatch(dependency.name):
            continue
        library = libraries.get(dependency.name)
        if library is None:
            hint = f" ({_REDISTRIBUTABLE})" if _RUNTIME_DLL.match(dependency.name) else ""
            lacks.append(f"{dependency.name}{hint}")
        elif missing := missing_versions(dependency, library):
            here = offered(dependency, library) or "none of the kind"
            lacks.append(f"{dependency.name} with {' '.join(missing)}, here {here}")
    return lacks


def needed(part: PlatformBinary) -> Iterator[Dependency]:
    """Dependencies that must be installed on the machine."""
    for dependency in (part.binary and part.binary.dependencies) or ():
        if dependency.name not in part.bundled and not dependency.name.lower().startswith(_API_SETS):
            yield dependency


def missing_versions(dependency: Dependency, library: Library) -> tuple[str, ...]:
    """The required versions of symbols that a library does not define, of each kind the newest.

    A library without any versions is accepted, as by the loader.
    """
    missing = [version for version in dependency.versions if version not in library.versions]
    return newest(missing, unnumbered=True) if library.versions else ()


def offered(dependency: Dependency, library: Library) -> str:
    """The newest versions that a library defines, of the required kinds."""
    kinds = {version.rpartition("_")[0] for version in dependency.versions}
    return " ".join(newest(version for version in library.versions if version.rpartition("_")[0] in kinds))
