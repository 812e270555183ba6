"""The requirements of an .fmu file: from its description, its binaries, and the Python sources in it."""

import ast
import io
import math
import posixpath
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from fmu_kit import loader
from fmu_kit.syntax_trees import parse_module
from orchestration.components.checks.doctor import binaries
from orchestration.components.fmi.access import Interface
from orchestration.components.fmi.archive import (
    DESCRIPTION,
    TOKENS,
    UnreadableFmuError,
    read_archive,
    read_checked_root,
    version_of,
)
from orchestration.components.fmi.slaves import ENTRY, binary_folders
from orchestration.foundation.processes.passable import passable

CO_SIMULATION = "CoSimulation"
KINDS = {CO_SIMULATION: "co-simulation", "ModelExchange": "model exchange", "ScheduledExecution": "scheduled execution"}
"""Kinds of an FMU by the elements that declare them"""
CALLED: Mapping[str, Interface] = {CO_SIMULATION: "co-simulation", "ModelExchange": "model-exchange"}
"""Kinds that runs use: the interface that it is called by"""

_MODULES = (".py", ".so", ".pyd")
_IMPORT_ERRORS = {"ImportError", "ModuleNotFoundError"}

ARCHITECTURES = {
    "x86": "x86",
    "x86-64": "x86_64",
    "arm": "aarch32",
    "aarch64": "aarch64",
    "riscv32": "riscv32",
    "riscv64": "riscv64",
    "ppc32": "ppc32",
    "ppc64": "ppc64",
}
"""names in FMI 3.0 by the names of the doctor"""
SYSTEMS = {binaries.LINUX: "linux", binaries.WINDOWS: "windows", binaries.MACOS: "darwin"}
"""names in FMI 3.0 by the names of the doctor"""
_TUPLES = {
    f"{architecture}-{folder}": (system, (name,))
    for name, architecture in ARCHITECTURES.items()
    for system, folder in SYSTEMS.items()
}
PLATFORMS: Mapping[int, Mapping[str, tuple[str, tuple[str, ...]]]] = {
    2: {
        **{folder: machine for folder, machine in _TUPLES.items() if not folder.startswith("x86")},
        "linux32": (binaries.LINUX, ("x86",)),
        "linux64": (binaries.LINUX, ("x86-64",)),
        "win32": (binaries.WINDOWS, ("x86",)),
        "win64": (binaries.WINDOWS, ("x86-64",)),
        "darwin32": (binaries.MACOS, ("x86",)),
        "darwin64": (binaries.MACOS, ("x86-64", "aarch64")),
    },
    3: _TUPLES,
}
"""The folders that a version of FMI defines, and their machines.

For processors other than x86, FMI 2.0 uses the names of FMI 3.0 (FMI 2.0.4, section 2.3).
"""

_SUFFIXES = {"linux": ".so", "win": ".dll", "darwin": ".dylib"}


@passable
@dataclass(frozen=True, kw_only=True)
class PlatformBinary:
    """The FMU's library for one platform."""

    platform: str
    """The folder in `binaries/`."""
    binary: binaries.Binary | None = None
    """None: it cannot be read, for the reason in `problem`."""
    finds_python: bool = False
    """Whether it is a loader of this project, which opens a libpython and then pythonfmu's library."""
    bundled: frozenset[str] = frozenset()
    """Dependencies inside the FMU, in folders that the loader searches."""
    problem: str | None = None


@passable
@dataclass(frozen=True, kw_only=True)
class PythonSources:
    """The requirements of the sources in an FMU of pythonfmu."""

    imports: tuple[str, ...]
    """Top-level packages that are neither bundled nor in the standard library of this Python."""
    problems: tuple[str, ...]


@passable
@dataclass(frozen=True, kw_only=True)
class InspectedFmu:
    """The requirements of an FMU."""

    path: Path
    version: int
    """2 or 3, of FMI"""
    kinds: tuple[str, ...]
    model_identifier: str
    guid: str
    """GUID; in FMI 3.0 the instantiation token"""
    start_time: float
    """Start of the default experiment [s]; 0 if it has none"""
    needs_tool: str | None
    """The tool that must be installed, as the FMU declares (needsExecutionTool)."""
    platforms: tuple[PlatformBinary, ...]
    requires_python: str | None
    """The version specifier that the description declares, if any."""
    python: PythonSources | None
    """None if it is not made by pythonfmu."""


def inspected(path: Path, size_limit: float = math.inf) -> InspectedFmu:
    """The requirements of a file; raises `UnreadableFmuError` if it is no FMU, or unpacks to over `size_limit` MB."""
    archive = read_archive(path, size_limit)
    description = read_checked_root(archive)
    version = version_of(description)
    kinds = tuple(kind for kind in KINDS if description.find(kind) is not None)
    chosen = description.find(kinds[0]) if kinds else None
    if chosen is None:
        raise UnreadableFmuError(f"expected {' or '.join(list(KINDS)[:version])} in {DESCRIPTION}")
    declared = description.find("VendorAnnotations/Tool[@name='quadcosim']/Python")
    tool = description.get("generationTool", "the tool that made it")
    return InspectedFmu(
        path=path,
        version=version,
        kinds=kinds,
        model_identifier=chosen.get("modelIdentifier", ""),
        guid=description.get(TOKENS[version], ""),
        start_time=_start_time(description),
        needs_tool=tool if chosen.get("needsExecutionTool") in ("true", "1") else None,
        platforms=_platforms(archive.files, version, chosen.get("modelIdentifier", "")),
        requires_python=None if declared is None else declared.get("requires"),
        python=read_sources(archive.files),
    )


