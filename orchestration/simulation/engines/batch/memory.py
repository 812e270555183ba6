"""Memory for the numbers of runs, aligned for vector registers."""

import ctypes
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.simulation.engines.structures import address

_ALIGNED = 64
"""Size of the largest vector registers and of cache lines [byte]"""


class Memory:
    """Provides memory for numbers and structures, which exists as long as this object, and addresses for C."""

    def __init__(self) -> None:
        self._kept: list[Any] = []

    def numbers(self, *shape: int) -> Floats:
        """Zeros."""
        return self._room(*shape).view(np.float64)

    def integers(self, *shape: int) -> Integers:
        """Zeros."""
        return self._room(*shape).view(np.int64)

    def structures(self, kind: Any, count: int) -> Any:
        """`count` structures of a kind, zeroed; for a count of 0 there is one, to have an address."""
        words = -(-ctypes.sizeof(kind) * max(1, count) // 8)
        return (kind * max(1, count)).from_buffer(self._room(words))

    def permanent_address(self, array: npt.NDArray[Any]) -> int:
        """The address, for C, of an array that does not change and is kept here."""
        self._kept.append(array)
        return address(array)

    def temporary_address(self, array: npt.NDArray[Any]) -> int:
        """The address of an array for the duration of some runs; the caller keeps the array."""
        return address(array)

    def _room(self, *shape: int) -> Integers:
        count = math.prod(shape)
        whole = np.zeros(count + _ALIGNED // 8, dtype=np.int64)
        self._kept.append(whole)
        first = (-address(whole) // 8) % (_ALIGNED // 8)
        return whole[first : first + count].reshape(shape)
