"""Memory that a GPU and this process share: each finds it by the same addresses (CUDA calls it managed)."""

import ctypes
import math
import weakref
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.basics.simulator import Integers
from orchestration.engines.batch.memory import Memory
from orchestration.engines.cuda.driver import Gpu
from orchestration.engines.structures import address

_LINE = 64
"""[byte] that what is asked for begins at a multiple of"""
_SLAB = 1 << 24
"""[byte] that are allocated at once, or more"""


class SharedMemory(Memory):
    """Gives room that a GPU reaches; freed with this."""

    def __init__(self, gpu: Gpu) -> None:
        super().__init__()
        self._gpu = gpu
        self._own, self._passing = _Slabs(gpu), _Slabs(gpu)
        self._known: dict[int, tuple[npt.NDArray[Any], int]] = {}

    def lasting(self, array: npt.NDArray[Any]) -> int:
        """Where both find a copy of an array."""
        return self._own.copied(array)

    def passing(self, array: npt.NDArray[Any]) -> int:
        """The same until `forget`; of an array that many ask for, as the instants of one timing, there is one copy."""
        if id(array) not in self._known:
            self._known[id(array)] = array, self._passing.copied(array)
        return self._known[id(array)][1]

    def forget(self) -> None:
        """The runs are over that arrays were passed for."""
        self._known.clear()
        self._passing.reuse()

    def _room(self, *shape: int) -> Integers:
        return self._own.room(8 * math.prod(shape)).view(np.int64).reshape(shape)


class _Slabs:
    """Allocated in large pieces, handed out in small ones."""

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
            there = (ctypes.c_uint8 * whole).from_address(self._gpu.allocate(whole))
            self._slabs.append(np.ctypeslib.as_array(there))
            self._used = 0
        room = self._slabs[self._at][self._used : self._used + size]
        self._used += size_of_lines
        room[:] = 0
        return room

    def reuse(self) -> None:
        """Hand out the same again."""
        self._at = self._used = 0


def _free(gpu: Gpu, slabs: Iterable[npt.NDArray[np.uint8]]) -> None:
    for slab in slabs:
        gpu.free(address(slab))
