"""What a dynamic loader finds, and the Pythons by which a host that is not Python can run an FMU of pythonfmu.

A Python host first searches the run path of its executable. A host that is not Python searches as any program.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
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


THIS_PYTHON, PRELOADED, ON_PATH, BY_LOADER = "this Python", "LD_PRELOAD", "PATH", "the loader"

_LIBPYTHON = re.compile(r"libpython(3\.\d+)[dm]*\.so")
"""Names of libpython without that of free-threaded Python, whose binary interface differs"""

_PYTHON_DLL = re.compile(r"python3(\d+)\.dll", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class PythonLibrary:
    """A Python that a host could load: its shared libpython, or its python3.dll."""

    path: Path
    version: str
    """Major and minor."""
    found_by: str
    """`PRELOADED`, `ON_PATH`, `BY_LOADER` or `THIS_PYTHON`."""
    home: Path | None = None
    """The PYTHONHOME with which it finds its standard library; None if it needs none."""


def python_libraries(loader: DynamicLoader) -> tuple[PythonLibrary, ...]:
    """Pythons that a host that is not Python could load, best first.

    A library that is already loaded or on PATH comes first, as it takes precedence; then the version of this Python,
    then newer before older.
    """
    if loader.system == WINDOWS:
        return tuple(_python_dlls(loader))
    if loader.system != LINUX:
        return ()
    this = f"{sys.version_info[0]}.{sys.version_info[1]}"

    def order(library: PythonLibrary) -> tuple[bool, bool, int]:
        minor = int(library.version.partition(".")[2])
        return library.found_by != PRELOADED, library.version != this, -minor

    found: dict[Path, PythonLibrary] = {}
    for library in (*_preloaded(loader), *_loadable(loader), *_own()):
        if loader.takes(library.path):
            found.setdefault(library.path.resolve(), library)
    return tuple(sorted(found.values(), key=order))


def _preloaded(loader: DynamicLoader) -> Iterator[PythonLibrary]:
    for name in re.split(r"[\s:]+", os.environ.get("LD_PRELOAD", "")):
        path = loader.find(name) if name else None
        match = _LIBPYTHON.match(Path(name).name)
        if path is not None and match:
            yield PythonLibrary(path=path, version=match[1], found_by=PRELOADED)


def _loadable(loader: DynamicLoader) -> Iterator[PythonLibrary]:
    cached = (path for paths in loader.cache.values() for path in paths)
    for path in (*_in_folders(loader.first), *cached, *_in_folders(loader.last)):
        match = _LIBPYTHON.match(path.name)
        if match:
            yield PythonLibrary(path=path, version=match[1], found_by=BY_LOADER)


def _in_folders(folders: Iterable[Path]) -> Iterator[Path]:
    """libpythons, the name installed without development files before its shorter alias."""
    for folder in folders:
        yield from sorted(folder.glob("libpython3.*.so*"), reverse=True)


def _own() -> Iterator[PythonLibrary]:
    """The library of this Python, if there is a shared one."""
    for folder in (sysconfig.get_config_var("LIBDIR"), f"{sys.base_prefix}/lib"):
        for variable in ("INSTSONAME", "LDLIBRARY"):
            path = Path(str(folder), str(sysconfig.get_config_var(variable)))
            match = _LIBPYTHON.match(path.name)
            if match:
                home = Path(sys.base_prefix)
                yield PythonLibrary(path=path, version=match[1], found_by=THIS_PYTHON, home=home)


def _python_dlls(loader: DynamicLoader) -> Iterator[PythonLibrary]:
    """The python3.dll that is first on PATH, and that of this Python."""
    on_path = loader.find("python3.dll")
    own = Path(sys.base_prefix, "python3.dll")
    for path, found_by in ((on_path, ON_PATH), (own, THIS_PYTHON)):
        if path is not None and path.is_file():
            minors = [int(match[1]) for match in map(_PYTHON_DLL.match, os.listdir(path.parent)) if match]
            if minors:
                yield PythonLibrary(path=path, version=f"3.{max(minors)}", found_by=found_by)