def _start_time(description: Element) -> float:
    experiment = description.find("DefaultExperiment")
    try:
        return float("0" if experiment is None else experiment.get("startTime", "0"))
    except ValueError:  # reported by `validate`
        return 0.0


def _platforms(files: Mapping[str, bytes], version: int, identifier: str) -> tuple[PlatformBinary, ...]:
    folders = [folder for folder in binary_folders(files) if not _is_static(version, folder)]
    return tuple(_platform(files, version, folder, identifier) for folder in folders)


def _is_static(version: int, folder: str) -> bool:
    """Whether a folder of FMI 3.0 has static libraries: a compiler's name follows that of the system."""
    return version == 3 and folder.count("-") > 1


def _platform(files: Mapping[str, bytes], version: int, folder: str, identifier: str) -> PlatformBinary:
    system_name = folder if version == 2 else folder.rpartition("-")[2]
    suffixes = [suffix for system, suffix in _SUFFIXES.items() if system_name.startswith(system)] or _SUFFIXES.values()
    expected = [f"binaries/{folder}/{identifier}{suffix}" for suffix in suffixes]
    found = next((name for name in expected if name in files), None)
    if found is None:
        return PlatformBinary(platform=folder, problem=f"expected {' or '.join(expected)}")
    try:
        binary = binaries.read(io.BytesIO(files[found]))
        finds_python = folder == posixpath.basename(loader.PLATFORM) and loader.BESIDE in files
        if finds_python:
            binary = binaries.combined(binary, binaries.read(io.BytesIO(files[loader.BESIDE])))
    except binaries.UnreadableError as error:
        return PlatformBinary(platform=folder, problem=f"{found}: {error}")
    searched = {f"binaries/{folder}"} if binary.system == binaries.WINDOWS else set(_inside(binary, folder))
    bundled = {name for name in binary.dependency_names for place in searched if f"{place}/{name}" in files}
    problem = _mismatch(version, folder, binary)
    return PlatformBinary(
        platform=folder, binary=binary, finds_python=finds_python, bundled=frozenset(bundled), problem=problem
    )


def _inside(binary: binaries.Binary, folder: str) -> list[str]:
    """Folders of the archive in which the loader searches for an ELF library."""
    own = f"binaries/{folder}"
    return [posixpath.normpath(binaries.origin_in(entry, own)) for entry in binary.run_path]


def _mismatch(version: int, folder: str, binary: binaries.Binary) -> str | None:
    """The problem of a binary whose header is for another machine than its folder; None: there is none."""
    if folder not in PLATFORMS[version]:
        return None
    system, architectures = PLATFORMS[version][folder]
    if binary.system == system and set(binary.architectures) <= set(architectures):
        return None
    return f"a binary for {binary.target}, expected {system}, {' or '.join(architectures)} in this folder"


def read_sources(files: Mapping[str, bytes]) -> PythonSources | None:
    """Read the sources in `resources`, of files by name; None for an FMU that pythonfmu did not make."""
    if ENTRY not in files:
        return None
    bundled = set(filter(None, map(_bundled, files)))
    imports: set[str] = set()
    problems = []
    entry = files[ENTRY].decode("utf-8", "replace").strip()
    if f"resources/{entry}.py" not in files:
        problems.append(f"{ENTRY} names {entry}, but there is no resources/{entry}.py")
    for name in files:
        if name.startswith("resources/") and name.endswith(".py"):
            try:
                imports |= set(_needed(parse_module(files[name])))
            except (SyntaxError, ValueError) as error:
                problems.append(f"{name}: not Python {sys.version_info[0]}.{sys.version_info[1]}: {error}")
    beyond = imports - bundled - sys.stdlib_module_names
    return PythonSources(imports=tuple(sorted(beyond)), problems=tuple(problems))


def _bundled(name: str) -> str | None:
    """The name by which a file of the archive, or the package that it is in, can be imported."""
    folder, _, place = name.partition("/")
    return (
        place.partition("/" if "/" in place else ".")[0] if folder == "resources" and place.endswith(_MODULES) else None
    )


def _needed(node: ast.AST) -> Iterator[str]:
    """Top-level packages imported in a tree, without optional ones."""
    if isinstance(node, ast.Import):
        yield from (alias.name.partition(".")[0] for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        if node.level == 0 and node.module is not None:
            yield node.module.partition(".")[0]
    elif isinstance(node, ast.Try) and any(map(_catches_import_error, node.handlers)):
        for statement in (*node.orelse, *node.finalbody):
            yield from _needed(statement)
    elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
        for statement in node.orelse:
            yield from _needed(statement)
    else:
        for child in ast.iter_child_nodes(node):
            yield from _needed(child)


def _catches_import_error(handler: ast.ExceptHandler) -> bool:
    caught = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    return any(isinstance(error, ast.Name) and error.id in _IMPORT_ERRORS for error in caught)
