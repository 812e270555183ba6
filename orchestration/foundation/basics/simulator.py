"""The protocol between the master and a simulator: an FMU behind an adapter, or a stub in a test."""

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Integers: TypeAlias = npt.NDArray[np.int64]
Booleans: TypeAlias = npt.NDArray[np.bool_]
Transfer: TypeAlias = Callable[[], None]
"""Copies values between a simulator and the array that it was created for."""


class Simulator(Protocol):
    """A model that is stepped; every call raises `SimulatorError` if the model refuses it."""

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """A function that reads the variables `names` into the contiguous array `into`, one element each."""

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """A function that sets the variables `names` from the array `source`."""

    def enter_initialization(self, start: float, stop: float) -> None:
        """Begin initialisation of a run over [start, stop] seconds; `stop` may be infinite."""

    def exit_initialization(self) -> None:
        """End initialisation; from here on the simulator can be stepped."""

    def step(self, t: float, h: float) -> None:
        """Advance from `t` to `t + h` seconds with the inputs held.

        Raises `StoppedStepError` for a model that ends the run, or discards the step.
        """

    def save(self) -> bytes:
        """The whole state, serialised."""

    def restore(self, state: bytes) -> None:
        """Restore a state returned by `save`."""


@runtime_checkable
class Differentiable(Protocol):
    """A simulator that may know derivatives."""

    def slopes(self, outputs: Sequence[str], inputs: Sequence[str]) -> Floats | None:
        """d(outputs)/d(inputs) where it is, a row for each output; None: it does not know them."""
