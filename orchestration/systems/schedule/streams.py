"""Random numbers: one seed for a run, and a separate stream for every cause of every component and connection."""

import hashlib
from collections.abc import Mapping
from functools import lru_cache
from statistics import NormalDist

import numpy as np

JITTER, DELAY, DELAY_JITTER, LOSS, NOISE, VALUE = "jitter", "delay", "delay_jitter", "loss", "noise", "value"
EXECUTION, ARRIVALS, ERROR = "execution", "arrivals", "error"


class Streams:
    """The generators of one run, each from the seed and the name of its owner and cause.

    The key of `components.controller.jitter`, for instance, is the first four 32-bit words, big-endian, of the SHA-256
    of that name, so that adding a component or a cause changes no number of another. `numbered` has the streams
    with a whole number as key instead: those of the quadrotor from before there were names.
    """

    def __init__(self, seed: int, numbered: Mapping[str, int] | None = None) -> None:
        self.seed, self.numbered = seed, dict(numbered or {})

    def of(self, owner: str, cause: str) -> np.random.Generator:
        """A new generator at the start of the stream of a cause, `owner` as `components.NAME` or `connections.NAME`."""
        sequence = np.random.SeedSequence(self.seed, spawn_key=self.key(owner, cause))
        return np.random.Generator(np.random.PCG64(sequence))

    def key(self, owner: str, cause: str) -> tuple[int, ...]:
        """The key of that stream."""
        name = f"{owner}.{cause}"
        number = self.numbered.get(name)
        return (number,) if number is not None else _words(name)


@lru_cache(4096)  # they are common to the runs of a study
def _words(name: str) -> tuple[int, ...]:
    digest = hashlib.sha256(name.encode()).digest()
    return tuple(int.from_bytes(digest[i : i + 4], "big") for i in range(0, 16, 4))


NORMAL = NormalDist(0.5, 1.0 / 6.0)
LOWEST, HIGHEST = 0.0013498980316301035, 0.9986501019683699
"""`NORMAL.cdf` of 0 and 1, written down: versions of Python compute it by formulas that differ in the last digits."""


def cut_normal(uniform: float) -> float:
    """A normal variate around 0.5 with standard deviation 1/6, cut to [0, 1], from a uniform one."""
    return min(1.0, max(0.0, NORMAL.inv_cdf(LOWEST + uniform * (HIGHEST - LOWEST))))
