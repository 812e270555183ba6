"""Compiles CUDA by NVRTC, of the wheel nvidia-cuda-nvrtc-cu12; this needs no GPU."""

import ctypes
import importlib.util
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.libraries import cached_library

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
"""The parts of the standard library that are used: NVRTC has no header files"""
_RESOURCES = re.compile(
    r"Function properties for (\w+)\n.*?(\d+) bytes spill stores, (\d+) bytes spill loads(?:\n.*?Used (\d+) registers)?"
)


@dataclass(frozen=True, kw_only=True)
class KernelResources:
    """The resources of a processor that a function uses."""

    registers: int | None
    """None: as many as the kernel that calls the function"""
    spilled: int
    """[byte] that are moved to memory for lack of registers"""


@dataclass(frozen=True, kw_only=True)
class Image:
    """A compiled program, and the log of its compilation."""

    content: bytes
    log: str

    @property
    def resources(self) -> dict[str, KernelResources]:
        """The resources of functions, by their names in the log."""
        return {
            name: KernelResources(
                registers=None if registers is None else int(registers), spilled=int(stores) + int(loads)
            )
            for name, stores, loads, registers in (match.groups() for match in _RESOURCES.finditer(self.log))
        }


def expect_compiler() -> None:
    """Raise `QuadcosimError` without NVRTC, naming what to install."""
    _library()


def compiled(text: str, architecture: str) -> bytes:
    """The program compiled for GPUs of an architecture, as sm_90, from the user's cache if it is there.

    Raises `QuadcosimError` without NVRTC, naming what to install.
    """
    compile_ = lambda: image(text, architecture).content  # noqa: E731
    return cached_library(
        "cuda", {"flights.cu": text.encode()}, (OPTIONS, architecture, _version()), compile_
    ).read_bytes()


def image(text: str, architecture: str) -> Image:
    """The same, always compiled anew, with the log of the compiler."""
    library, program = _library(), ctypes.c_void_p()
    names, contents = (
        (ctypes.c_char_p * len(_HEADERS))(*(each.encode() for each in some)) for some in (_HEADERS, _HEADERS.values())
    )
    options = [each.encode() for each in (f"--gpu-architecture={architecture}", *OPTIONS)]
    _expect(library.nvrtcCreateProgram(
        ctypes.byref(program), text.encode(), b"flights.cu", len(_HEADERS), contents, names
    ))  # fmt: skip
    try:
        failed = library.nvrtcCompileProgram(program, len(options), (ctypes.c_char_p * len(options))(*options))
        log = _read(library.nvrtcGetProgramLogSize, library.nvrtcGetProgramLog, program).rstrip(b"\0").decode()
        if failed:
            first = next((line for line in log.splitlines() if "error" in line), log)
            raise QuadcosimError(f"CUDA for {architecture}: {first}")
        content = _read(library.nvrtcGetCUBINSize, library.nvrtcGetCUBIN, program)
    finally:
        library.nvrtcDestroyProgram(ctypes.byref(program))
    return Image(content=content, log=log)


def _read(size_of: Any, get: Any, program: ctypes.c_void_p) -> bytes:
    size = ctypes.c_size_t()
    _expect(size_of(program, ctypes.byref(size)))
    buffer = ctypes.create_string_buffer(size.value)
    _expect(get(program, buffer))
    return buffer.raw


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
        spec = importlib.util.find_spec("nvidia.cuda_nvrtc")
    except ModuleNotFoundError:
        spec = None
    folders = [] if spec is None else [Path(each) for each in spec.submodule_search_locations or ()]
    path = next((path for folder in folders for path in sorted(folder.glob("lib/libnvrtc.so.*"))), None)
    if path is None:
        raise QuadcosimError("NVRTC is not installed; this needs: pip install 'quadcosim[cuda]'")
    library = ctypes.CDLL(str(path))
    library.nvrtcGetErrorString.restype = ctypes.c_char_p
    return library
