"""Slaves as `export-c` writes them, compiled for this machine and for a Cortex-M4F, and run there."""

import functools
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.fmu_kit.native.compiled import HERE, compiler

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wdouble-promotion", "-O2", "-fno-math-errno")
CORTEX_M4F = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
ARM, QEMU = "arm-none-eabi-gcc", "qemu-system-arm"
BOARD = ("-M", "mps2-an386", "-display", "none", "-semihosting-config", "enable=on,target=native")
_FIELD = re.compile(r" {8}(?:double|float) (\w+); +/\* ([^ :]+)")


def fields(header: Path) -> dict[str, str]:
    """The variables of a struct by the FMI names that its comments give them, as `par.mass`."""
    found: dict[str, str] = {}
    waiting: dict[str, str] = {}
    for line in header.read_text("utf-8").splitlines():
        if field := _FIELD.match(line):
            waiting[field[2]] = field[1]
        if line.startswith("    } "):
            found |= {name: f"{line.strip(' };')}.{field}" for name, field in waiting.items()}
            waiting = {}
    return found


@functools.cache
def made(source: Path, with_compiler: str, *flags: str) -> Path:
    """A source on its own, without a warning; in double precision for a machine that has nothing but itself."""
    path = source.with_name(f"{source.stem}_{'_'.join((with_compiler, *flags))}.o")
    alone = () if "<math.h>" in source.read_text("utf-8") else ("-ffreestanding",)
    machine = CORTEX_M4F if with_compiler == ARM else ()
    _succeeds([compiler(with_compiler), *STRICT, *alone, *machine, *flags, "-c", str(source), "-o", str(path)])
    return path


def calls(path: Path, nm: str = "nm") -> set[str]:
    """What an object takes from elsewhere."""
    return {line.split()[-1] for line in _succeeds([compiler(nm), "-u", str(path)]).splitlines()}


def on_this_machine(main: str, sources: list[Path], folder: Path, *flags: str) -> list[str]:
    """The lines that a program of this folder prints."""
    _succeeds([*_with(main, "cc", sources, folder), *flags, "-o", str(folder / "here"), "-lm"])
    return _printed([str(folder / "here")])


def on_cortex_m(main: str, sources: list[Path], folder: Path, *flags: str) -> list[str]:
    """The lines that a program of this folder prints on a Cortex-M4F under QEMU; skipped by name without the tools."""
    if shutil.which(QEMU) is None:
        pytest.skip(f"no {QEMU}")
    start = (str(HERE / "cortex_m.c"), "-T", str(HERE / "cortex_m.ld"), "--specs=rdimon.specs", *CORTEX_M4F)
    _succeeds([*_with(main, ARM, sources, folder), *flags, *start, "-o", str(folder / "arm"), "-lm"])
    return _printed([QEMU, *BOARD, "-kernel", str(folder / "arm")])


def _with(main: str, with_compiler: str, sources: list[Path], folder: Path) -> list[str]:
    places = [flag for where in (folder, *(source.parent for source in sources)) for flag in ("-I", str(where))]
    objects = [str(made(source, with_compiler)) for source in sources]
    return [compiler(with_compiler), "-std=c99", "-O2", *places, str(HERE / main), *objects]


def _printed(command: list[str]) -> list[str]:
    return _succeeds(command).splitlines()


def _succeeds(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
