"""From C to a library: by the C compiler of this machine."""

from __future__ import annotations

import functools
import platform
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Literal

from fmu_kit.bundle import PackagingError

OPTIONS = (
    *("-std=gnu11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno"),
    *("-s", "-Wl,--build-id=none"),  # nothing that differs from one build to the next
)

Mathematics = Literal["own", "libm"]
"""Where the elementary functions come from: the same bits everywhere, or those of CPython on this machine."""
_MATHEMATICS: dict[Mathematics, tuple[str, ...]] = {"own": (), "libm": ("-DQUADCOSIM_LIBM", "-lm")}


def host_platform() -> str | None:
    """The name that FMI 2.0 has for the system of this machine, if an FMU can be compiled for it here."""
    known = {("linux", "x86_64"): "linux64", ("linux", "aarch64"): "aarch64-linux"}
    return known.get((sys.platform, platform.machine()))


def compiler() -> str:
    """The path of the C compiler; raises `PackagingError` saying what to install if there is none."""
    found = shutil.which("cc")
    if found is None:
        raise PackagingError(
            "no C compiler that is called cc: install one (Debian, Ubuntu: apt install gcc libc6-dev; Fedora: dnf "
            "install gcc)"
        )
    return found


@functools.cache
def compiler_version() -> str:
    """What the compiler says of itself; empty without one."""
    found = shutil.which("cc")
    if found is None:
        return ""
    return subprocess.run([found, "--version"], capture_output=True, text=True, check=False).stdout


def compiled(sources: dict[str, bytes], main: str, *, mathematics: Mathematics = "own") -> bytes:
    """The library that the file `main` among the sources is compiled to; raises `PackagingError` if it cannot be."""
    cc = compiler()
    with tempfile.TemporaryDirectory() as folder:
        for name, content in sources.items():
            Path(folder, name).write_bytes(content)
        done = subprocess.run(
            [cc, main, "-o", "library", *OPTIONS, *_MATHEMATICS[mathematics]],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            lines = [line for line in done.stderr.splitlines() if "error" in line] or ["no output"]
            raise PackagingError(f"{cc}: {lines[0]}")
        return Path(folder, "library").read_bytes()
