"""Memory that a GPU and this process share at the same addresses (CUDA calls it managed)."""

import ctypes
import math
import weakref
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Integers
from orchestration.simulation.engines.batch.memory import Memory
from orchestration.simulation.engines.cuda.driver import Gpu
from orchestration.simulation.engines.structures import address

_LINE = 64
"""[byte], the alignment of what is handed out"""
_SLAB = 1 << 24
"""[byte], the smallest allocation"""


class SharedMemory(Memory):
    """Provides memory that a GPU can access; freed with this object."""

    def __init__(self, gpu: Gpu) -> None:
        super().__init__()
        self._gpu = gpu
        self._permanent, self._temporary = _Slabs(gpu), _Slabs(gpu)
        self._copies: dict[int, tuple[npt.NDArray[Any], int]] = {}

    def permanent_address(self, array: npt.NDArray[Any]) -> int:
        """The address of a copy of an array."""
        return self._permanent.copied(array)

    def temporary_address(self, array: npt.NDArray[Any]) -> int:
        """The same, valid until `release_temporary`; repeated calls with one array share a copy."""
        if id(array) not in self._copies:
            self._copies[id(array)] = array, self._temporary.copied(array)
        return self._copies[id(array)][1]

    def release_temporary(self) -> None:
        """Reuse the memory of the copies with temporary addresses."""
        self._copies.clear()
        self._temporary.reuse()

    def _room(self, *shape: int) -> Integers:
        return self._permanent.room(8 * math.prod(shape)).view(np.int64).reshape(shape)


class _Slabs:
    """Memory that is allocated in large pieces and handed out in small ones."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._slabs: list[npt.NDArray[np.uint8]] = []
        self._at = self._used = 0
        weakref.finalize(self, _free, gpu, self._slabs)

    def copied(self, array: npt.NDArray[Any]) -> int:
        room = self.room(array.nbytes)
        room[:] = np.ascontiguousarray(array).view(np.uint8).reshape(-1)
        return address(room)

    def room(self, size: int) -> npt.NDArray[np.uint8]:
        """Zeros."""
        size_of_lines = -(-size // _LINE) * _LINE
        while self._at < len(self._slabs) and self._used + size_of_lines > len(self._slabs[self._at]):
            self._at, self._used = self._at + 1, 0
        if self._at == len(self._slabs):
            whole = max(size_of_lines, _SLAB)
            allocated = (ctypes.c_uint8 * whole).from_address(self._gpu.allocate(whole))
            self._slabs.append(np.ctypeslib.as_array(allocated))
            self._used = 0
        room = self._slabs[self._at][self._used : self._used + size]
        self._used += size_of_lines
        room[:] = 0
        return room

    def reuse(self) -> None:
        """Hand out the same memory again."""
        self._at = self._used = 0


def _free(gpu: Gpu, slabs: Iterable[npt.NDArray[np.uint8]]) -> None:
    for slab in slabs:
        gpu.free(address(slab))
