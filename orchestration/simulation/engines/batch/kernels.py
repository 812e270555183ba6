"""Compiles what a batch calls: components in SIMD lanes, from the sources of FMUs, and batch.c for a system."""

import ctypes
import functools
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fmu_kit.archive import LANES_FOLDER
from fmu_kit.compiler.pack.c_compiler import FOR_THIS_PROCESSOR, OPTIONS
from fmu_kit.compiler.pack.lanes import MAIN, Lanes, compiled_lanes
from fmu_kit.compiler.pack.lanes import preferred_lanes as lanes_of_fmus
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.libraries import cached_library
from orchestration.components.fmi.read_description import Model
from orchestration.foundation.basics.c_structures import compiled_library, compiler_errors, expect_same_sizes
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.engines.compiled import INSTANTS
from orchestration.simulation.engines.structures import HEADER, shared

FILES = (Path(__file__).with_name("batch.c"), INSTANTS, HEADER, FOLDER / "lanes.h", FOLDER / "mathematics.h")
"""The sources of a batch, besides those that are generated for a system"""
_SOURCES = ("sources/", LANES_FOLDER)


def preferred_lanes() -> int:
    """How many runs this machine computes at once in a thread; raises `QuadcosimError` without a compiler."""
    with compiler_errors():
        return lanes_of_fmus()


class NoCode:
    """In the place of the kernel of a component whose outputs the caller computes: its variables have a memory."""

    step = steps = 0

    def __init__(self, model: Model) -> None:
        self.places = len(model.variables)

    def begin(self, memory: int) -> None:
        """Nothing: what is read is written first."""


def component(name: str, model: Model, lanes: int, *, several: bool) -> Lanes:
    """A component in lanes, which can do `several` steps at once; raises as `sources_of`."""
    return _compiled(tuple(sorted(sources_of(name, model).items())), lanes, several)


def sources_of(name: str, model: Model) -> Mapping[str, bytes]:
    """The sources of a component's lanes; raises `UsageError` naming it if its FMU has none."""
    sources = _sources_in(model.path, model.path.stat().st_mtime_ns)
    if model.interface != "co-simulation":
        raise UsageError(
            f"components.{name}.interface = {model.interface}: expected co-simulation for one of many at once"
        )
    if MAIN not in sources or model.version != 2:
        raise UsageError(
            f"components.{name}: {model.path.name}: expected a native FMU of this project's kit, as quadcosim build "
            "--native makes them, to be one of many at once"
        )
    return sources


@functools.lru_cache(maxsize=64)
def _sources_in(path: Path, changed: int) -> Mapping[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.startswith(_SOURCES) and not name.endswith("/")]
        return {name.rpartition("/")[2]: archive.read(name) for name in names}


@functools.lru_cache(maxsize=64)
def _compiled(sources: tuple[tuple[str, bytes], ...], lanes: int, several: bool) -> Lanes:
    key = (OPTIONS, FOR_THIS_PROCESSOR, lanes, several)
    compile_ = functools.partial(compiled_lanes, dict(sources), lanes, several=several)
    with compiler_errors():
        return Lanes(cached_library("lanes", dict(sources), key, compile_))


@functools.lru_cache(maxsize=256)
def batch(sizes: str, expressions: str, lanes: int) -> Any:
    """The functions of batch.c, compiled with the expressions of a system."""
    sources = {path.name: path.read_bytes() for path in FILES}
    sources |= {"sizes.h": sizes.encode(), "expressions.h": expressions.encode()}
    options = (*FOR_THIS_PROCESSOR, f"-DQUADCOSIM_LANES={lanes}", "-Wno-psabi")
    library = compiled_library("batch", sources, options=options)
    expect_same_sizes(library, shared(lanes))
    for name in ("run", "proceed", "clear", "free_all"):
        if hasattr(library, name):
            getattr(library, name).argtypes = (ctypes.c_void_p,)
    library.values_of_reductions.argtypes = (ctypes.c_void_p, ctypes.c_void_p)
    library.grown.argtypes = (ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)
    return library
