"""The SIMD lanes of a native FMU: its sources compiled so that vector registers hold several runs (see `lanes.c`)."""

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
"""The file to compile among the sources of an FMU."""
USER_OBJECT = "code.o"
"""The object of a user's own C among them."""
MAX_LANES = 64
_REGISTERS = {"__AVX512DQ__": 8, "__AVX__": 4}
"""Doubles in a vector register, by predefined macro of the compiler; without these, 2."""


@functools.cache
def preferred_lanes() -> int:
    """The best number of lanes on this machine: the doubles in a vector register.

    Raises `PackagingError`, naming what to install, if there is no compiler.
    """
    command = [compiler(), *FOR_THIS_PROCESSOR, "-dM", "-E", "-x", "c", "-"]
    macros = subprocess.run(command, input="", capture_output=True, text=True, check=False).stdout
    known = set(re.findall(r"#define (\w+)", macros))
    return next((lanes for name, lanes in _REGISTERS.items() if name in known), 2)


def compiled_lanes(
    sources: Mapping[str, bytes], lanes: int | None = None, *, several: bool = False, mathematics: Mathematics = "own"
) -> bytes:
    """The library for this machine that computes the slave of an FMU's `sources`, by name, in lanes.

    `lanes` is 1 or a power of two up to 64; default: `preferred_lanes`. `several`: with a function that does several
    steps at once. Raises `PackagingError` for sources without
    lanes, and, naming what to install, without a compiler.
    """
    if MAIN not in sources:
        raise PackagingError(f"sources of the FMU: expected {MAIN}, as in those of quadcosim build --native")
    count = preferred_lanes() if lanes is None else lanes
    if count not in (2**k for k in range(7)):
        raise PackagingError(f"lanes = {lanes}: expected 1 or a power of two up to {MAX_LANES}")
    options: tuple[str, ...] = (*FOR_THIS_PROCESSOR, f"-DQUADCOSIM_LANES={count}", "-Wno-psabi")
    options += ("-DQUADCOSIM_SEVERAL",) if several else ()
    compiled = [name for name in sources if name.endswith(".o")]  # a user's own code
    options += (*compiled, "-lm") if compiled else ()
    return compiled_here(sources, MAIN, mathematics=mathematics, options=options)


class Lanes:
    """A loaded library of `compiled_lanes`; its functions take addresses of arrays, as described in `lanes.c`."""

    def __init__(self, library: Path) -> None:
        self._library: Any = ctypes.CDLL(str(library))
        self.lanes: int = self._library.quadcosim_lanes()
        self.places: int = self._library.quadcosim_places()
        """number of places of the memory, each with a double for every lane"""
        self.variables: int = self._library.quadcosim_variables()
        """number of variables, which are the first places, by value reference"""
        self.divergence: int = self._library.quadcosim_divergence()
        """status of a lane that has diverged"""

    @property
    def step(self) -> int:
        """The address of the function that advances the lanes, called as `do_step`."""
        return ctypes.cast(self._library.quadcosim_do_step, ctypes.c_void_p).value or 0

    @property
    def steps(self) -> int:
        """The address of the function that does several steps, as `lanes.c` has it; 0 if there is none."""
        function = getattr(self._library, "quadcosim_do_steps", None)
        return ctypes.cast(function, ctypes.c_void_p).value or 0 if function else 0

    @property
    def line(self) -> tuple[int, int]:
        """The numbers of steps tried as a straight line (`passes/straightening.py`), and of those that left it."""
        tried, left = ctypes.c_int64(), ctypes.c_int64()
        self._library.quadcosim_line(ctypes.byref(tried), ctypes.byref(left))
        return tried.value, left.value

    def begin(self, memory: int) -> None:
        """Set all lanes of a memory to the start values."""
        self._library.quadcosim_begin(*map(ctypes.c_void_p, (memory,)))

    def initialise(self, memory: int, active: int, start_time: int, status: int) -> None:
        """Initialise from the values that were set, and compute the outputs at the start time [s]."""
        self._library.quadcosim_initialise(*map(ctypes.c_void_p, (memory, active, start_time, status)))

    def do_step(self, memory: int, active: int, t: int, h: int, status: int, wanted: int | None = None) -> None:
        """Advance from t by h [s]; `wanted` as lanes.c has it."""
        self._library.quadcosim_do_step(*map(ctypes.c_void_p, (memory, active, t, h, status, wanted)))
