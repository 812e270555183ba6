"""A GPU of NVIDIA by its driver: memory that both sides find at the same addresses, kernels, and what starts them."""

import ctypes
import time
from functools import cached_property
from typing import Any

from orchestration.basics.errors import QuadcosimError

LIBRARY = "libcuda.so.1"
_THREADS = 64
"""of a block: whole batches, few enough for any number of registers"""
_GLOBAL = 1
"""Memory that all GPUs and this process find (CU_MEM_ATTACH_GLOBAL)"""
_MAJOR, _MINOR = 75, 76
"""Attributes: of the architecture"""


class Gpu:
    """The first one there is; raises `QuadcosimError` without one, saying what was not found.

    Work goes on in one thread of this process, the one that begins with it.
    """

    def __init__(self) -> None:
        try:
            self._library: Any = ctypes.CDLL(LIBRARY)
        except OSError as error:
            raise QuadcosimError(f"no driver of a GPU of NVIDIA: expected {LIBRARY}") from error
        self.busy = 0.0
        """[s] that kernels have taken, from their start to their end"""
        self._device, self._context = ctypes.c_int(), ctypes.c_void_p()
        self._call("cuInit", 0)
        self._call("cuDeviceGet", ctypes.byref(self._device), 0)

    @cached_property
    def name(self) -> str:
        """What it is called."""
        name = ctypes.create_string_buffer(256)
        self._call("cuDeviceGetName", name, len(name), self._device)
        return name.value.decode()

    @cached_property
    def architecture(self) -> str:
        """As compilers call it: sm_90."""
        found = [ctypes.c_int(), ctypes.c_int()]
        for value, attribute in zip(found, (_MAJOR, _MINOR)):
            self._call("cuDeviceGetAttribute", ctypes.byref(value), attribute, self._device)
        return f"sm_{found[0].value}{found[1].value}"

    def kernel(self, image: bytes, name: str) -> ctypes.c_void_p:
        """A kernel of what was compiled for it."""
        module, function = ctypes.c_void_p(), ctypes.c_void_p()
        self._begin()
        self._call("cuModuleLoadData", ctypes.byref(module), image)
        self._call("cuModuleGetFunction", ctypes.byref(function), module, name.encode())
        return function

    def launch(self, kernel: ctypes.c_void_p, threads: int, *numbers: int) -> None:
        """Do a kernel in so many threads, and wait for its end; `numbers` are what it is given, of 64 bits each."""
        given = [ctypes.c_int64(number) for number in numbers]
        addresses = (ctypes.c_void_p * len(given))(*map(ctypes.addressof, given))
        blocks = -(-threads // _THREADS)
        begin = time.perf_counter()
        self._call("cuLaunchKernel", kernel, blocks, 1, 1, _THREADS, 1, 1, 0, None, addresses, None)
        self._call("cuCtxSynchronize")
        self.busy += time.perf_counter() - begin

    def allocate(self, size: int) -> int:
        """Memory that it shares with this process."""
        found = ctypes.c_uint64()
        self._begin()
        self._call("cuMemAllocManaged", ctypes.byref(found), ctypes.c_size_t(size), _GLOBAL)
        return found.value

    def free(self, address: int) -> None:
        """Give memory back."""
        self._call("cuMemFree_v2", ctypes.c_uint64(address))

    def _begin(self) -> None:
        """It is made ready when there is work: that takes a while, and memory."""
        if not self._context:
            self._call("cuDevicePrimaryCtxRetain", ctypes.byref(self._context), self._device)
            self._call("cuCtxSetCurrent", self._context)

    def _call(self, name: str, *arguments: Any) -> None:
        result = getattr(self._library, name)(*arguments)
        if result:
            text = ctypes.c_char_p()
            self._library.cuGetErrorString(result, ctypes.byref(text))
            raise QuadcosimError(f"{name}: {(text.value or b'error').decode()} ({result})")
