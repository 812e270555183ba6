"""From C to a library: by the C compiler of this machine, or by zig for other systems as well."""

from __future__ import annotations

import importlib.util
import platform
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from fmu_kit.bundle import PackagingError

OPTIONS = (
    *("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno"),
    "-s",
)
_LINUX = ("-Wl,--build-id=none",)  # nothing that differs from one build to the next

TARGETS = {
    "linux64": ("x86_64-linux-gnu.2.17",),
    "win64": ("x86_64-windows-gnu",),
    "darwin64": ("x86_64-macos.11.0", "aarch64-macos.11.0"),
}
"""The systems that zig builds for, by their names in FMI 2.0, and what it calls them; several make one library."""
_SUFFIXES = {"win64": ".dll", "darwin64": ".dylib"}


Mathematics = Literal["own", "libm"]
"""Where the elementary functions come from: the same bits everywhere, or those of CPython on this machine."""
_MATHEMATICS: dict[Mathematics, tuple[str, ...]] = {"own": (), "libm": ("-DQUADCOSIM_LIBM", "-lm")}


def host_platform() -> str | None:
    """The name that FMI 2.0 has for the system of this machine, if an FMU can be compiled for it here."""
    known = {("linux", "x86_64"): "linux64", ("linux", "aarch64"): "aarch64-linux"}
    return known.get((sys.platform, platform.machine()))


def library_path(target: str, model: str) -> str:
    """Where the library for a system is in an FMU."""
    return f"binaries/{target}/{model}{_SUFFIXES.get(target, '.so')}"


def targets_of(text: str) -> tuple[str, ...]:
    """The systems named in a list with commas, or all; raises `PackagingError` naming them for any other."""
    given = tuple(TARGETS) if text == "all" else tuple(text.split(","))
    for target in given:
        if target not in TARGETS:
            raise PackagingError(f"target {target}: expected all, or some of {', '.join(TARGETS)} with commas between")
    return given


def compiled_here(sources: dict[str, bytes], main: str, *, mathematics: Mathematics = "own") -> bytes:
    """The library for this machine that the file `main` among the sources is compiled to, by its compiler `cc`.

    Raises `PackagingError`, saying what to install if there is no compiler.
    """
    cc = shutil.which("cc")
    if cc is None:
        raise PackagingError(
            "no C compiler that is called cc: install one (Debian, Ubuntu: apt install gcc libc6-dev; Fedora: dnf "
            "install gcc)"
        )
    return _compiled([cc, *OPTIONS, *_LINUX], sources, main, _MATHEMATICS[mathematics])


def compiled_for(target: str, sources: dict[str, bytes], main: str) -> bytes:
    """The library for a system of `TARGETS`, by zig; raises `PackagingError`, saying what to install without zig."""
    if importlib.util.find_spec("ziglang") is None:
        raise PackagingError("--target: expected zig, which compiles for all systems: pip install ziglang")
    options = [*OPTIONS, *(_LINUX if target == "linux64" else ())]
    slices = [
        _compiled([sys.executable, "-m", "ziglang", "cc", "-target", name, *options], sources, main)
        for name in TARGETS[target]
    ]
    return slices[0] if len(slices) == 1 else universal(slices)


def _compiled(command: list[str], sources: dict[str, bytes], main: str, after: Sequence[str] = ()) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        for name, content in sources.items():
            Path(folder, name).write_bytes(content)
        done = subprocess.run(
            [*command, main, "-o", "library", *after], cwd=folder, capture_output=True, text=True, check=False
        )
        if done.returncode != 0:
            said = done.stderr.strip().splitlines() or ["no output"]
            raise PackagingError(f"{command[0]}: {next((line for line in said if 'error' in line), said[-1])}")
        return Path(folder, "library").read_bytes()


_FAT_MAGIC, _ALIGNMENT = 0xCAFEBABE, 14
"""Of a universal binary; each library in it begins at a multiple of 2 to that power."""


def universal(libraries: Sequence[bytes]) -> bytes:
    """One library for macOS of several, each for one kind of processor: a header that says where each begins."""
    size = 1 << _ALIGNMENT
    header, body, offset = struct.pack(">II", _FAT_MAGIC, len(libraries)), b"", size
    for library in libraries:
        _, cpu, subtype = struct.unpack_from("<III", library)
        header += struct.pack(">IIIII", cpu, subtype, offset, len(library), _ALIGNMENT)
        padded = library + b"\0" * (-len(library) % size)
        body += padded
        offset += len(padded)
    return header.ljust(size, b"\0") + body
