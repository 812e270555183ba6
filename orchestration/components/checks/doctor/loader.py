"""The search path for libraries of the dynamic loader of a host.

A Python host first searches the run path of its executable. A host that is not Python searches as any program.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from orchestration.components.checks.doctor.binaries import LINUX, WINDOWS, Binary, UnreadableError, origin_in, read

_CACHED = re.compile(r"\s+(\S+) \(.*\) => (.+)")


@dataclass(frozen=True, kw_only=True)
class DynamicLoader:
    """A dynamic loader: it searches folders, the run path of the binary, the cache, and more folders, in this order."""

    system: str
    architecture: str
    first: tuple[Path, ...] = ()
    cache: Mapping[str, tuple[Path, ...]] = field(default_factory=dict)
    last: tuple[Path, ...] = ()

    def find(self, name: str, run_path: Iterable[str] = ()) -> Path | None:
        """The file that it would load for `name`, skipping those for other machines."""
        before = (*self.first, *map(Path, run_path))
        candidates = [folder / name for folder in before]
        candidates += self.cache.get(name, ())
        candidates += [folder / name for folder in self.last]
        return next(filter(self.takes, candidates), None)

    def takes(self, path: Path) -> bool:
        """Whether there is a library for its machine."""
        binary = read_file(path)
        return binary is not None and binary.fits(self.system, self.architecture)


def read_file(path: Path) -> Binary | None:
    """The headers of a file of this machine without its symbols; None if it is missing or no library."""
    try:
        with path.open("rb") as stream:
            return read(stream, symbols=False)
    except (OSError, UnreadableError):
        return None


def loader_of_programs(system: str, architecture: str) -> DynamicLoader:
    """The loader of a program started here that is not Python."""
    if system == WINDOWS:
        root = os.environ.get("SYSTEMROOT", r"C:\Windows")
        return DynamicLoader(
            system=system, architecture=architecture, first=(Path(root, "System32"), Path(root)), last=_folders("PATH")
        )
    if system == LINUX:
        return DynamicLoader(
            system=system,
            architecture=architecture,
            first=_folders("LD_LIBRARY_PATH"),
            cache=_ldconfig(),
            last=_default_folders(),
        )
    return DynamicLoader(system=system, architecture=architecture)


def loader_of_this_python(programs: DynamicLoader) -> DynamicLoader:
    """The loader of this process, which first searches the run path of its executable."""
    if programs.system == WINDOWS:
        return replace(programs, first=(Path(sys.base_prefix), *programs.first))
    executable = Path(sys.executable).resolve()
    binary = read_file(executable)
    if binary is None:
        return programs
    own = (origin_in(folder, str(executable.parent)) for folder in binary.inherited_run_path)
    return replace(programs, first=(*map(Path, own), *programs.first))


def _folders(variable: str) -> tuple[Path, ...]:
    return tuple(Path(folder) for folder in os.environ.get(variable, "").split(os.pathsep) if folder)


def _default_folders() -> tuple[Path, ...]:
    """The folders that glibc and musl search without a cache."""
    triplet = sysconfig.get_config_var("MULTIARCH") or f"{platform.machine()}-linux-gnu"
    return tuple(map(Path, (f"/lib/{triplet}", f"/usr/lib/{triplet}", "/lib64", "/usr/lib64", "/lib", "/usr/lib")))


def _ldconfig() -> dict[str, tuple[Path, ...]]:
    """The loader's cache, by name; empty without an ldconfig that prints it."""
    program = shutil.which("ldconfig", path=os.pathsep.join((os.environ.get("PATH", ""), "/sbin", "/usr/sbin")))
    if program is None:
        return {}
    done = subprocess.run([program, "-p"], capture_output=True, text=True, errors="replace", check=False)
    cache: dict[str, tuple[Path, ...]] = {}
    for match in filter(None, map(_CACHED.match, done.stdout.splitlines())):
        cache[match[1]] = (*cache.get(match[1], ()), Path(match[2]))
    return cache
