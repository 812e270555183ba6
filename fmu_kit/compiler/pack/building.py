"""Packing a slave as an .fmu without Python inside: C from its sources, and a library compiled from that.

Packing imports the slave, so it runs in a process of its own: `python -m fmu_kit.compiler.pack.building`.
"""

from __future__ import annotations

import argparse
import functools
import gc
import importlib
import sys
import types
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fmu_kit import libraries, packaging
from fmu_kit.archive import NATIVE_TABLES
from fmu_kit.bundle import PackagingError, Target, bundled_sources, place
from fmu_kit.compiler.emit.c_code import c_code
from fmu_kit.compiler.emit.lane_code import lane_code
from fmu_kit.compiler.emit.standards import STANDARDS, Standard
from fmu_kit.compiler.emit.tables import places, tables
from fmu_kit.compiler.pack.c_compiler import (
    OPTIONS,
    Mathematics,
    compiled_for,
    compiled_here,
    host_platform,
    library_path,
    targets_of,
)
from fmu_kit.compiler.pack.freshness import source_hash
from fmu_kit.compiler.passes.derivatives import with_tangents
from fmu_kit.compiler.passes.precomputing import precomputed
from fmu_kit.compiler.passes.straightening import straightened
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.compiler.trace.symbols import TraceError
from fmu_kit.compiler.trace.tracing import Program, trace
from fmu_kit.documentation import Making
from fmu_kit.model_description import GUID_PLACEHOLDER
from fmu_kit.packaging import described, licences_and_icon, origin, put_guid, slave_class, written

BESIDE = ("instance.h", "integers.h", "lanes.c", "lanes.h", "mathematics.h", "text.h")
"""What lies beside the file to compile, the same for every slave."""
TABLES = NATIVE_TABLES.rpartition("/")[2]
UNOPTIMISED = """
/* Derivatives are computed at initialisation, if at all, and are most of the text: a compiler need not work at them. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("O0")
#endif
"""
OPTIMISED = """
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
"""
_OF_LIBRARY = ("-O1",)
"""Steps are as fast as with -O2, for what is written is straight and its constants are known; compiling takes less."""
_NEEDS = FOLDER / "needs.html"
_PYTHON = "python"
"""Where in the documentation the Python is from which the C was written."""


def build(
    target: Target,
    folder: Path,
    *,
    version: int = 2,
    systems: Sequence[str] = (),
    mathematics: Mathematics = "own",
) -> Path:
    """Write `folder`/Model.fmu of FMI 2.0 or 3.0, replacing it in one go, and return its path.

    With a library for each of `systems`, by zig; without any, for this machine, by its compiler. That one can have the
    mathematics of libm: then it has, on this machine, the bits of the slave in Python, for comparing the two.
    """
    standard = STANDARDS[version]
    try:
        program = precomputed(trace(slave_class(target), modules_of(target)))
        sources = c_sources(program, GUID_PLACEHOLDER, standard)
    except TraceError as error:
        raise PackagingError(f"{target.name}: {error}") from error
    files = {f"sources/{name}": text for name, text in sources.items()}
    files |= standard.beside(slave_class(target), standard.main)
    files |= {f"documentation/{_PYTHON}/{path}": text.encode() for path, text in _python_sources(target).items()}
    files |= licences_and_icon(target, version)
    files |= origin(target, source_hash(target, version))
    making = Making(
        version=version,
        needs=_NEEDS,
        source=f"{_PYTHON}/{place(target.module, target.root)}",
        status=f"fmi{version}Error",
        afterwards="After a failure, reset the instance, set it to a state that was saved before, or free it.",
    )
    described(files, target, making, standard.describe(slave_class(target), standard.main))
    guid = put_guid(files)
    sources = {**sources, TABLES: sources[TABLES].replace(GUID_PLACEHOLDER.encode(), guid.encode())}
    files[NATIVE_TABLES] = sources[TABLES]
    compiled: dict[str, bytes] = {}
    here = host_platform(version)
    if not systems and here is not None:
        compiled[here] = library(sources, standard.main, mathematics)
    for system in systems:
        compiled |= compiled_for(system, sources, standard.main, version)
    files |= {library_path(system, target.name): library for system, library in compiled.items()}
    return written(files, target, folder)


def library(sources: dict[str, bytes], main: str, mathematics: Mathematics = "own") -> bytes:
    """The library of a slave for this machine, from the sources of its FMU; compiled only if it is not in the cache."""
    compile_ = functools.partial(compiled_here, sources, main, mathematics=mathematics, options=_OF_LIBRARY)
    return libraries.content("native", sources, (OPTIONS, _OF_LIBRARY, main, mathematics), compile_)


def c_sources(program: Program, guid: str, standard: Standard) -> dict[str, bytes]:
    """The sources of an FMU, by the names of their files."""
    fixed = {name: (FOLDER / name).read_bytes() for name in (standard.main, *BESIDE)}
    derivatives = with_tangents(program, program.initialise)
    made = {
        "places.h": places(program),
        TABLES: tables(program, guid, standard),
        "functions.h": f"{c_code(program)}\n{UNOPTIMISED}\n{c_code(derivatives)}\n{OPTIMISED}\n",
        "lane_functions.h": lane_code(program, straightened(program)),
    }
    return {**fixed, **{name: text.encode() for name, text in made.items()}}


def modules_of(target: Target) -> list[types.ModuleType]:
    """The modules that a slave is made of, its own and those of the kit; they are imported."""
    names = [
        path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        for path in _python_sources(replace(target, variant=None))
    ]
    return [importlib.import_module(name) for name in names]


def _python_sources(target: Target) -> dict[str, str]:
    """The modules that a slave is made of, its own and those of the kit, by their paths."""
    return {path: text for path, text in bundled_sources(target).items() if not path.startswith("pythonfmu")}


def main(arguments: list[str]) -> int:
    """`python -m fmu_kit.compiler.pack.building [--fmi VERSION] [--target SYSTEM,…] FOLDER …`.

    The rest as in `fmu_kit.packaging`.
    """
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--fmi", type=int, choices=STANDARDS, default=2)
    parser.add_argument("--target")
    given, others = parser.parse_known_args(arguments)
    try:
        systems = () if given.target is None else targets_of(given.target)
    except PackagingError as error:
        print(error, file=sys.stderr)
        return 1
    return packaging.main(others, functools.partial(build, version=given.fmi, systems=systems))


if __name__ == "__main__":
    gc.disable()  # a tenth of the time of a process that ends before there is much to collect
    sys.exit(main(sys.argv[1:]))
