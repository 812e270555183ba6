"""Finds FMUs by name or path, and has those built that are missing or whose sources have changed."""

import logging
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeVar

from fmu_kit.archive import read_variant
from fmu_kit.bundle import Target
from fmu_kit.discovery import slave_beside
from orchestration.components.building import consent
from orchestration.components.building.builder import (
    IN_PYTHON,
    NATIVE,
    PACKINGS,
    Packing,
    build,
    build_slaves,
    is_of_elsewhere,
    is_out_of_date,
    out_of_date,
    translating_errors,
)
from orchestration.components.building.models import MODELS, PATHS, WRAPPED
from orchestration.foundation.basics.errors import UsageError, prefixed
from orchestration.foundation.processes.subprocesses import checkout

if TYPE_CHECKING:
    from orchestration.components.fmi.read_description import Model

_NOTES = logging.getLogger("quadcosim")


class HasTwins(Protocol):
    """What names FMUs that can be replaced, as a request does."""

    def with_twins(self: "Twin", twin: Callable[[str], str]) -> "Twin":
        """The same with each FMU replaced by its `twin`."""


Twin = TypeVar("Twin", bound=HasTwins)


def default_folder() -> Path:
    """`fmus/` of the project, or the user's cache directory if that does not exist or is not writable."""
    root = checkout()
    if root is not None and os.access(root / "fmus", os.W_OK):
        return root / "fmus"
    import platformdirs

    return Path(platformdirs.user_cache_dir("quadcosim")) / "fmus"


def locate(fmu: str, announce: Callable[[str], None] | None = None) -> Path:
    """The .fmu file for the name of one of this project's FMUs, or for a path; built first if need be.

    The FMU of a path is built if a module beside it defines the slave of that name, or the one of which it is a
    variant, unless it carries the hash of these sources or was not built by this project; where consent is required,
    `UsageError` states how to give it. So is that of a controller in C, whose path is that of its description. Raises
    `UsageError` for a missing file, and for an unknown name. `announce` receives a line for a build, and for a variant
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
    if path.suffix == WRAPPED:
        from orchestration.components.building import wrap  # not before: loads what reads such files

        with prefixed("fmu = "):
            return wrap.locate(path, announce)
    if path.suffix == ".fmu":
        packing, target = _slave_of(path)
        if target is None:
            packing, target = _variant_at(path, announce)
        if target is not None and (is_out_of_date(path, target, packing) or is_of_elsewhere(path, target)):
            if target.root is not None:
                with prefixed("fmu = "):
                    consent.expect(path, path.parents[len(Path(packing.folder).parts)])
            _announce_build(path, announce)
            build_slaves([target], path.parent, announce, packing=packing)
        if path.is_file():
            return path
        raise UsageError(f"fmu = {fmu}: no such file, and no module beside it that defines the slave")
    raise UsageError(
        f"fmu = {fmu}: expected {' or '.join(MODELS)}, or the path of an .fmu file, or of the {WRAPPED} file of a "
        "controller in C"
    )


def read_model(fmu: str | Path) -> "Model":
    """The variables and properties that an FMU declares, of its name or path; raises `UsageError` as `locate` does."""
    from orchestration.components.fmi.read_description import read_model  # not before: FMUs are built without it

    return read_model(locate(str(fmu)))


def look_up(fmu: str, announce: Callable[[str], None] | None = None) -> Path | None:
    """As `locate`, but without building where that needs consent; None if the file does not exist."""
    path = Path(fmu)
    if path.suffix not in PATHS or consent.is_allowed():
        return locate(fmu, announce)
    return path if path.is_file() and path.suffix != WRAPPED else None


def of_components(fmus: Mapping[str, str], announce: Callable[[str], None] | None = None) -> dict[str, Path]:
    """The .fmu file of each component, as by `locate`; raises `UsageError` that names the component."""
    paths = {}
    for name, fmu in fmus.items():
        with prefixed(f"components.{name}."):
            paths[name] = locate(fmu, announce)
            _NOTES.debug("component %s: %s is %s", name, fmu, paths[name])
    return paths


def native_twin(fmu: str) -> str:
    """The name or path for `locate` of the same slave without Python inside; the FMU itself if its slave is unknown."""
    path = Path(fmu)
    if fmu in MODELS:
        return f"{NATIVE.folder}/{fmu}"
    if path.suffix == ".fmu" and _slave_of(path)[0] is IN_PYTHON and IN_PYTHON.slave_of(path) is not None:
        return str(path.parent / NATIVE.folder / path.name)
    return fmu


def python_twin(fmu: str) -> str:
    """The name or path of the same slave with Python inside; the FMU itself if it is no native one of a known slave."""
    name = fmu.rpartition("/")[2]
    if name in MODELS:
        return name
    path = Path(fmu)
    packing, target = _slave_of(path) if path.suffix == ".fmu" else (IN_PYTHON, None)
    if packing is IN_PYTHON or target is None:
        return fmu
    return str(path.parents[len(Path(packing.folder).parts)] / path.name)


def native_twins(request: Twin) -> Twin:
    """A request with the native twins of its FMUs."""
    return request.with_twins(native_twin)


def python_twins(request: Twin) -> Twin:
    """A request with the twins of its FMUs that have Python inside."""
    return request.with_twins(python_twin)


def _slave_of(path: Path) -> tuple[Packing, Target | None]:
    """The slave that an FMU is built from, and its packing, by the folder that it is in."""
    for packing in PACKINGS:
        target = packing.slave_of(path)
        if target is not None:
            return packing, target
    return IN_PYTHON, None


def _variant_at(path: Path, announce: Callable[[str], None] | None) -> tuple[Packing, Target | None]:
    """The slave that an FMU is a variant of, and its packing; None if it is not in a folder where such FMUs are built.

    Then it stays as it is, and `announce` receives a line if the slave is one of this project's and has changed.
    """
    stored = read_variant(path)
    if stored is None or path.stem != stored[1].name:
        return IN_PYTHON, None
    slave, variant = stored
    own = replace(Target.parse(slave), variant=variant) if slave in MODELS.values() else None
    for packing in PACKINGS:
        folder = packing.base_of(path)
        if folder is None:
            continue
        if own is not None and folder.resolve() == default_folder().resolve():
            return packing, own
        beside = translating_errors(slave_beside, folder / f"{slave.rpartition(':')[2]}.fmu")
        if beside is not None and f"{beside.module}:{beside.model}" == slave:
            return packing, replace(beside, variant=variant)
    if own is not None and announce is not None and all(is_out_of_date(path, own, packing) for packing in PACKINGS):
        announce(
            f"{path} was built of other sources than the current ones: expected quadcosim build --name {own.name} again"
        )
    return IN_PYTHON, None


def _announce_build(path: Path, announce: Callable[[str], None] | None) -> None:
    if announce is not None:
        announce(f"building {path}")
