"""Margins of a loop whose rates meet in a period: of the command at all of its samples, by the poles of the whole.

A command has N samples in a period, and its loop N gains at each frequency, the eigenvalues of a matrix. Where samples
do not differ they are the gain of the one loop at frequencies that are whole numbers of turns in a period apart: so
each belongs to the frequency that its eigenvector has most of, up to half the sampling rate of the command.
"""

import math

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.stability.linearise import NEAR_ONE, Linearised
from orchestration.theory.stability.loop_halves import closed, places, radius, sensitivity_of
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.sign_changes import root

FACTORS = np.geomspace(1.0, 1e4, 401)[1:]
"""Factors on a command that are tried, and their inverses"""
TURNS = np.linspace(0.0, math.pi, 361)[1:]
"""Turns of the phase of a command that are tried [rad]"""


def lifted_gains(loop: Linearised, i: int, frequencies: Floats) -> tuple[Complexes, float]:
    """The gain of the loop of a command at each frequency, shape (n,), and the largest gain of its sensitivity.

    That is by the norm of a signal over all samples. Both follow from the closed loop: beside whole turns in a period
    rounding would decide on what the halves have, by poles of 1, as of a position.
    """
    sensitivity = sensitivity_of(loop, i, frequencies)
    values, vectors = np.linalg.eig(sensitivity)
    harmonic = np.exp(-1j * np.outer(frequencies * loop.dt, np.arange(loop.samples)))
    chosen = np.abs(np.einsum("nj,njk->nk", harmonic, vectors)).argmax(axis=1)
    of_chosen = np.take_along_axis(values, chosen[:, None], axis=1)[:, 0]
    return np.asarray(1.0 / of_chosen - 1.0, dtype=complex), float(np.linalg.norm(sensitivity, 2, axis=(1, 2)).max())


def gain_margins(loop: Linearised, i: int) -> list[tuple[float, float]]:
    """The nearest factors below and above 1 on all samples of a command beyond which the loop is unstable.

    Each with its frequency [rad/s]; a missing one: none is known.
    """
    found = []
    for factors in (1.0 / FACTORS, FACTORS):
        before = 1.0
        for factor in map(float, factors):
            if radius_with(loop, i, factor) > 1.0 + NEAR_ONE:
                at = root(lambda value: radius_with(loop, i, value) - 1.0, before, factor)
                found.append((at, abs(_frequency_of(loop, i, at))))
                break
            before = factor
    return found


def phase_margin(loop: Linearised, i: int) -> tuple[float, float] | None:
    """The least turn of the phase of a command at which the loop becomes unstable [rad], and the frequency [rad/s].

    Negative: it is ahead. None: no turn makes it unstable.
    """
    for turn in TURNS:
        if radius_with(loop, i, np.exp(-1j * turn)) > 1.0 + NEAR_ONE:
            at = root(lambda value: radius_with(loop, i, np.exp(-1j * value)) - 1.0, turn - TURNS[0], turn)
            frequency = _frequency_of(loop, i, np.exp(-1j * at))
            return math.copysign(at, frequency), abs(frequency)
    return None


def radius_with(loop: Linearised, i: int, factor: complex) -> float:
    """The spectral radius with a factor on all samples of a command."""
    return radius(loop, _factors(loop, i, factor))


def _factors(loop: Linearised, i: int, factor: complex) -> Complexes:
    factors = np.ones(len(loop.component.outputs), dtype=complex)
    factors[places(loop, i)] = factor
    return factors.real if factor.imag == 0.0 else factors


def _frequency_of(loop: Linearised, i: int, factor: complex) -> float:
    """The frequency [rad/s] of the motion that decays least, of a command with a factor."""
    whole = closed(loop, _factors(loop, i, factor))
    poles, vectors = np.linalg.eig(whole.A)
    least = int(np.abs(poles).argmax())
    command = (whole.commands @ vectors[:, least])[places(loop, i)]
    turns = np.arange(loop.samples) - loop.samples // 2
    at = (np.angle(poles[least]) + 2.0 * math.pi * turns) / loop.rest.dt
    content = np.abs(np.exp(-1j * np.outer(at, np.arange(loop.samples)) * loop.dt) @ command)
    return float(at[content.argmax()])
