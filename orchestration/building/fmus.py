"""Where FMUs are: finds them by name, builds those that are missing or whose sources have changed."""

import functools
import keyword
import logging
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from fmu_kit import loader, packaging
from fmu_kit.archive import read_source_hash, read_variant
from fmu_kit.bundle import SHARED_PACKAGES, PackagingError, Target, module_path
from fmu_kit.compiler.pack import freshness
from fmu_kit.discovery import slave_beside, slaves_in
from fmu_kit.variants import Variant
from orchestration.basics.errors import QuadcosimError, UsageError
from orchestration.building import consent
from orchestration.building.models import MODELS
from orchestration.processes import subprocesses
from orchestration.system.component import Parameter
from orchestration.system.request import Twin

_NOTES = logging.getLogger("quadcosim")


def default_folder() -> Path:
    """`fmus/` of the project, or the user's cache directory where that is not there to be written."""
    root = Path(__file__).resolve().parents[2]
    folder = root / "fmus"
    if (root / "pyproject.toml").is_file() and os.access(folder, os.W_OK):
        return folder
    import platformdirs

    return Path(platformdirs.user_cache_dir("quadcosim")) / "fmus"


@dataclass(frozen=True, kw_only=True)
class Packing:
    """One way to make an FMU of a slave."""

    folder: str
    """where such FMUs are, beside the modules of the slaves and in `default_folder`"""
    command: tuple[str, ...]
    """the module that is run to pack, and its first arguments"""
    source_hash: Callable[[Target], str]

    def base_of(self, path: Path) -> Path | None:
        """The folder beside whose modules an FMU is that is made this way; None if it is in no such place."""
        depth = len(Path(self.folder).parts)
        return path.parents[depth] if path.parts[-1 - depth : -1] == Path(self.folder).parts else None

    def slave_of(self, path: Path) -> Target | None:
        """The slave that an FMU is made of this way: it is in the folder, and a module beside that defines it."""
        folder = self.base_of(path)
        return None if folder is None else _told(slave_beside, folder / path.name)


IN_PYTHON = Packing(folder="", command=("fmu_kit.packaging",), source_hash=packaging.source_hash)
NATIVE = Packing(folder="native", command=("fmu_kit.compiler.pack.building",), source_hash=freshness.source_hash)
"""Without Python inside, by a C compiler."""
NATIVE_FMI_3 = Packing(
    folder="native/fmi3",
    command=("fmu_kit.compiler.pack.building", "--fmi", "3"),
    source_hash=functools.partial(freshness.source_hash, version=3),
)
PACKINGS = (NATIVE_FMI_3, NATIVE, IN_PYTHON)
"""Those with a folder of their own first: `native/NAME` is one of this project's, as NAME is."""


def locate(fmu: str, announce: Callable[[str], None] | None = None) -> Path:
    """The .fmu for the name of one of this project's FMUs, or for a path; built first if need be.

    A path's FMU is built where a module beside it defines a slave of that name, or that of which it is a variant,
    unless it carries the hash of these sources or is none of ours; if somebody has to agree to that, `UsageError` says
    how. Raises `UsageError` naming the valid names if there is none; `announce` hears of a build, and of a variant
    elsewhere that is older than the sources of this project.
    """
    for packing in PACKINGS:
        name = fmu.rpartition("/")[2]
        if name in MODELS and fmu == Path(packing.folder, name).as_posix():
            folder = default_folder() / packing.folder
            if out_of_date([name], folder, packing):
                _announce_build(folder / f"{name}.fmu", announce)
                build([name], folder, announce, packing=packing)
            return folder / f"{name}.fmu"
    path = Path(fmu)
    if path.suffix == ".fmu":
        packing, target = _slave_of(path)
        if target is None:
            packing, target = _variant_at(path, announce)
        if target is not None and _is_old(path, target, packing):
            if target.root is not None:
                consent.expect(path, path.parents[len(Path(packing.folder).parts)])
            _announce_build(path, announce)
            build_slaves([target], path.parent, announce, packing=packing)
        if path.is_file():
            return path
    raise UsageError(
        f"fmu = {fmu}: expected {' or '.join(MODELS)}, or the path of an .fmu file, which may be missing if a module "
        "beside it defines the slave"
    )


def looked_up(fmu: str, announce: Callable[[str], None] | None = None) -> Path | None:
    """The .fmu as `locate` finds it, but that nothing is built of modules that nobody allows now; None if it is not
    there.
    """
    path = Path(fmu)
    if path.suffix != ".fmu" or consent.is_allowed():
        return locate(fmu, announce)
    return path if path.is_file() else None


