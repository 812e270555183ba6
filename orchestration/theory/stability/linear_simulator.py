"""Linear simulators, which a master steps in place of FMUs."""

from collections.abc import Sequence
from copy import copy
from typing import TypeVar

import numpy as np

from orchestration.foundation.basics.simulator import Floats, Transfer

S = TypeVar("S", bound="LinearSimulator")


class LinearSimulator:
    """A linear simulator that begins at rest: its state, and its exchange with a master."""

    def __init__(self, inputs: Sequence[str], outputs: Sequence[str], states: int) -> None:
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self.state: Floats = np.zeros(states)
        self.input: Floats = np.zeros(len(inputs))
        self.added: Floats = np.zeros(len(inputs))
        """the values added to its inputs, connected or not"""
        self.output: Floats = np.zeros(len(outputs))
        self.sample = 0
        """The number of the next sample, from a begin of the loop's period, of one whose samples differ"""

    def abreast(self: S, runs: int) -> S:
        """The same at rest, for some runs together: each number is a row of theirs."""
        other = copy(self)
        other.state, other.input, other.added, other.output = (
            np.zeros((len(x), runs)) for x in (self.state, self.input, self.added, self.output)
        )
        other.sample = 0
        return other

    def reader(self, names: Sequence[str], into: Floats) -> Transfer:
        """As `Simulator`; variables that are no Reals are not read."""
        chosen = [(i, self.outputs.index(name)) for i, name in enumerate(names) if name in self.outputs]
        to, places = [i for i, _ in chosen], [place for _, place in chosen]

        def read() -> None:
            into[to] = self.output[places]

        return read

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As `Simulator`; variables that are no Reals are not written."""
        chosen = [(i, self.inputs.index(name)) for i, name in enumerate(names) if name in self.inputs]
        of, places = [i for i, _ in chosen], [place for _, place in chosen]

        def write() -> None:
            self.input[places] = source[of]

        return write

    def enter_initialization(self, start: float, stop: float) -> None:
        """It is at rest already."""

    def exit_initialization(self) -> None:
        """It is at rest already."""

    def step(self, t: float, h: float) -> None:
        """As `Simulator`."""
        raise NotImplementedError

    def save(self) -> bytes:
        """State and inputs."""
        return np.concatenate([self.state, self.input]).tobytes()

    def restore(self, state: bytes) -> None:
        """Restore them."""
        self.state[:], self.input[:] = np.split(np.frombuffer(state), [len(self.state)])


class OpenPort(LinearSimulator):
    """Replaces a component: it outputs `sent` at its samples in a period, and keeps its inputs as `received`."""

    def __init__(self, inputs: Sequence[str], outputs: Sequence[str], samples: int = 1) -> None:
        super().__init__(inputs, outputs, states=0)
        self.sent: Floats = np.zeros(samples * len(outputs))
        self.received: Floats = np.zeros(samples * len(inputs))
        self._samples = samples

    def abreast(self, runs: int) -> "OpenPort":
        """As that of `LinearSimulator`."""
        other = super().abreast(runs)
        other.sent, other.received = (np.zeros((len(x), runs)) for x in (self.sent, self.received))
        return other

    def step(self, t: float, h: float) -> None:
        """As `Simulator`."""
        self.received.reshape(self._samples, *self.input.shape)[self.sample] = self.input
        self.output[:] = self.sent.reshape(self._samples, *self.output.shape)[self.sample]
        self.sample = (self.sample + 1) % self._samples
