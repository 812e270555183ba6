"""What the bits of a run depend on beside its system: versions, sources, the machine."""

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

from orchestration.processes import subprocesses

ROOTS = (
    "orchestration.runs.simulation",
    "orchestration.workers.task",
    "orchestration.fmi.isolated_process",
    "orchestration.runs.apart_process",
)
"""Where the code that flies begins; the last two are started by their names, as processes of their own."""
_ASIDE = (
    "orchestration.building.fmus",
    "orchestration.figures.gallery",
    "orchestration.recording.tables",
    "orchestration.requests.ssp.reading",
    "orchestration.runs.draw",
    "orchestration.workers.row",
)
"""What finds FMUs, reads SSP, keeps results and draws them; it is imported there and changes no bit of them."""
_PACKAGES = ("orchestration", "fmu_kit")
_FEATURES = ("fma", "fma4", "avx2", "avx512f")
"""of a processor, by which the C library and numpy choose among their mathematical functions"""


@dataclass(frozen=True, kw_only=True)
class Sources:
    """The sources on the flight's path by one hash, and how their files are told from edited ones on this machine."""

    hash: str
    states: Mapping[str, tuple[int, int, int]]
    """by path: size, and when content and file were changed last [ns]"""

    @classmethod
    def read(cls) -> "Sources":
        """As they are now."""
        files = flight_sources()
        states = {str(path): _state(path) for path in files.values()}  # before: what is edited meanwhile is not these
        return cls(hash=sources_hash(files), states=states)

    def now(self) -> "Sources":
        """These if no file has changed since, else as they are now: to read all of them takes a tenth of a second."""
        with contextlib.suppress(OSError):
            if all(_state(Path(path)) == state for path, state in self.states.items()):
                return self
        return Sources.read()


@functools.cache
def sources() -> Sources:
    """Those of this process, read once."""
    return Sources.read()


def software(sources: Sources) -> dict[str, str]:
    """Versions of what a run's bits depend on."""
    packages = {name: importlib.metadata.version(name) for name in ("quadcosim", "numpy", "fmpy")}
    return {**packages, "sources": sources.hash}


@functools.cache
def versions() -> dict[str, str]:
    """Those of this process."""
    return software(sources())


def flight_sources() -> dict[str, Path]:
    """The modules of this project that the code that flies imports, directly or not, by name."""
    from orchestration.engines import loop  # not before: a worker that is told of its sources needs none of them
    from orchestration.engines.batch import kernels
    from orchestration.requests import request

    found: dict[str, Path] = {}
    seen, waiting = set(_ASIDE), list(ROOTS)
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        if (path := _source(name)) is not None:
            found[name] = path
            waiting += imported(path.read_text(encoding="utf-8"))
    return found | {path.name: path for path in (*request.FILES, *loop.FILES, *kernels.FILES)}


_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+)?import[ \t]+(\([^)]*\)|[^#\n]*)", re.MULTILINE)


def imported(source: str) -> Iterator[str]:
    """The names of all that a module's source imports: modules, and what may be a module of a package.

    By its lines: each sweep begins with this, and syntax trees of a hundred modules take it half a second.
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
    found = path.stat()
    return found.st_size, found.st_mtime_ns, found.st_ctime_ns


def _source(name: str) -> Path | None:
    """The file of a module of this project; None for anything else."""
    package, *parts = name.split(".")
    if package not in _PACKAGES or not parts:
        return None
    path = os.path.join(subprocesses.ROOT, package, *parts) + ".py"
    return Path(path) if os.path.isfile(path) else None  # a name that is imported from a module has none


@functools.cache
def machine() -> str:
    """The kind of this machine: flights on different kinds may differ in the last bit."""
    libc = " ".join(platform.libc_ver()) or platform.system()
    features = " ".join(name for name in _FEATURES if name in _processor_flags())
    return f"Python {platform.python_version()}, {libc}, {platform.machine()} {features}".rstrip()


def _processor_flags() -> list[str]:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return []
    return next((line.partition(":")[2].split() for line in lines if line.startswith(("flags", "Features"))), [])
