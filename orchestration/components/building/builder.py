"""Builds FMUs from slaves: their packings, which of them are out of date, and the process that packs them."""

import contextlib
import functools
import hashlib
import keyword
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from fmu_kit import packaging
from fmu_kit.archive import read_source_hash
from fmu_kit.bundle import SHARED_PACKAGES, PackagingError, Target, module_path
from fmu_kit.compiler.pack import freshness
from fmu_kit.discovery import slave_beside, slaves_in, unfinished_in
from fmu_kit.new_files import write_atomically
from fmu_kit.variants import Variant
from orchestration.components.building import consent
from orchestration.components.building.models import MODELS, WRAPPED
from orchestration.components.fmi import trust
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.foundation.basics.records import Scalar
from orchestration.foundation.processes import subprocesses


@dataclass(frozen=True, kw_only=True)
class Packing:
    """A kind of FMU that can be built of a slave."""

    folder: str
    """Folder of such FMUs, relative to the modules of the slaves and to `default_folder`"""
    command: tuple[str, ...]
    """the module that packs, and its first arguments"""
    source_hash: Callable[[Target], str]

    def base_of(self, path: Path) -> Path | None:
        """The folder of the modules of an FMU that is built this way; None if its path is not in such a folder."""
        depth = len(Path(self.folder).parts)
        return path.parents[depth] if path.parts[-1 - depth : -1] == Path(self.folder).parts else None

    def slave_of(self, path: Path) -> Target | None:
        """The slave of an FMU that is built this way, if the path is in the folder and a module defines the slave."""
        folder = self.base_of(path)
        return None if folder is None else translating_errors(slave_beside, folder / path.name)


IN_PYTHON = Packing(folder="", command=("fmu_kit.packaging",), source_hash=packaging.source_hash)
NATIVE = Packing(folder="native", command=("fmu_kit.compiler.pack.building",), source_hash=freshness.source_hash)
"""FMUs without Python inside, by a C compiler"""
NATIVE_FMI_3 = Packing(
    folder="native/fmi3",
    command=("fmu_kit.compiler.pack.building", "--fmi", "3"),
    source_hash=functools.partial(freshness.source_hash, version=3),
)
CLOCKED_FMI_3 = replace(
    NATIVE_FMI_3, folder="native/fmi3/clocked", command=("fmu_kit.compiler.pack.building", "--fmi", "3", "--clock")
)
"""Those at whose input clock a slave samples that otherwise has its own period"""
PACKINGS = (CLOCKED_FMI_3, NATIVE_FMI_3, NATIVE, IN_PYTHON)
"""Those with a separate folder first: `native/NAME` is an FMU of this project, as NAME is."""


def out_of_date(names: Iterable[str], folder: Path, packing: Packing = IN_PYTHON) -> list[str]:
    """Those of this project's FMUs in `folder` that are missing, were not built here, or of other sources."""
    return [
        name
        for name, path, slave in ((name, folder / f"{name}.fmu", Target.parse(MODELS[name])) for name in names)
        if read_source_hash(path) != _source_hash(packing, slave) or is_of_elsewhere(path, slave)
    ]


def packages_of(target: Target) -> tuple[str, ...]:
    """All packages whose sources an FMU of this project depends on."""
    return (*SHARED_PACKAGES, target.module.partition(".")[0])


def _source_hash(packing: Packing, target: Target) -> str:
    """The hash of a slave, computed once while the files of its packages, or all beside it, are the same.

    That of this project's is kept in the user's cache: parsing what all modules import takes 60 ms, which each command
    would spend. What lies among packages, or has a page by hand, may depend on any file: it is computed each time.
    """
    packages = packages_of(target) if target.root is None else SHARED_PACKAGES
    folders = [str(module_path(package).parent) for package in packages]
    files = [file for folder in folders for file in _files(folder)]
    if target.root is not None:
        with os.scandir(target.root) as entries:
            beside = [entry for entry in entries if entry.name != "__pycache__"]
        is_alone = target.fragment.parent == target.root and not target.fragment.is_file()
        if not is_alone or any(Path(entry.path, "__init__.py").is_file() for entry in beside):
            return packing.source_hash(target)
        files += [_state(entry) for entry in beside if entry.name.endswith((".py", ".png"))]
    return _cached_source_hash(packing, target, shutil.which("cc"), tuple(files))