def of_components(fmus: Mapping[str, str], announce: Callable[[str], None] | None = None) -> dict[str, Path]:
    """Each component's .fmu, as `locate` finds it; raises `UsageError` that names the component."""
    found = {}
    for name, fmu in fmus.items():
        try:
            found[name] = locate(fmu, announce)
            _NOTES.debug("component %s: %s is %s", name, fmu, found[name])
        except UsageError as error:
            raise UsageError(f"components.{name}.{error}") from error
    return found


def native_twin(fmu: str) -> str:
    """What to `locate` for the same slave without Python inside; the FMU itself if it is of no slave that is known."""
    path = Path(fmu)
    if fmu in MODELS:
        return f"{NATIVE.folder}/{fmu}"
    if path.suffix == ".fmu" and _slave_of(path)[0] is IN_PYTHON and IN_PYTHON.slave_of(path) is not None:
        return str(path.parent / NATIVE.folder / path.name)
    return fmu


def python_twin(fmu: str) -> str:
    """What to look up for the same slave with Python inside; the FMU itself if it is no native one of a known slave."""
    name = fmu.rpartition("/")[2]
    if name in MODELS:
        return name
    path = Path(fmu)
    packing, target = _slave_of(path) if path.suffix == ".fmu" else (IN_PYTHON, None)
    if packing is IN_PYTHON or target is None:
        return fmu
    return str(path.parents[len(Path(packing.folder).parts)] / path.name)


def native_twins(request: Twin) -> Twin:
    """A system, or what means one, with the native twins of its FMUs."""
    return request.with_twins(native_twin)


def python_twins(request: Twin) -> Twin:
    """The same with the twins of its FMUs that have Python inside."""
    return request.with_twins(python_twin)


def _slave_of(path: Path) -> tuple[Packing, Target | None]:
    """The slave that an FMU is built from, and how, by the names of its folders."""
    for packing in PACKINGS:
        target = packing.slave_of(path)
        if target is not None:
            return packing, target
    return IN_PYTHON, None


def _variant_at(path: Path, announce: Callable[[str], None] | None) -> tuple[Packing, Target | None]:
    """The slave that an FMU is a variant of, and how it is built; None if it is not where such FMUs are built.

    Then it is left as it is, and `announce` hears if the slave is one of this project's and has changed.
    """
    kept = read_variant(path)
    if kept is None or path.stem != kept[1].name:
        return IN_PYTHON, None
    slave, variant = kept
    own = replace(Target.parse(slave), variant=variant) if slave in MODELS.values() else None
    for packing in PACKINGS:
        folder = packing.base_of(path)
        if folder is None:
            continue
        if own is not None and folder.resolve() == default_folder().resolve():
            return packing, own
        beside = _told(slave_beside, folder / f"{slave.rpartition(':')[2]}.fmu")
        if beside is not None and f"{beside.module}:{beside.model}" == slave:
            return packing, replace(beside, variant=variant)
    if own is not None and announce is not None and all(_is_old(path, own, packing) for packing in PACKINGS):
        announce(f"{path} was built of other sources than today's: expected quadcosim build --name {own.name} again")
    return IN_PYTHON, None


def out_of_date(names: Iterable[str], folder: Path, packing: Packing = IN_PYTHON) -> list[str]:
    """Those of this project's FMUs that are missing in `folder` or carry another hash than the sources."""
    return [
        name
        for name in names
        if read_source_hash(folder / f"{name}.fmu") != _source_hash(packing, Target.parse(MODELS[name]))
    ]


def packages_of(target: Target) -> tuple[str, ...]:
    """All packages that decide what an FMU of this project is made of."""
    return (*SHARED_PACKAGES, target.module.partition(".")[0])


def _source_hash(packing: Packing, target: Target) -> str:
    """Of a slave of this project: computed once in a process, as long as its packages have the same files."""
    folders = [str(module_path(package).parent) for package in packages_of(target)]
    return _computed(packing, target, loader.compiler(), tuple(file for folder in folders for file in _files(folder)))


@functools.lru_cache(maxsize=16)
def _computed(packing: Packing, target: Target, compiler: str | None, files: tuple[tuple[str, int, int], ...]) -> str:
    return packing.source_hash(target)


