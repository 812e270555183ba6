"""Where runs have their numbers: in memory of this process, unless they are flown where that does not reach."""

import ctypes
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from orchestration.basics.simulator import Floats, Integers
from orchestration.engines.structures import address

_ALIGNED = 64
"""[byte], as vector registers and the lines of caches like it"""


class Memory:
    """Gives room for numbers and structures that lasts as long as this, and addresses by which C finds them."""

    def __init__(self) -> None:
        self._lasting: list[Any] = []

    def numbers(self, *shape: int) -> Floats:
        """Zeros."""
        return self._room(*shape).view(np.float64)

    def integers(self, *shape: int) -> Integers:
        """Zeros."""
        return self._room(*shape).view(np.int64)

    def structures(self, kind: Any, count: int) -> Any:
        """So many structures of a kind, of zeros; of none there is one too, to have an address."""
        words = -(-ctypes.sizeof(kind) * max(1, count) // 8)
        return (kind * max(1, count)).from_buffer(self._room(words))

    def lasting(self, array: npt.NDArray[Any]) -> int:
        """Where C finds an array that does not change."""
        self._lasting.append(array)
        return address(array)

    def passing(self, array: npt.NDArray[Any]) -> int:
        """The same, for as long as some runs take; whoever asks keeps the array."""
        return address(array)

    def _room(self, *shape: int) -> Integers:
        count = math.prod(shape)
        whole = np.zeros(count + _ALIGNED // 8, dtype=np.int64)
        self._lasting.append(whole)
        first = (-address(whole) // 8) % (_ALIGNED // 8)
        return whole[first : first + count].reshape(shape)
