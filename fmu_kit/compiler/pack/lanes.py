"""The lanes of a native FMU: its sources compiled so that vector registers hold several runs (`lanes.c` says how)."""

from __future__ import annotations

import ctypes
import functools
import re
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fmu_kit.bundle import PackagingError
from fmu_kit.compiler.pack.c_compiler import FOR_THIS_PROCESSOR, Mathematics, compiled_here, compiler

MAIN = "lanes.c"
"""Of the sources of an FMU, what is compiled."""
MOST_LANES = 64
_REGISTERS = {"__AVX512DQ__": 8, "__AVX__": 4}
"""How many doubles a vector register has, by what a compiler says of the processor; else there are 2."""


@functools.cache
def lanes_here() -> int:
    """How many runs this machine best computes at once: as many as a vector register has doubles.

    Raises `PackagingError`, saying what to install if there is no compiler.
    """
    command = [compiler(), *FOR_THIS_PROCESSOR, "-dM", "-E", "-x", "c", "-"]
    told = subprocess.run(command, input="", capture_output=True, text=True, check=False).stdout
    known = set(re.findall(r"#define (\w+)", told))
    return next((lanes for name, lanes in _REGISTERS.items() if name in known), 2)


def compiled_lanes(
    sources: Mapping[str, bytes], lanes: int | None = None, *, mathematics: Mathematics = "own"
) -> bytes:
    """The library with which the slave that an FMU has in `sources` (by name) is computed in lanes, for this machine.

    `lanes` is 1 or a power of two up to 64; without it there are as many as `lanes_here`. Raises `PackagingError`
    for sources without lanes, and without a compiler, saying what to install.
    """
    if MAIN not in sources:
        raise PackagingError(f"sources of the FMU: expected {MAIN}, as in those of quadcosim build --native")
    count = lanes_here() if lanes is None else lanes
    if count not in (2**k for k in range(7)):
        raise PackagingError(f"lanes = {lanes}: expected 1 or a power of two up to {MOST_LANES}")
    options = (*FOR_THIS_PROCESSOR, f"-DQUADCOSIM_LANES={count}", "-Wno-psabi")
    return compiled_here(dict(sources), MAIN, mathematics=mathematics, options=options)


class Lanes:
    """A library of `compiled_lanes`, loaded; its functions take addresses of arrays, as `lanes.c` describes them."""

    def __init__(self, library: Path) -> None:
        self._library: Any = ctypes.CDLL(str(library))
        self.lanes: int = self._library.quadcosim_lanes()
        self.places: int = self._library.quadcosim_places()
        """of the memory: each has a double for every lane"""
        self.variables: int = self._library.quadcosim_variables()
        """how many places, from the first one, are variables, by their value references"""
        self.divergence: int = self._library.quadcosim_divergence()
        """the status of a lane that has diverged"""

    @property
    def line(self) -> tuple[int, int]:
        """How many steps were tried as a straight line (`passes/straightening.py`), and how many of them left it."""
        tried, left = ctypes.c_int64(), ctypes.c_int64()
        self._library.quadcosim_line(ctypes.byref(tried), ctypes.byref(left))
        return tried.value, left.value

    def begin(self, memory: int) -> None:
        """Put the start values into all lanes of a memory."""
        self._library.quadcosim_begin(*map(ctypes.c_void_p, (memory,)))

    def initialise(self, memory: int, active: int, start_time: int, status: int) -> None:
        """Take over what was set, and compute outputs at the start time [s]."""
        self._library.quadcosim_initialise(*map(ctypes.c_void_p, (memory, active, start_time, status)))

    def do_step(self, memory: int, active: int, t: int, h: int, status: int) -> None:
        """Advance from t by h [s]."""
        self._library.quadcosim_do_step(*map(ctypes.c_void_p, (memory, active, t, h, status)))
