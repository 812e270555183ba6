"""Slaves as `export-c` writes them, compiled for this machine and for a Cortex-M4F, and run there."""

import functools
import re
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.extent import WHOLE
from tests.fmu_kit.compiler.compiled import HERE, compiler
from tests.patience import PATIENCE

LEVEL = "-O2" if WHOLE else "-O1"
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wdouble-promotion", LEVEL, "-fno-math-errno")
ARM, QEMU = "arm-none-eabi-gcc", "qemu-system-arm"
M4F = ("-mthumb", "-mfloat-abi=hard", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16")
M7 = ("-mthumb", "-mfloat-abi=hard", "-mcpu=cortex-m7", "-mfpu=fpv5-d16")
BOARDS: dict[tuple[str, ...], str] = {M4F: "mps2-an386", M7: "mps2-an500"}
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
    """A source compiled alone, without warnings; in double precision for a freestanding machine."""
    path = source.with_name(f"{source.stem}_{'_'.join((with_compiler, *flags))}.o")
    alone = () if "<math.h>" in source.read_text("utf-8") else ("-ffreestanding",)
    _succeeds([compiler(with_compiler), *STRICT, *alone, *flags, "-c", str(source), "-o", str(path)])
    return path


def calls(path: Path, nm: str = "nm") -> set[str]:
    """What an object takes from elsewhere."""
    return {line.split()[-1] for line in _succeeds([compiler(nm), "-u", str(path)]).splitlines()}


def defined(path: Path) -> set[str]:
    """The functions that an object has for others."""
    symbols = _succeeds([compiler("nm"), "-g", "--defined-only", str(path)]).splitlines()
    return {name for _, kind, name in map(str.split, symbols) if kind == "T"}


def declared(header: Path) -> set[str]:
    """The functions of a header."""
    return set(re.findall(r"^\w.*\b(\w+)\(.*\);$", header.read_text("utf-8"), re.M))


def assert_its_header_is_kept(source: Path, *flags: str) -> None:
    """A source compiles without a warning to the functions that its header declares, and to no other for others."""
    names = {f"{source.stem}_{name}" for name in ("init", "start", "step", "changed", "error")}
    assert defined(made(source, "cc", *flags)) == declared(source.with_suffix(".h")) == names


def on_this_machine(main: str, sources: list[Path], folder: Path, *flags: str, by: str = "cc") -> list[str]:
    """The lines that a program of this folder prints."""
    _succeeds([*_with(main, by, sources, folder), *flags, "-o", str(folder / "here"), "-lm"])
    return _printed([str(folder / "here")])


def elsewhere(emulator: str, by: str, main: str, sources: list[Path], folder: Path, *flags: str) -> list[str]:
    """The lines that a program of this folder prints, compiled `by` a cross-compiler, under an emulator.

    Skipped by name without one of them.
    """
    path = shutil.which(emulator)
    if path is None:
        pytest.skip(f"no {emulator}")
    program = folder / "elsewhere.exe"
    _succeeds([*_with(main, by, sources, folder), *flags, "-static", "-o", str(program), "-lm"])
    return _printed([path, str(program)])


def on_cortex_m(machine: tuple[str, ...], main: str, sources: list[Path], folder: Path, *flags: str) -> list[str]:
    """The lines that a program of this folder prints on a Cortex-M under QEMU; skipped by name without the tools."""
    if shutil.which(QEMU) is None:
        pytest.skip(f"no {QEMU}")
    start = (str(HERE / "cortex_m.c"), "-T", str(HERE / "cortex_m.ld"), "--specs=rdimon.specs")
    _succeeds([*_with(main, ARM, sources, folder, *machine), *flags, *start, "-o", str(folder / "arm"), "-lm"])
    board = ("-M", BOARDS[machine], "-display", "none", "-semihosting-config", "enable=on,target=native")
    return _printed([QEMU, *board, "-kernel", str(folder / "arm")])


def to_note(controller: Path, plant: Path, folder: Path) -> list[str]:
    """Write down for embedded_flight.c which variables to note: all, those of the controller first; their FMI names."""
    sides = {"c": fields(controller.with_suffix(".h")), "p": fields(plant.with_suffix(".h"))}
    noted = [f"X({side}.{field})" for side, by_name in sides.items() for field in by_name.values()]
    (folder / "variables.h").write_text(f"#define EACH(X) {' '.join(noted)}\n")
    return [f"{side}.{name}" for side, by_name in sides.items() for name in by_name]


def rows_of(lines: list[str]) -> NDArray[np.float64]:
    """The rows that embedded_flight.c printed in full, every hundredth."""
    return np.array([[struct.unpack(">d", bytes.fromhex(text))[0] for text in line.split()] for line in lines[:-1]])


def _with(main: str, with_compiler: str, sources: list[Path], folder: Path, *machine: str) -> list[str]:
    places = [flag for where in (folder, *(source.parent for source in sources)) for flag in ("-I", str(where))]
    objects = [str(made(source, with_compiler, *machine)) for source in sources]
    return [compiler(with_compiler), "-std=c99", LEVEL, *machine, *places, str(HERE / main), *objects]


def _printed(command: list[str]) -> list[str]:
    return _succeeds(command).splitlines()


def _succeeds(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
