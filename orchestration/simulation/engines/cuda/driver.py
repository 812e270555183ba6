"""An NVIDIA GPU by its driver: shared memory, kernels, and their launch."""

import ctypes
import time
from functools import cached_property
from typing import Any

from orchestration.foundation.basics.errors import QuadcosimError

LIBRARY = "libcuda.so.1"
_THREADS = 64
"""Threads of a block: whole batches, few enough for any number of registers"""
_GLOBAL = 1
"""Memory that all GPUs and this process can access (CU_MEM_ATTACH_GLOBAL)"""
_MAJOR, _MINOR = 75, 76
"""Attributes with the version of the architecture"""


class Gpu:
    """The first GPU; raises `QuadcosimError` without one, naming what was not found.

    It must be used from one thread of this process.
    """

    def __init__(self) -> None:
        try:
            self._library: Any = ctypes.CDLL(LIBRARY)
        except OSError as error:
            raise QuadcosimError(f"no driver of an NVIDIA GPU: expected {LIBRARY}") from error
        self.busy = 0.0
        """[s] total duration of kernels"""
        self._device, self._context = ctypes.c_int(), ctypes.c_void_p()
        self._call("cuInit", 0)
        self._call("cuDeviceGet", ctypes.byref(self._device), 0)

    @cached_property
    def name(self) -> str:
        """Its name."""
        name = ctypes.create_string_buffer(256)
        self._call("cuDeviceGetName", name, len(name), self._device)
        return name.value.decode()

    @cached_property
    def architecture(self) -> str:
        """The name of its architecture for compilers, as sm_90."""
        version = [ctypes.c_int(), ctypes.c_int()]
        for value, attribute in zip(version, (_MAJOR, _MINOR)):
            self._call("cuDeviceGetAttribute", ctypes.byref(value), attribute, self._device)
        return f"sm_{version[0].value}{version[1].value}"

    def kernel(self, image: bytes, name: str) -> ctypes.c_void_p:
        """A kernel of a compiled program."""
        module, function = ctypes.c_void_p(), ctypes.c_void_p()
        self._begin()
        self._call("cuModuleLoadData", ctypes.byref(module), image)
        self._call("cuModuleGetFunction", ctypes.byref(function), module, name.encode())
        return function

    def launch(self, kernel: ctypes.c_void_p, threads: int, *numbers: int) -> None:
        """Run a kernel in `threads` threads, and wait for its end; its arguments are `numbers`, of 64 bits each."""
        arguments = [ctypes.c_int64(number) for number in numbers]
        addresses = (ctypes.c_void_p * len(arguments))(*map(ctypes.addressof, arguments))
        blocks = -(-threads // _THREADS)
        begin = time.perf_counter()
        self._call("cuLaunchKernel", kernel, blocks, 1, 1, _THREADS, 1, 1, 0, None, addresses, None)
        self._call("cuCtxSynchronize")
        self.busy += time.perf_counter() - begin

    def allocate(self, size: int) -> int:
        """Allocate memory that it shares with this process; the address."""
        allocated = ctypes.c_uint64()
        self._begin()
        self._call("cuMemAllocManaged", ctypes.byref(allocated), ctypes.c_size_t(size), _GLOBAL)
        return allocated.value

    def free(self, address: int) -> None:
        """Free allocated memory."""
        self._call("cuMemFree_v2", ctypes.c_uint64(address))

    def _begin(self) -> None:
        """Create the context on first use, since it takes time and memory."""
        if not self._context:
            self._call("cuDevicePrimaryCtxRetain", ctypes.byref(self._context), self._device)
            self._call("cuCtxSetCurrent", self._context)

    def _call(self, name: str, *arguments: Any) -> None:
        result = getattr(self._library, name)(*arguments)
        if result:
            text = ctypes.c_char_p()
            self._library.cuGetErrorString(result, ctypes.byref(text))
            raise QuadcosimError(f"{name}: {(text.value or b'error').decode()} ({result})")