@functools.lru_cache(maxsize=64)
def _cached_source_hash(
    packing: Packing, target: Target, compiler: str | None, files: tuple[tuple[str, int, int, int], ...]
) -> str:
    if target.root is not None:
        return packing.source_hash(target)
    import platformdirs

    state = repr((packing.folder, target, compiler, files, sys.version))
    key = hashlib.sha256(state.encode("utf-8", "surrogateescape")).hexdigest()
    path = Path(platformdirs.user_cache_dir("quadcosim")) / "sources" / key
    with contextlib.suppress(OSError):
        return path.read_text(encoding="ascii")
    source_hash = packing.source_hash(target)
    with contextlib.suppress(OSError):
        write_atomically(path, source_hash)
    return source_hash


def _files(folder: str) -> Iterator[tuple[str, int, int, int]]:
    """The files of a folder, each with the times [ns] of its last change of content and of any change, and its size."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if not entry.is_dir():
                yield _state(entry)
            elif entry.name != "__pycache__":
                yield from _files(entry.path)


def _state(entry: "os.DirEntry[str]") -> tuple[str, int, int, int]:
    about = entry.stat()
    return entry.path, about.st_mtime_ns, about.st_ctime_ns, about.st_size


def build(
    names: Iterable[str],
    folder: Path,
    announce: Callable[[str], None] | None = None,
    *,
    packing: Packing = IN_PYTHON,
) -> list[Path]:
    """Build FMUs of this project into `folder`, as `build_slaves`; returns their paths."""
    return build_slaves([Target.parse(MODELS[name]) for name in names], folder, announce, packing=packing)


def slaves_of(folder: Path) -> list[Target]:
    """The slaves that the modules of a folder define; raises `UsageError` if there are none."""
    if not folder.is_dir():
        raise UsageError(f"{folder}: expected a folder with modules that define slaves")
    slaves = translating_errors(slaves_in, folder)
    if not slaves:
        if described := described_in(folder):
            raise _c_already(folder, described[0])
        for name in unfinished_in(folder):
            _expect_finished(folder, name)
        raise UsageError(f"{folder}: expected a module with a subclass of fmu_kit.slave.Slave that has a description")
    return slaves


def _expect_finished(folder: Path, name: str) -> None:
    if left_open := unfinished_in(folder).get(name):
        raise UsageError(f"{name} has no {' and no '.join(left_open)}: expected a slave in {folder} to define it")


def described_in(folder: Path) -> list[Path]:
    """The files of a folder that describe code in C, of which `wrap` makes FMUs."""
    return [path for path in sorted(folder.glob(f"*{WRAPPED}")) if _describes_c(path)]


def _c_already(place: Path, described: Path) -> UsageError:
    return UsageError(f"{place}: this is C already, of which an FMU is made by quadcosim wrap {described}")


def _describes_c(path: Path) -> bool:
    from orchestration.components.building import wrap  # not before: loads what reads such files

    with contextlib.suppress(UsageError):
        return bool(wrap.load(path).sources)
    return False


def slaves_named(text: str) -> list[Target]:
    """One of this project's slaves by its name, all slaves of a folder, or one of them as FOLDER/NAME.

    Raises `UsageError` if there is none.
    """
    path = Path(text)
    if text in MODELS:
        return [Target.parse(MODELS[text])]
    if path.is_dir():
        return slaves_of(path)
    if not path.parent.is_dir() or len(path.parts) < 2:
        raise UsageError(
            f"{text}: expected {' or '.join(MODELS)}, a folder with modules that define slaves, or FOLDER/NAME for one"
        )
    if path.suffix == WRAPPED and path.is_file() and _describes_c(path):
        raise _c_already(path, path)
    slaves = slaves_of(path.parent)
    named = [target for target in slaves if target.model == path.name]
    if not named:
        _expect_finished(path.parent, path.name)
        known = " or ".join(str(path.parent / target.model) for target in slaves)
        raise UsageError(f"{text}: expected {known}, or {path.parent} for all slaves of its modules")
    return named


def folder_of(text: str) -> Path:
    """The folder of slaves that are named as by `slaves_named`, and are not of this project."""
    path = Path(text)
    return path if path.is_dir() else path.parent


def with_fixed(slave: Target, name: str, values: Mapping[str, Scalar]) -> Target:
    """A variant of a slave with fixed parameters, by their FMI names, as the model `name`.

    Raises `UsageError` for an invalid name.
    """
    if not (name.isascii() and name.isidentifier() and not keyword.iskeyword(name)):
        raise UsageError(f"--name {name}: expected letters, digits and _, no digit first")
    return replace(slave, variant=Variant.of(name, values))


def build_slaves(
    targets: Sequence[Target],
    folder: Path,
    announce: Callable[[str], None] | None = None,
    *,
    packing: Packing = IN_PYTHON,
    systems: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Path]:
    """Build slaves whose modules are in one folder into `folder`, in a separate process; returns the FMUs' paths.

    FMUs without Python inside are for this machine, or for `systems`: `all` or a list with commas. `announce` receives
    a line for each file that could not be packed, and for what takes long, `progress` the share that is built. Raises
    `QuadcosimError` with the last line of the build's output if it fails.
    """
    options = [] if systems is None else ["--target", systems]
    paths = _run_packer([*packing.command, *options], targets, folder, announce, progress)
    for target, path in zip(targets, paths, strict=True):
        if _is_own(target):
            trust.record(path)
    return paths


def _is_own(slave: Target) -> bool:
    """Whether a slave is one of this project's, or of the examples of its checkout."""
    if slave.root is None:
        return f"{slave.module}:{slave.model}" in MODELS.values()
    return consent.is_of_this_project(Path(slave.root))


