"""The C sources beside this file, compiled with the headers of `fmu_kit/compiler`."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fmu_kit.compiler import runtime

HERE = Path(__file__).parent
HEADERS = runtime.FOLDER
COMPILER = shutil.which("gcc") or shutil.which("cc")
WARNINGS = ("-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
Floats = NDArray[np.float64]


def compiler(name: str | None = COMPILER) -> str:
    """The path of a compiler; without it the test is skipped by name."""
    path = shutil.which(name) if name else None
    if path is None:
        pytest.skip(f"no compiler {name or 'gcc or cc'}")
    return path


def compiled(source: str, target: Path, *flags: str, with_compiler: str | None = COMPILER) -> Path:
    """A source of this folder as `target`."""
    command = [compiler(with_compiler), *WARNINGS, "-I", str(HEADERS), str(HERE / source), "-o", str(target), *flags]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return target


def library(source: str, folder: Path, *flags: str) -> ctypes.CDLL:
    """A source of this folder as a library, optimised."""
    name = "_".join([source.removesuffix(".c"), *(flag.strip("-") for flag in flags)])
    return ctypes.CDLL(str(compiled(source, folder / f"{name}.so", "-O2", "-shared", "-fPIC", *flags)))


def results(loops: ctypes.CDLL, name: str, *arguments: Floats) -> Floats:
    """A function of mathematics.h over arrays, by `loops.c`."""
    arrays = [np.ascontiguousarray(argument, np.float64) for argument in arguments]
    out = np.empty_like(arrays[0])
    pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (*arrays, out)]
    getattr(loops, f"{name}_loop")(*pointers, ctypes.c_size_t(len(out)))
    return out


def processor() -> set[str]:
    """The instruction sets of the processor as reported by Linux; empty elsewhere."""
    listed = Path("/proc/cpuinfo")
    return set(listed.read_text().split()) if listed.exists() else set()
