"""The Pythons that a host that is not Python can load, to run an FMU of pythonfmu."""

import os
import re
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from orchestration.components.checks.doctor.binaries import LINUX, WINDOWS
from orchestration.components.checks.doctor.loader import DynamicLoader

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
