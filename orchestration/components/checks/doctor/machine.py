"""The parts of this machine that FMUs may need, as plain facts without a verdict."""

import importlib.util
import os
import platform
import struct
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from orchestration.components.checks.doctor.binaries import LINUX, MACOS, WINDOWS
from orchestration.components.checks.doctor.fmu import ARCHITECTURES, SYSTEMS, InspectedFmu
from orchestration.components.checks.doctor.pythons import (
    DynamicLoader,
    PythonLibrary,
    loader_of_programs,
    loader_of_this_python,
    python_libraries,
    read_file,
)

_SYSTEMS = {"Linux": LINUX, "Windows": WINDOWS, "Darwin": MACOS}
_FOLDERS = {LINUX: "linux", WINDOWS: "win", MACOS: "darwin"}
_X86, _ARM = ("i386", "i686", "x86", "amd64", "x86_64"), ("arm64", "aarch64")
_ON_64_BITS = {"x86-64", "aarch64"}


@dataclass(frozen=True, kw_only=True)
class Library:
    """A shared library that a loader finds."""

    path: Path
    versions: tuple[str, ...] = ()
    """Versions of symbols that it defines."""


Libraries = Mapping[str, Library | None]
"""Libraries by the name in a binary; None: not found"""


@dataclass(frozen=True, kw_only=True)
class Machine:
    """A machine, the Python that examines it, and the required libraries and modules that were found."""

    system: str
    architecture: str
    glibc: str | None = None
    python: str
    """Major, minor and micro."""
    executable: str
    shared: bool | None = None
    """Whether this Python is linked to a shared libpython; None: unknown."""
    temp_folder: Path
    """Folder in which FMUs are unpacked"""
    python_libraries: tuple[PythonLibrary, ...] = ()
    """Those that a host that is not Python could load, best first."""
    found: Libraries = field(default_factory=dict)
    """Libraries that the loader of a program that is not Python finds."""
    found_by_python: Libraries = field(default_factory=dict)
    """Libraries that the loader of this Python finds."""
    modules: Mapping[str, bool] = field(default_factory=dict)
    """Whether this Python can import a module."""

    def platforms(self, version: int) -> tuple[str, ...]:
        """The folders in `binaries/` for this machine in a version of FMI; the first existing one is used.

        For processors other than x86, FMI 2.0 uses the names of FMI 3.0 (FMI 2.0.4, section 2.3), tools those of x86.
        """
        name = f"{ARCHITECTURES.get(self.architecture, self.architecture)}-{SYSTEMS.get(self.system, self.system)}"
        if version == 3:
            return (name,)
        usual = _FOLDERS.get(self.system, self.system) + ("64" if self.architecture in _ON_64_BITS else "32")
        return (usual,) if self.architecture.startswith("x86") else (name, usual)


def this_machine(fmus: Iterable[InspectedFmu]) -> Machine:
    """This machine, examined for the requirements of `fmus`."""
    fmus = tuple(fmus)
    system, architecture = _SYSTEMS.get(platform.system(), platform.system()), _architecture()
    programs = loader_of_programs(system, architecture)
    own = loader_of_this_python(programs)
    required = {
        name: part.binary.run_path
        for fmu in fmus
        for part in fmu.platforms
        if part.binary is not None and part.binary.fits(system, architecture)
        for name in part.binary.dependency_names
    }
    return Machine(
        system=system,
        architecture=architecture,
        glibc=_glibc(),
        python=".".join(map(str, sys.version_info[:3])),
        executable=sys.executable,
        shared=_shared(system),
        temp_folder=Path(tempfile.gettempdir()),
        python_libraries=python_libraries(programs),
        found={name: _library(programs, name, run_path) for name, run_path in required.items()},
        found_by_python={name: _library(own, name, run_path) for name, run_path in required.items()},
        modules={name: _importable(name) for fmu in fmus if fmu.python is not None for name in fmu.python.imports},
    )


def _architecture() -> str:
    """The architecture of this process, which may have 32 bits on a machine of 64."""
    name = sysconfig.get_platform().rpartition("-")[2] if os.name == "nt" else platform.machine()
    wide = struct.calcsize("P") == 8
    if name.lower() in (*_X86, "win32"):
        return "x86-64" if wide else "x86"
    if name.lower() in _ARM:
        return "aarch64" if wide else "arm"
    return name


def _glibc() -> str | None:
    try:
        return os.confstr("CS_GNU_LIBC_VERSION")
    except (AttributeError, ValueError, OSError):  # not on Windows, not with another C library
        return None


def _shared(system: str) -> bool | None:
    """Whether the executable needs a libpython; on Windows every Python has its DLL."""
    if system == WINDOWS:
        return True
    binary = read_file(Path(sys.executable))
    if binary is None or binary.dependencies is None:
        return None
    return any(name.startswith("libpython") for name in binary.dependency_names)


def _library(where: DynamicLoader, name: str, run_path: Iterable[str]) -> Library | None:
    path = where.find(name, run_path)
    binary = None if path is None else read_file(path)
    return None if path is None or binary is None else Library(path=path, versions=binary.defined_versions)


def _importable(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except (ImportError, ValueError):
        return False
