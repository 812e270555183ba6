"""The compiled loop as a library: compiled once on this machine, and kept in the user's cache."""

import ctypes
import functools
from pathlib import Path
from typing import Any

from fmu_kit.compiler.pack.c_compiler import OPTIONS, compiled_here
from fmu_kit.compiler.runtime import FOLDER
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.libraries import cached_library
from orchestration.simulation.engines import condition
from orchestration.simulation.engines.structures import HEADER, declared, expect_same_sizes, shared

INSTANTS = Path(__file__).with_name("instants.h")
"""C of what happens at an instant, for runs of FMUs and of kernels in SIMD lanes"""
FILES = (Path(__file__).with_name("loop.c"), condition.HEADER, INSTANTS, HEADER, FOLDER / "lanes.h")
"""Its sources, beside the generated operators.h"""
Operation: Any = declared(condition.HEADER.read_text(encoding="utf-8"))["Operation"]
"""One step of a condition"""


@functools.cache
def library() -> Any:
    """The function `run` of loop.c; raises `QuadcosimError` with the reason if it is not available."""
    sources = {path.name: path.read_bytes() for path in FILES}
    sources["operators.h"] = condition.operators().encode()
    path = cached_library("loop", sources, OPTIONS, lambda: compiled_here(sources, "loop.c", mathematics="libm"))
    try:
        loaded = ctypes.CDLL(str(path))
    except OSError as error:
        raise QuadcosimError(str(error)) from error
    expect_same_sizes(loaded, {**shared(1), "Operation": Operation})
    run = loaded.run
    run.restype = ctypes.c_int
    run.argtypes = (ctypes.c_void_p,)
    return run
