"""A linear system in discrete time, and the controllable and observable part of a larger one."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from orchestration.foundation.basics.extras import explains_missing
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.processes.passable import passable

SAMPLES = (*range(32), 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024)
"""Samples of impulse responses, powers of two apart, as long as they stay small"""
LARGEST_RESPONSE = 1e6
"""Largest response, relative to the first"""
MINIMAL, ROUNDING = 1e-9, 1e-13
"""Shares of the largest singular value between inputs and outputs, each by its own unit: larger ones than the first are
states, smaller ones than the second count as 0; of those in between as many as make the response right"""
TURNS = np.linspace(0.05, 3.1, 8)
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
        sizes = f"{len(self.inputs)} inputs, {len(self.A)} states, {len(self.outputs)} outputs"
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
    """The controllable and observable part of a system, in balanced coordinates.

    By the singular values of the impulse responses (Ho and Kalman), over a finite time and scaled where they grow, so
    that the system need not be stable.
    """
    if not (B.any() and C.any()):
        return np.zeros((0, 0)), np.zeros((0, B.shape[1])), np.zeros((C.shape[0], 0))

    @cache
    def power(k: int) -> Floats:
        """A to a power of two."""
        return A if k == 1 else np.asarray(power(k // 2) @ power(k // 2))

    made, shown = _responses(power, B), _responses(lambda k: power(k).T, C.T)
    responses = np.concatenate([abs(C @ state).max(axis=1, keepdims=True) for state in made], axis=1).max(axis=1)
    weight = np.tile(np.where(responses > 0.0, responses, 1.0), len(shown))
    reachable, observable = np.hstack(made), np.hstack(shown).T / weight[:, None]
    (along, shows), (across, makes) = np.linalg.qr(observable), np.linalg.qr(reachable.T)
    left, values, right = np.linalg.svd(shows @ makes.T)  # no larger than A, however many signals and samples
    left, right = along @ left, right @ across.T
    whole = _response(A, B, C)
    fewest, most = (int((values > share * values[0]).sum()) for share in (MINIMAL, ROUNDING))
    for rank in range(fewest, most + 1):
        root = np.sqrt(values[:rank])
        back = reachable @ right[:rank].T / root
        onto = (left[:, :rank] / root).T @ observable
        found = onto @ A @ back, onto @ B, C @ back
        if (abs(_response(*found) - whole) <= RIGHT * abs(whole).max(axis=2, keepdims=True)).all():
            break
    return found


def _response(A: Floats, B: Floats, C: Floats) -> Any:
    """The outputs by the inputs at each of `TURNS`, shape (n, outputs, inputs)."""
    z = np.exp(1j * TURNS)[:, None, None]
    return C @ np.linalg.solve(z * np.eye(len(A)) - A, B.astype(complex)[None])


def _responses(power: Callable[[int], Floats], B: Floats) -> list[Floats]:
    """A^k B for k in `SAMPLES`, each column no larger than that of B: growth would hide all else behind rounding."""
    found, state = [B], B
    largest = np.maximum(np.abs(B).max(axis=0), np.finfo(float).tiny)
    for before, sample in pairwise(SAMPLES):
        state = power(sample - before) @ state
        if not np.abs(state).max() <= LARGEST_RESPONSE * np.abs(B).max():
            break
        found.append(state / np.maximum(1.0, np.abs(state).max(axis=0) / largest))
    return found
