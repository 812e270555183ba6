"""What the bits of a run depend on besides its system: versions, sources, machine."""

import contextlib
import functools
import hashlib
import importlib.metadata
import os
import platform
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from orchestration.foundation.processes import subprocesses

ROOTS = (
    "orchestration.simulation.runs.simulation",
    "orchestration.simulation.workers.task",
    "orchestration.components.fmi.isolated_process",
    "orchestration.simulation.runs.apart_process",
    "orchestration.quadrotor.scenarios.file",
)
"""Entry modules of the simulation code; two are started by name as separate processes, one is registered"""
_EXCLUDED = (
    "orchestration.components.building.fmus",
    "orchestration.simulation.figures.style",
    "orchestration.foundation.recording.tables",
    "orchestration.simulation.requests.ssp.reading",
    "orchestration.simulation.runs.draw",
    "orchestration.simulation.workers.row",
)
"""Modules imported by that code which affect no result: they find FMUs, read SSP, keep and draw results"""
_PACKAGES = ("orchestration", "fmu_kit")
_FEATURES = ("fma", "fma4", "avx2", "avx512f")
"""Processor flags by which the C library and NumPy choose their mathematical functions"""


@dataclass(frozen=True, kw_only=True)
class Sources:
    """The hash of the simulation code's sources, and the state of their files to detect edits on this machine."""

    hash: str
    states: Mapping[str, tuple[int, int, int]]
    """State of a file by path: size, and times of the last change of content and of status [ns]"""

    @classmethod
    def read(cls) -> "Sources":
        """Read the present sources."""
        files = simulation_sources()
        states = {
            str(path): _state(path) for path in files.values()
        }  # before hashing, so that a concurrent edit is detected
        return cls(hash=sources_hash(files), states=states)

    def current(self) -> "Sources":
        """These if no file has changed since, else read again, which takes a tenth of a second."""
        with contextlib.suppress(OSError):
            if all(_state(Path(path)) == state for path, state in self.states.items()):
                return self
        return Sources.read()


@functools.cache
def sources() -> Sources:
    """The sources of this process, read once."""
    return Sources.read()


def software(sources: Sources) -> dict[str, str]:
    """Versions of the software that a run's bits depend on."""
    packages = {name: importlib.metadata.version(name) for name in ("quadcosim", "numpy", "fmpy")}
    return {**packages, "sources": sources.hash}


@functools.cache
def versions() -> dict[str, str]:
    """The software versions of this process."""
    return software(sources())


def simulation_sources() -> dict[str, Path]:
    """The modules of this project that the simulation code imports, directly or not, by name."""
    from orchestration.simulation.engines import (
        compiled,  # deferred: a worker that receives its sources does not need them
    )
    from orchestration.simulation.engines.batch import kernels
    from orchestration.simulation.requests.kinds import KINDS

    modules: dict[str, Path] = {}
    seen, waiting = set(_EXCLUDED), list(ROOTS)
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        if (path := _source(name)) is not None:
            modules[name] = path
            waiting += imported(path.read_text(encoding="utf-8"))
    based_on = (file for kind in KINDS.all() for file in kind.files)
    return modules | {path.name: path for path in (*based_on, *compiled.FILES, *kernels.FILES)}


_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+)?import[ \t]+(\([^)]*\)|[^#\n]*)", re.MULTILINE)


def imported(source: str) -> Iterator[str]:
    """The names that a module's source imports: modules, and names that may be modules of a package.

    Parsed by regular expressions, since each sweep starts with it: syntax trees of a hundred modules take 0.5 s.
    """
    for module, names in _IMPORT.findall(source):
        if module:
            yield module
        for name in re.findall(r"([\w.]+)(?: as \w+)?", names):
            yield f"{module}.{name}" if module else name


def sources_hash(sources: Mapping[str, Path]) -> str:
    """One hash of the content of all modules."""
    digest = hashlib.sha256()
    for name, path in sorted(sources.items()):
        digest.update(f"{name}\0".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _state(path: Path) -> tuple[int, int, int]:
    status = path.stat()
    return status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _source(name: str) -> Path | None:
    """The file of a module of this project; None for anything else."""
    package, *parts = name.split(".")
    if package not in _PACKAGES or not parts:
        return None
    path = os.path.join(subprocesses.ROOT, package, *parts) + ".py"
    return Path(path) if os.path.isfile(path) else None  # none for a name that is not a module


@functools.cache
def machine() -> str:
    """The kind of this machine: results on different kinds may differ in the last bit."""
    libc = " ".join(platform.libc_ver()) or platform.system()
    features = " ".join(name for name in _FEATURES if name in _processor_flags())
    return f"Python {platform.python_version()}, {libc}, {platform.machine()} {features}".rstrip()


def _processor_flags() -> list[str]:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return []
    return next((line.partition(":")[2].split() for line in lines if line.startswith(("flags", "Features"))), [])
