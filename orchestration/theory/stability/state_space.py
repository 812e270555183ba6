"""A linear system in discrete time, and the controllable and observable part of a larger one."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import counted
from orchestration.foundation.processes.passable import passable

SAMPLES = (*range(32), 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024)
"""Samples of impulse responses that are tried first, powers of two apart, as long as they stay small"""
LARGEST_RESPONSE = 1e6
"""Largest response, relative to the first"""
SHARES = (1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
"""Shares of the largest singular value between inputs and outputs, each by its own unit: larger ones than the first are
states, smaller ones than the last count as 0; in between the first that makes the response right"""
TURNS = np.geomspace(1e-3, 3.1, 24)
"""Frequencies at which it has to be right, in radians per sample"""
RIGHT = 1e-5
"""Error of the response of an output, relative to its largest at that frequency: what models are measured to"""


@passable
@dataclass(frozen=True, kw_only=True)
class StateSpace:
    """Deviations from an operating point: x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k), every `dt` seconds."""

    A: Floats
    """States by the states of the sample before."""
    B: Floats
    """States by the inputs of the sample before."""
    C: Floats
    """Outputs by the states."""
    D: Floats
    """Outputs by the inputs of the same sample."""
    dt: float
    """Time from sample to sample [s]."""
    inputs: tuple[str, ...]
    """The entries of u, in the units of the FMU."""
    outputs: tuple[str, ...]
    """The entries of y."""

    def __repr__(self) -> str:
        counts = ((self.inputs, "input"), (self.A, "state"), (self.outputs, "output"))
        sizes = ", ".join(counted(len(each), what) for each, what in counts)
        return f"<StateSpace: {sizes}, every {self.dt:g} s>"

    @explains_missing
    def to_control(self) -> Any:
        """The same as a `StateSpace` of python-control, whose names have underscores for dots.

        Raises `QuadcosimError` where that is not installed.
        """
        import control

        inputs, outputs = ([name.replace(".", "_") for name in names] for names in (self.inputs, self.outputs))
        return control.ss(self.A, self.B, self.C, self.D, self.dt, inputs=inputs, outputs=outputs)


def reduced(A: Floats, B: Floats, C: Floats) -> tuple[Floats, Floats, Floats]:
    """The controllable and observable part of a system, in balanced coordinates; the system where none is right.

    By the singular values of the impulse responses (Ho and Kalman), over a finite time and scaled where they grow, so
    that the system need not be stable: at some samples, and at as many as it has states where these leave out too much,
    as of a delay over more samples.
    """
    if not (B.any() and C.any()):
        return np.zeros((0, 0)), np.zeros((0, B.shape[1])), np.zeros((C.shape[0], 0))
    at_turns, impulses = _response(A, B, C), _impulses(A, B, C, 2 * len(A), LARGEST_RESPONSE * np.abs(B).max())
    for samples in (SAMPLES, range(len(A))):
        for found in _reductions(A, B, C, samples):
            early = _impulses(*found, len(impulses))
            if _is_right(_response(*found), at_turns, axis=2) and _is_right(early, impulses, axis=(0, 2)):
                return found
    return A, B, C


def _reductions(A: Floats, B: Floats, C: Floats, samples: Sequence[int]) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Reductions by impulse responses at some samples, to more and more states."""

    @cache
    def power(k: int) -> Floats:
        """A to a power of two."""
        return A if k == 1 else np.asarray(power(k // 2) @ power(k // 2))

    made, shown = _responses(power, B, samples), _responses(lambda k: power(k).T, C.T, samples)
    responses = np.concatenate([abs(C @ state).max(axis=1, keepdims=True) for state in made], axis=1).max(axis=1)
    weight = np.tile(np.where(responses > 0.0, responses, 1.0), len(shown))
    reachable, observable = np.hstack(made), np.hstack(shown).T / weight[:, None]
    (along, shows), (across, makes) = np.linalg.qr(observable), np.linalg.qr(reachable.T)
    left, values, right = np.linalg.svd(shows @ makes.T)  # no larger than A, however many signals and samples
    left, right = along @ left, right @ across.T
    for rank in sorted({int((values > share * values[0]).sum()) for share in SHARES}):
        root = np.sqrt(values[:rank])
        back = reachable @ right[:rank].T / root
        onto = (left[:, :rank] / root).T @ observable
        yield onto @ A @ back, onto @ B, C @ back


def _is_right(found: Any, whole: Any, axis: int | tuple[int, ...]) -> bool:
    return bool((abs(found - whole) <= RIGHT * abs(whole).max(axis=axis, keepdims=True)).all())


def _impulses(A: Floats, B: Floats, C: Floats, count: int, largest: float = np.inf) -> Floats:
    """The first outputs after an impulse on each input, shape (n, outputs, inputs); n ends before large states."""
    found, state = [C @ B], B
    while len(found) < count and np.abs(state := A @ state).max() <= largest:
        found.append(C @ state)
    return np.array(found)


def _response(A: Floats, B: Floats, C: Floats) -> Any:
    """The outputs by the inputs at each of `TURNS`, shape (n, outputs, inputs)."""
    z = np.exp(1j * TURNS)[:, None, None]
    return C @ np.linalg.solve(z * np.eye(len(A)) - A, B.astype(complex)[None])


def _responses(power: Callable[[int], Floats], B: Floats, samples: Sequence[int]) -> list[Floats]:
    """A^k B for k in `samples`, each column no larger than that of B: growth would hide all else behind rounding."""
    found, state = [B], B
    largest = np.maximum(np.abs(B).max(axis=0), np.finfo(float).tiny)
    for before, sample in pairwise(samples):
        state = power(sample - before) @ state
        if not np.abs(state).max() <= LARGEST_RESPONSE * np.abs(B).max():
            break
        found.append(state / np.maximum(1.0, np.abs(state).max(axis=0) / largest))
    return found
