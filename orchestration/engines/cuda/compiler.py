"""From CUDA to what a GPU runs, by NVRTC of the wheel nvidia-cuda-nvrtc-cu12: no GPU is needed for that."""

import ctypes
import importlib.util
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from orchestration.basics.errors import QuadcosimError
from orchestration.basics.libraries import cached_library

OPTIONS = ("--std=c++20", "--fmad=false", "--device-as-default-execution-space", "--ptxas-options=-v")
_HEADERS = {
    "stdint.h": """typedef unsigned char uint8_t;
typedef int int32_t;
typedef unsigned uint32_t;
typedef long int64_t;
typedef unsigned long uint64_t;
#define INT64_MAX 0x7fffffffffffffff
""",
    "float.h": """#define DBL_MANT_DIG 53
#define DBL_MIN 0x1p-1022
#define DBL_MAX 0x1.fffffffffffffp1023
""",
    "stddef.h": "", "stdbool.h": "", "string.h": "",
}  # fmt: skip
"""Of the standard library what is made use of, for a compiler that has no files of it: the rest is in the language"""
_TAKEN = re.compile(
    r"Function properties for (\w+)\n.*?(\d+) bytes spill stores, (\d+) bytes spill loads(?:\n.*?Used (\d+) registers)?"
)


@dataclass(frozen=True, kw_only=True)
class Taken:
    """What a function takes of a processor."""

    registers: int | None
    """None: as many as the kernel that calls it"""
    spilled: int
    """[byte] that are put into memory for want of registers"""


@dataclass(frozen=True, kw_only=True)
class Image:
    """What a GPU loads, and what was said of it."""

    content: bytes
    log: str

    @property
    def taken(self) -> dict[str, Taken]:
        """What functions take, by the names that the compiler gives them."""
        return {
            name: Taken(registers=None if registers is None else int(registers), spilled=int(stores) + int(loads))
            for name, stores, loads, registers in (found.groups() for found in _TAKEN.finditer(self.log))
        }


def expect_compiler() -> None:
    """Raise `QuadcosimError` without NVRTC, saying what to install."""
    _library()


def compiled(text: str, architecture: str) -> bytes:
    """What GPUs of an architecture, as sm_90, run; kept in the user's cache.

    Raises `QuadcosimError` without NVRTC, saying what to install.
    """
    make = lambda: image(text, architecture).content  # noqa: E731
    return cached_library("cuda", {"flights.cu": text.encode()}, (OPTIONS, architecture, _version()), make).read_bytes()


def image(text: str, architecture: str) -> Image:
    """The same, compiled now, with what the compiler says of it."""
    library, program = _library(), ctypes.c_void_p()
    names, contents = (
        (ctypes.c_char_p * len(_HEADERS))(*(each.encode() for each in some)) for some in (_HEADERS, _HEADERS.values())
    )
    given = [each.encode() for each in (f"--gpu-architecture={architecture}", *OPTIONS)]
    _expect(library.nvrtcCreateProgram(
        ctypes.byref(program), text.encode(), b"flights.cu", len(_HEADERS), contents, names
    ))  # fmt: skip
    try:
        failed = library.nvrtcCompileProgram(program, len(given), (ctypes.c_char_p * len(given))(*given))
        log = _told(library.nvrtcGetProgramLogSize, library.nvrtcGetProgramLog, program).rstrip(b"\0").decode()
        if failed:
            first = next((line for line in log.splitlines() if "error" in line), log)
            raise QuadcosimError(f"CUDA for {architecture}: {first}")
        content = _told(library.nvrtcGetCUBINSize, library.nvrtcGetCUBIN, program)
    finally:
        library.nvrtcDestroyProgram(ctypes.byref(program))
    return Image(content=content, log=log)


def _told(size_of: Any, get: Any, program: ctypes.c_void_p) -> bytes:
    size = ctypes.c_size_t()
    _expect(size_of(program, ctypes.byref(size)))
    found = ctypes.create_string_buffer(size.value)
    _expect(get(program, found))
    return found.raw


def _expect(result: int) -> None:
    if result:
        raise QuadcosimError(f"NVRTC: {_library().nvrtcGetErrorString(result).decode()}")


def _version() -> Sequence[int]:
    major, minor = ctypes.c_int(), ctypes.c_int()
    _expect(_library().nvrtcVersion(ctypes.byref(major), ctypes.byref(minor)))
    return major.value, minor.value


@cache
def _library() -> Any:
    try:
        found = importlib.util.find_spec("nvidia.cuda_nvrtc")
    except ModuleNotFoundError:
        found = None
    folders = [] if found is None else [Path(each) for each in found.submodule_search_locations or ()]
    path = next((path for folder in folders for path in sorted(folder.glob("lib/libnvrtc.so.*"))), None)
    if path is None:
        raise QuadcosimError("NVRTC is not installed; this needs: pip install 'quadcosim[cuda]'")
    library = ctypes.CDLL(str(path))
    library.nvrtcGetErrorString.restype = ctypes.c_char_p
    return library
