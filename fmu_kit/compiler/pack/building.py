"""Packing a slave as an .fmu without Python inside: C from its sources, and a library compiled from that.

Packing imports the slave, so it runs in a separate process: `python -m fmu_kit.compiler.pack.building`.
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
from fmu_kit.bundle import PackagingError, Target, bundled_sources, path_in_bundle
from fmu_kit.compiler.emit.c_code import c_code
from fmu_kit.compiler.emit.exchange import described
from fmu_kit.compiler.emit.line_writers import lane_code
from fmu_kit.compiler.emit.standards import CLOCKED, STANDARDS, Standard
from fmu_kit.compiler.emit.tables import places, tables
from fmu_kit.compiler.pack import c_compiler
from fmu_kit.compiler.pack.freshness import source_hash
from fmu_kit.compiler.passes.derivatives import with_tangents
from fmu_kit.compiler.passes.precomputing import precompute
from fmu_kit.compiler.passes.straightening import straightened
from fmu_kit.compiler.runtime import FOLDER
from fmu_kit.compiler.trace.errors import TraceError
from fmu_kit.compiler.trace.tracing import Program, trace
from fmu_kit.documentation import BuildNotes
from fmu_kit.packaging import REMARK, add_description, insert_guid, licences_and_icon, origin, slave_class, write_fmu
from fmu_kit.write_description import GUID_PLACEHOLDER

BESIDE = ("exchange.h", "instance.h", "integers.h", "lanes.c", "lanes.h", "mathematics.h", "text.h")
"""Source files beside the file to compile, the same for every slave."""
TABLES = NATIVE_TABLES.rpartition("/")[2]
UNOPTIMISED = """
/* Derivatives are most of the code but are computed only during initialisation: they need no optimisation. */
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
LONG = 10_000
"""Operations and statements of a slave that take long to compile"""
_NEEDS = FOLDER / "needs.html"
_PYTHON = "python"
"""The folder of the documentation with the Python from which the C was generated."""


def build(
    target: Target,
    folder: Path,
    *,
    version: int = 2,
    clocked: bool = False,
    systems: Sequence[str] = (),
    mathematics: c_compiler.Mathematics = "own",
) -> Path:
    """Write `folder`/Model.fmu of FMI 2.0 or 3.0, replacing it atomically, and return its path.

    With `clocked` it is of FMI 3.0, and a slave that samples has an input clock.

    It has a library for each of `systems`, compiled by zig; without any, one for this machine, by its compiler. The
    latter can use the mathematics of libm, to be compared on this machine with the slave in Python, bit for bit.
    """
    standard = CLOCKED if clocked else STANDARDS[version]
    try:
        program = precompute(trace(slave_class(target), modules_of(target)))
        if (size := program.size()) > LONG:
            print(
                f"{REMARK}{target.name}: compiling {size} operations and statements, which may take minutes", flush=True
            )
        sources = c_sources(program, GUID_PLACEHOLDER, standard)
    except TraceError as error:
        raise PackagingError(f"{target.name}: {error}") from error
    files = {f"sources/{name}": text for name, text in sources.items()}
    files |= standard.beside(slave_class(target), standard.main)
    files |= {f"documentation/{_PYTHON}/{path}": text.encode() for path, text in _python_sources(target).items()}
    files |= licences_and_icon(target, version)
    files |= origin(target, source_hash(target, version))
    notes = BuildNotes(
        version=version,
        needs=_NEEDS,
        source=f"{_PYTHON}/{path_in_bundle(target.module, target.root)}",
        status=f"fmi{version}Error",
        afterwards="After a failure, reset the instance, set it to a state that was saved before, or free it.",
    )
    add_description(files, target, notes, described(program, standard))
    guid = insert_guid(files)
    sources = {**sources, TABLES: sources[TABLES].replace(GUID_PLACEHOLDER.encode(), guid.encode())}
    files[NATIVE_TABLES] = sources[TABLES]
    compiled: dict[str, bytes] = {}
    here = c_compiler.host_platform(version)
    if not systems and here is not None:
        compiled[here] = library(sources, standard.main, mathematics)
    for system in systems:
        compiled |= c_compiler.compiled_for(system, sources, standard.main, version)
    files |= {c_compiler.library_path(system, target.name): library for system, library in compiled.items()}
    return write_fmu(files, target, folder)


def library(sources: dict[str, bytes], main: str, mathematics: c_compiler.Mathematics = "own") -> bytes:
    """The library of a slave for this machine, from the sources of its FMU or from the cache."""
    compile_ = functools.partial(
        c_compiler.compiled_here, sources, main, mathematics=mathematics, options=c_compiler.OF_LIBRARY
    )
    return libraries.cached_content(
        "native", sources, (c_compiler.OPTIONS, c_compiler.OF_LIBRARY, main, mathematics), compile_
    )


def c_sources(program: Program, guid: str, standard: Standard) -> dict[str, bytes]:
    """The sources of an FMU, by file name."""
    fixed = {name: (FOLDER / name).read_bytes() for name in (standard.main, *BESIDE)}
    derivatives = with_tangents(program, program.initialise)
    rates = c_code(replace(program, functions=program.of_derivatives))
    generated = {
        "places.h": places(program),
        TABLES: tables(program, guid, standard),
        "functions.h": f"{c_code(program)}\n{rates}\n{UNOPTIMISED}\n{c_code(derivatives)}\n{OPTIMISED}\n",
        "lane_functions.h": lane_code(program, straightened(program)),
    }
    return {**fixed, **{name: text.encode() for name, text in generated.items()}}


def modules_of(target: Target) -> list[types.ModuleType]:
    """The modules of a slave, its own and those of the kit; they are imported."""
    names = [
        path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        for path in _python_sources(replace(target, variant=None))
    ]
    return [importlib.import_module(name) for name in names]


def _python_sources(target: Target) -> dict[str, str]:
    """The sources of a slave, its own and those of the kit, by path."""
    return {path: text for path, text in bundled_sources(target).items() if not path.startswith("pythonfmu")}


def main(arguments: list[str]) -> int:
    """`python -m fmu_kit.compiler.pack.building [--fmi VERSION] [--clock] [--target SYSTEM,…] FOLDER …`.

    The other arguments are those of `fmu_kit.packaging`.
    """
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--fmi", type=int, choices=STANDARDS, default=2)
    parser.add_argument("--clock", action="store_true")
    parser.add_argument("--target")
    options, others = parser.parse_known_args(arguments)
    try:
        systems = () if options.target is None else c_compiler.targets_of(options.target)
    except PackagingError as error:
        print(error, file=sys.stderr)
        return 1
    return packaging.main(others, functools.partial(build, version=options.fmi, clocked=options.clock, systems=systems))


if __name__ == "__main__":
    gc.disable()  # a tenth of the time of this short process
    sys.exit(main(sys.argv[1:]))
