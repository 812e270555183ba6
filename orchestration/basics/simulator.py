"""What the master needs of a simulator: an FMU behind an adapter, or a stub in a test."""

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Booleans: TypeAlias = npt.NDArray[np.bool_]
Transfer: TypeAlias = Callable[[], None]
"""Moves values between a simulator and the array that it was made for."""


class Simulator(Protocol):
    """A model that is stepped; every call raises `SimulatorError` where the model refuses it."""

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """A call that puts the values of `names` into the array `into`, contiguous and of their number."""

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """A call that sets the variables `names` from the array `source`."""

    def enter_initialization(self, start: float, stop: float) -> None:
        """Begin initialisation of a run over [start, stop] seconds; without an end if `stop` is infinite."""

    def exit_initialization(self) -> None:
        """End initialisation; from here on the simulator can be stepped."""

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` seconds with the inputs held.

        Raises `StoppedStepError` for a model that ends the run, or discards the step.
        """

    def save(self) -> bytes:
        """The whole state, serialised."""

    def restore(self, state: bytes) -> None:
        """Put back what `save` gave."""