def _files(folder: str) -> Iterator[tuple[str, int, int]]:
    """What is in a folder, with when each file was changed [ns] and its size."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if not entry.is_dir():
                about = entry.stat()
                yield entry.path, about.st_mtime_ns, about.st_size
            elif entry.name != "__pycache__":
                yield from _files(entry.path)


def build(
    names: Iterable[str],
    folder: Path,
    announce: Callable[[str], None] | None = None,
    *,
    packing: Packing = IN_PYTHON,
    systems: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Path]:
    """Build FMUs of this project into `folder`; their paths. Else as `build_slaves`."""
    targets = [Target.parse(MODELS[name]) for name in names]
    return build_slaves(targets, folder, announce, packing=packing, systems=systems, progress=progress)


def slaves_of(folder: Path) -> list[Target]:
    """The slaves that the modules of a folder define; raises `UsageError` if there are none."""
    if not folder.is_dir():
        raise UsageError(f"{folder}: expected a folder with modules that define slaves")
    found = _told(slaves_in, folder)
    if not found:
        raise UsageError(f"{folder}: expected a module with a subclass of fmu_kit.slave.Slave that has a description")
    return found


def slaves_named(text: str) -> list[Target]:
    """One of this project's slaves by its name, those of a folder, or one of them as FOLDER/NAME.

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
    found = slaves_of(path.parent)
    named = [target for target in found if target.model == path.name]
    if not named:
        raise UsageError(f"{text}: expected one of {', '.join(target.model for target in found)} in {path.parent}")
    return named


def with_fixed(slave: Target, name: str, values: Mapping[str, Parameter]) -> Target:
    """A slave with parameters that are fixed, by their FMI names, as the model of this name.

    Raises `UsageError` for a name that a model cannot have.
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
    """Build slaves whose modules are found in one place into `folder`, in a process of its own; the FMUs' paths.

    Those without Python inside are for this machine, or for `systems`, `all` or some with commas.
    `announce` hears, a line each, of what could not be packed, `progress` the share that is built. Raises
    `QuadcosimError` with what the build said if it fails.
    """
    options = [] if systems is None else ["--target", systems]
    return _packed([*packing.command, *options], targets, folder, announce, progress)


def export_c(targets: Sequence[Target], folder: Path, *, single: bool = False) -> list[Path]:
    """Write slaves whose modules are found in one place as NAME.h and NAME.c into `folder`; the paths of the latter.

    `single`: in single precision. Raises `QuadcosimError` saying what could not be written.
    """
    return _packed(["fmu_kit.compiler.pack.embedded", *(["--single"] if single else [])], targets, folder, None)


def _packed(
    command: Sequence[str],
    targets: Sequence[Target],
    folder: Path,
    announce: Callable[[str], None] | None,
    progress: Callable[[float], None] | None = None,
) -> list[Path]:
    """What a module of the kit makes of slaves, in a process of its own; the paths that it prints one by one."""
    named = [f"{target.module}:{target.model}" for target in targets]
    first = targets[0] if targets else Target("", "")
    roots = [] if first.root is None else ["--root", first.root]
    variant = [] if first.variant is None else ["--variant", first.variant.text]
    whole = subprocesses.command(*command, folder.resolve(), *roots, *variant, *named)
    made = []
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as remarks:
        with subprocess.Popen(
            whole, stdout=subprocess.PIPE, stderr=remarks, text=True, env=subprocesses.environment()
        ) as process:
            for line in process.stdout or ():
                made.append(Path(line.rstrip("\n")))
                if progress is not None:
                    progress(len(made) / len(targets))
        remarks.seek(0)
        said = remarks.read().strip().splitlines()
    if process.returncode != 0:
        raise QuadcosimError(f"building {', '.join(named)} in {folder} failed: {(said or ['no output'])[-1]}")
    if announce is not None:
        for line in said:
            announce(line)
    return made


def _is_old(path: Path, target: Target, packing: Packing) -> bool:
    """Whether an FMU is missing, or made by packaging from other sources than those of its slave."""
    carried = read_source_hash(path)
    return not path.exists() if carried is None else carried != _told(packing.source_hash, target)


def _announce_build(path: Path, announce: Callable[[str], None] | None) -> None:
    if announce is not None:
        announce(f"building {path}")


Given = TypeVar("Given")
Told = TypeVar("Told")


def _told(function: Callable[[Given], Told], of: Given) -> Told:
    """What a function of packaging says; its refusals are this package's."""
    try:
        return function(of)
    except PackagingError as error:
        raise QuadcosimError(str(error)) from error
