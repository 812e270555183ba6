"""Compiling C to a library, by the C compiler of this machine or by zig for any system."""

from __future__ import annotations

import functools
import importlib.util
import os
import platform
import shutil
import struct
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from fmu_kit import libraries
from fmu_kit.bundle import PackagingError
from fmu_kit.scratch import temporary_folder

OPTIONS = (
    *("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno"),
    *("-s", "-U_FORTIFY_SOURCE"),  # some distributions define it, and would need more of the C library
)
OF_LIBRARY = ("-O1",)
"""Compiles faster than -O2, and steps are as fast: generated code is already simple."""
FOR_THIS_PROCESSOR = ("-mcpu=native",) if platform.machine() in ("aarch64", "arm64") else ("-march=native",)
"""Not for a library that is distributed."""
_LINUX = ("-Wl,--build-id=none",)  # nothing that differs between builds

TARGETS = {
    "linux64": {"x86_64-linux": "x86_64-linux-gnu.2.17"},
    "linux-aarch64": {"aarch64-linux": "aarch64-linux-gnu.2.17"},
    "win64": {"x86_64-windows": "x86_64-windows-gnu"},
    "darwin64": {"x86_64-darwin": "x86_64-macos.11.0", "aarch64-darwin": "aarch64-macos.11.0"},
}
"""The systems for which zig compiles: their names in FMI 3.0, and in zig."""
_WASM = ("-target", "wasm32-wasi")
_WASM_OPTIONS = (
    *("-std=gnu11", "-O3", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno", "-mexec-model=reactor"),
    *("-Wno-psabi", "-Wl,--strip-all", "-Wl,--export-dynamic", "-Wl,-z,stack-size=1048576"),
)
"""A module that a page runs: it imports nothing, and has no start."""
_ONLY_IN_3 = ("linux-aarch64",)
"""Systems without a name in FMI 2.0, which uses those of FMI 3.0 (FMI 2.0.4, section 2.3)"""
_CROSS = {"linux-aarch64": "aarch64-linux-gnu-gcc"}
"""Other compilers for a system, used without zig"""
_SUFFIXES = {"windows": ".dll", "win64": ".dll", "darwin": ".dylib", "darwin64": ".dylib"}


Mathematics = Literal["own", "libm"]
"""The elementary functions: own, with the same bits on every system, or libm's, as CPython uses on this machine."""
_MATHEMATICS: dict[Mathematics, tuple[str, ...]] = {"own": (), "libm": ("-DQUADCOSIM_LIBM", "-lm")}


def host_platform(version: int = 2) -> str | None:
    """The name of this machine's system in a version of FMI, if an FMU can be compiled for it here."""
    machine = platform.machine()
    if sys.platform != "linux" or machine not in ("x86_64", "aarch64"):
        return None
    return "linux64" if version == 2 and machine == "x86_64" else f"{machine}-linux"


def library_path(system: str, model: str) -> str:
    """The path of the library for a system in an FMU; the system is named as in the version of FMI."""
    return f"binaries/{system}/{model}{_SUFFIXES.get(system.rpartition('-')[2], '.so')}"


def targets_of(text: str) -> tuple[str, ...]:
    """The systems of a comma-separated list, or all; raises `PackagingError` listing them for an unknown one."""
    given = tuple(TARGETS) if text == "all" else tuple(text.split(","))
    for target in given:
        if target not in TARGETS:
            raise PackagingError(f"target {target}: expected all, or some of {', '.join(TARGETS)} with commas between")
    return given


def compiler() -> str:
    """The path of this machine's C compiler; raises `PackagingError`, naming what to install, if there is none."""
    cc = shutil.which("cc")
    if cc is None:
        raise PackagingError(
            "no C compiler that is called cc: install one (Debian, Ubuntu: apt install gcc libc6-dev; Fedora: dnf "
            "install gcc)"
        )
    return cc


def compiled_here(
    sources: Mapping[str, bytes],
    main: str,
    *,
    mathematics: Mathematics = "own",
    options: Sequence[str] = (),
    has_lines: bool = False,
) -> bytes:
    """The library for this machine, compiled from the file `main` among the sources by its compiler `cc`.

    If it `has_lines`, those of objects among the sources are kept, by which a crash is found.
    Raises `PackagingError` without a compiler.
    """
    options = [option for option in (*OPTIONS, *_LINUX, *options) if option != "-s" or not has_lines]
    return _compiled([compiler(), *options], sources, main, _MATHEMATICS[mathematics])


@dataclass(frozen=True, kw_only=True)
class Unit:
    """One file to compile among its sources."""

    sources: Mapping[str, bytes]
    main: str
    options: tuple[str, ...] = ()


def linked_for_wasm(units: Sequence[Unit], options: Sequence[str] = ()) -> bytes:
    """The WebAssembly module of several units, compiled by zig; raises `PackagingError` where there is none."""
    if importlib.util.find_spec("ziglang") is None:
        raise PackagingError("a page needs zig, which compiles for WebAssembly: pip install 'quadcosim[live]'")
    return linked([sys.executable, "-m", "ziglang", "cc", *_WASM], [*_WASM_OPTIONS, *options], units, [])


def linked(command: list[str], options: Sequence[str], units: Sequence[Unit], after: Sequence[str]) -> bytes:
    """The library of several units by the command of a compiler, with its further arguments `after` the units."""
    for_units = [option for option in options if not option.startswith("-Wl,") and option not in ("-shared", "-s")]
    objects = {}
    for i, unit in enumerate(units):
        compile_ = functools.partial(_compiled, [*command, *for_units, *unit.options, "-c"], unit.sources, unit.main)
        objects[f"unit{i}.o"] = libraries.cached_content("objects", unit.sources, compile_.args[::2], compile_)
    return _compiled([*command, *options], objects, "", (*objects, *after))


def compiled_for(
    target: str, sources: Mapping[str, bytes], main: str, version: int = 2, after: Sequence[str] = ()
) -> dict[str, bytes]:
    """The libraries for a system of `TARGETS`, compiled by zig, by the names of the system in a version of FMI.

    `after`: further arguments of the compiler, behind the file. For macOS in FMI 2.0 there is one for all processors.
    Raises `PackagingError`, naming what to install, without zig or another compiler for the system.
    """
    options = [*OPTIONS, *(_LINUX if target.startswith("linux") else ())]
    slices = {
        name: _compiled([*_compiler_for(target, called), *options], sources, main, after)
        for name, called in TARGETS[target].items()
    }
    if version > 2 or target in _ONLY_IN_3:
        return slices
    libraries = list(slices.values())
    return {target: libraries[0] if len(libraries) == 1 else universal(libraries)}


def _compiler_for(target: str, called: str) -> list[str]:
    """The command that compiles for a system; `called` is its name in zig."""
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", called]
    other = shutil.which(_CROSS.get(target, ""))
    if other is None:
        raise PackagingError("--target: expected zig, which compiles for all systems: pip install ziglang")
    return [other]


def _compiled(command: list[str], sources: Mapping[str, bytes], main: str, after: Sequence[str] = ()) -> bytes:
    with temporary_folder() as folder:
        for name, content in sources.items():
            (folder / name).write_bytes(content)
        output_of([*command, *filter(None, [main]), "-o", "library", *after], folder)
        return (folder / "library").read_bytes()


def output_of(command: Sequence[str], folder: Path) -> str:
    """What a tool of the compiler prints in `folder`; raises `PackagingError` with the line of its error."""
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, "TMPDIR": str(folder), "LC_ALL": "C"},  # files that a killed compiler leaves; its words
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
    except FileNotFoundError:
        raise PackagingError(f"no program {command[0]}: install it (Debian, Ubuntu: apt install binutils)") from None
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["no output"]
        raise PackagingError(f"{command[0]}: {next((line for line in lines if 'error: ' in line), lines[-1])}")
    return done.stdout + done.stderr


_FAT_MAGIC, _ALIGNMENT = 0xCAFEBABE, 14
"""Constants of a universal binary; each library in it begins at a multiple of 2 to the power of the alignment."""


def universal(libraries: Sequence[bytes]) -> bytes:
    """A universal library for macOS of several, each for one kind of processor, behind a header of their offsets."""
    size = 1 << _ALIGNMENT
    header, body, offset = struct.pack(">II", _FAT_MAGIC, len(libraries)), b"", size
    for library in libraries:
        _, cpu, subtype = struct.unpack_from("<III", library)
        header += struct.pack(">IIIII", cpu, subtype, offset, len(library), _ALIGNMENT)
        padded = library + b"\0" * (-len(library) % size)
        body += padded
        offset += len(padded)
    return header.ljust(size, b"\0") + body