def is_of_elsewhere(path: Path, slave: Target) -> bool:
    """Whether an FMU of a slave of this project was not built here, so that it would run as a foreign one."""
    is_of_kit = _is_own(slave) and read_source_hash(path) is not None
    return is_of_kit and trust.is_recordable() and not trust.is_own(path)


def export_c(targets: Sequence[Target], folder: Path, *, single: bool = False) -> list[Path]:
    """Write slaves whose modules are in one folder as NAME.h and NAME.c into `folder`; returns the paths of NAME.c.

    `single`: in single precision. Raises `QuadcosimError` stating what could not be written.
    """
    return _run_packer(
        ["fmu_kit.compiler.pack.embedded_files", *(["--single"] if single else [])], targets, folder, None
    )


def _run_packer(
    command: Sequence[str],
    targets: Sequence[Target],
    folder: Path,
    announce: Callable[[str], None] | None,
    progress: Callable[[float], None] | None = None,
) -> list[Path]:
    """Run a module of the kit on slaves in a separate process; returns the paths that it prints one by one."""
    named = [f"{target.module}:{target.model}" for target in targets]
    first = targets[0] if targets else Target("", "")
    roots = [] if first.root is None else ["--root", first.root]
    variant = [] if first.variant is None else ["--variant", first.variant.text]
    whole = subprocesses.command(*command, folder.resolve(), *roots, *variant, *named)
    paths = []
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as remarks:
        with subprocess.Popen(
            whole, stdout=subprocess.PIPE, stderr=remarks, text=True, env=subprocesses.environment()
        ) as process:
            for line in process.stdout or ():
                if line.startswith(packaging.REMARK):
                    if announce is not None:
                        announce(line.removeprefix(packaging.REMARK).rstrip("\n"))
                    continue
                paths.append(Path(line.rstrip("\n")))
                if progress is not None:
                    progress(len(paths) / len(targets))
        remarks.seek(0)
        output = remarks.read().strip().splitlines()
    if process.returncode != 0:
        raise QuadcosimError(f"building {', '.join(named)} in {folder} failed: {(output or ['no output'])[-1]}")
    if announce is not None:
        for line in output:
            announce(line)
    return paths


def is_out_of_date(path: Path, target: Target, packing: Packing) -> bool:
    """Whether an FMU is missing, or was built from other sources than those of its slave."""
    carried = read_source_hash(path)
    return (
        not path.exists()
        if carried is None
        else carried != translating_errors(functools.partial(_source_hash, packing), target)
    )


Argument = TypeVar("Argument")
Value = TypeVar("Value")


def translating_errors(function: Callable[[Argument], Value], argument: Argument) -> Value:
    """Call a function of packaging; its errors become those of this package."""
    try:
        return function(argument)
    except PackagingError as error:
        raise QuadcosimError(str(error)) from error
