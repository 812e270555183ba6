"""What the controller is told: the plant's outputs with noise, rounded, or the last ones that arrived."""

from collections.abc import Mapping, Sequence

import numpy as np

from orchestration.errors import UsageError
from orchestration.simulator import Floats
from orchestration.timing import Timing


class Sensors:
    """Turns the true measurement into the one received; the plant itself is untouched."""

    def __init__(self, names: Sequence[str], timing: Timing, stream: np.random.Generator) -> None:
        self._sigma = expand("noise", timing.noise, names)
        self._quantum = expand("quantisation", timing.quantisation, names)
        self._noisy = bool(self._sigma.any())
        self._rounded = np.flatnonzero(self._quantum)
        self._quantum = self._quantum[self._rounded]
        self._noise: Floats = np.zeros(len(names))
        self._stream = stream

    def receive(self, true: Floats, received: Floats, *, lost: bool = False) -> None:
        """Write what arrives of `true` into `received`, nothing if it is `lost`; one value a measurement."""
        if self._noisy:  # drawn for each measurement of each sample, so that nothing shifts another's numbers
            self._stream.standard_normal(out=self._noise)
        if lost:
            return
        received[:] = true
        if self._noisy:
            self._noise *= self._sigma
            received += self._noise
        if len(self._rounded):
            multiples = received[self._rounded] / self._quantum
            np.rint(multiples, out=multiples)
            received[self._rounded] = multiples * self._quantum


def expand(what: str, values: Mapping[str, float], names: Sequence[str]) -> Floats:
    """One value for each of `names`, 0 where none is given; a vector's name stands for its components.

    Raises `UsageError` for a name that is no measurement.
    """
    result = np.zeros(len(names))
    for given, value in values.items():
        places = [i for i, name in enumerate(names) if name == given or name.rpartition(".")[0] == given]
        if not places:
            vectors = dict.fromkeys(name.rpartition(".")[0] for name in names)
            raise UsageError(f"timing.{what}: {given} is no measurement; expected one of {', '.join(vectors)}")
        result[places] = value
    return result
