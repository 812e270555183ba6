"""The poles of a loop over a period: without what is forgotten, and as those of a loop in continuous time."""

import cmath
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.processes.passable import passable

NO_RANK = 1e-10
"""Singular value, as a share of the largest, of what a period forgets, each state in a unit of its own"""
BALANCINGS = 60
"""Most rounds in which these units are chosen"""
DRIFT = 1e-9
"""Distance of a pole from 1 at which it has neither damping nor a direction"""
REAL = 1e-6
"""Imaginary part up to which a pole is real in words: rounding splits a double one by the root of a float's digits"""

Complexes = npt.NDArray[np.complex128]


@passable
@dataclass(frozen=True, kw_only=True)
class Pole:
    """A pole z of a sampled loop, and that of continuous time, s = log(z) / dt."""

    z: complex
    """The pole in the z-plane."""
    frequency: float
    """Natural frequency |s| [rad/s]; of an aperiodic motion the rate of its decay or growth."""
    damping: float | None
    """Damping ratio -Re(s) / |s|: 1 aperiodic, 0 undamped, below 0 growing; None: s = 0."""


def as_poles(found: Complexes, dt: float) -> tuple[Pole, ...]:
    """Poles of the z-plane, of samples `dt` [s] apart, with frequency and damping."""
    return tuple(_as_pole(complex(z), dt) for z in found)


def _as_pole(z: complex, dt: float) -> Pole:
    is_drift = abs(z - 1.0) < DRIFT
    s = 0j if is_drift else cmath.log(z) / dt
    damping = None if is_drift else -s.real / abs(s)
    return Pole(z=z, frequency=abs(s), damping=damping)


def in_words(z: complex) -> str:
    """A pole of the z-plane, with its conjugate."""
    size = abs(z.imag)
    digits = ".4f" if size >= 1e-4 else ".2g"
    return f"{round(z.real, 4) + 0.0:.4f}" + (f" ± {size:{digits}}j" if size > REAL else "")


def or_alias(turn: float | None) -> str:
    """What is said behind the frequency of a pole over several rates, whole turns [rad/s] from which it may be."""
    return f" or an alias by {turn:.4g} rad/s" if turn else ""


def poles_of(matrix: Floats) -> Complexes:
    """The eigenvalues of a matrix without those at 0, which rounding would scatter where they are multiple."""
    matrix, _ = balanced(matrix)
    while len(matrix):
        left, sizes, _ = np.linalg.svd(matrix)
        rank = int((sizes > NO_RANK * max(1.0, float(sizes[0]))).sum())
        if rank == len(matrix):
            break
        matrix = left[:, :rank].T @ matrix @ left[:, :rank]
    found: Complexes = np.linalg.eigvals(matrix).astype(complex)
    return found[np.argsort(-np.abs(found), kind="stable")]


def balanced(matrix: Floats) -> tuple[Floats, Floats]:
    """The same map with states in units in which each moves others as much as they move it, and these powers of two."""
    units = np.ones(len(matrix))
    for _ in range(BALANCINGS):
        others = np.abs(matrix - np.diag(np.diag(matrix)))
        moved, moves = others.sum(axis=1), others.sum(axis=0)
        has_both = (moved > 0.0) & (moves > 0.0)
        ratio = np.divide(moves, moved, where=has_both, out=np.ones(len(matrix)))
        unit = 2.0 ** np.round(0.25 * np.log2(ratio))  # half the way, as all change at once
        if (unit == 1.0).all():
            break
        matrix, units = matrix * unit[:, None] / unit, units * unit
    return matrix, units
