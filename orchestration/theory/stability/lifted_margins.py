"""Margins of a loop whose rates meet in a period: of the command at all of its samples, by the poles of the whole.

A command has N samples in a period, and its loop N gains at each frequency, the eigenvalues of a matrix. Where samples
do not differ they are the gain of the one loop at frequencies that are whole numbers of turns in a period apart: so
each belongs to the frequency that its eigenvector has most of, up to half the sampling rate of the command.
"""

import math
from collections.abc import Callable

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats, Integers
from orchestration.theory.stability.linearise import NEAR_ONE, Linearised
from orchestration.theory.stability.loop_halves import closed, radius, response, with_rest
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.root_locus import zero_between
from orchestration.theory.stability.state_space import StateSpace, reduced

FACTORS = np.geomspace(1.0, 1e4, 401)[1:]
"""Factors on a command that are tried, and their inverses"""
TURNS = np.linspace(0.0, math.pi, 361)[1:]
"""Turns of the phase of a command that are tried [rad]"""
FARTHEST = 3.0
"""Longest delay of a command that is tried, in first estimates"""
WHOLE = 1e-6
"""Part of a sample that counts as none"""
HALVINGS = 50


def lifted_gains(loop: Linearised, i: int, frequencies: Floats) -> tuple[Complexes, float]:
    """The gain of the loop of a command at each frequency, shape (n,), and the largest gain of its sensitivity.

    That is by the norm of a signal over all samples.
    """
    z = np.exp(1j * frequencies * loop.rest.dt)
    back = -response(loop.component, z) @ response(loop.rest, z)
    own = places(loop, i)
    others = np.setdiff1d(np.arange(back.shape[1]), own)
    through = np.linalg.solve(np.eye(len(others)) + back[:, others][:, :, others], back[:, others][:, :, own])
    of_command = back[:, own][:, :, own] - back[:, own][:, :, others] @ through
    values, vectors = np.linalg.eig(of_command)
    harmonic = np.exp(-1j * np.outer(frequencies * loop.dt, np.arange(loop.samples)))
    chosen = np.abs(np.einsum("nj,njk->nk", harmonic, vectors)).argmax(axis=1)
    peak = np.linalg.norm(np.linalg.inv(np.eye(len(own)) + of_command), 2, axis=(1, 2)).max()
    return np.take_along_axis(values, chosen[:, None], axis=1)[:, 0], float(peak)


def places(loop: Linearised, i: int) -> Integers:
    """The places of a command at its samples, among those of all."""
    count = len(loop.component.outputs) // loop.samples
    return i + count * np.arange(loop.samples)


def gain_margins(loop: Linearised, i: int) -> list[tuple[float, float]]:
    """The nearest factors below and above 1 on all samples of a command beyond which the loop is unstable.

    Each with its frequency [rad/s]; a missing one: none is known.
    """
    found = []
    for factors in (1.0 / FACTORS, FACTORS):
        before = 1.0
        for factor in map(float, factors):
            if radius_with(loop, i, factor) > 1.0 + NEAR_ONE:
                at = _halved(lambda value: radius_with(loop, i, value) > 1.0, before, factor)
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
            at = _halved(lambda value: radius_with(loop, i, np.exp(-1j * value)) > 1.0, turn - TURNS[0], turn)
            frequency = _frequency_of(loop, i, np.exp(-1j * at))
            return math.copysign(at, frequency), abs(frequency)
    return None


def delay_margin(loop: Linearised, i: int, estimate: float, late: Callable[[float], StateSpace]) -> float:
    """The least further delay of a command at which the loop becomes unstable [s].

    `late` is the rest of the loop with such a delay; it is asked for parts of a sample. Raises `UsageError` where the
    loop is stable beyond three times the `estimate` [s].
    """

    def beyond(delay: float) -> float:
        whole = math.floor(delay / loop.dt + WHOLE)
        part = max(0.0, round(delay - whole * loop.dt, 9))
        part_late = loop if part == 0.0 else _with(loop, i, late(part))
        return radius(_with_samples(part_late, i, whole)) - 1.0

    before = (0.0, loop.radius - 1.0)
    for sample in range(1, math.ceil(FARTHEST * estimate / loop.dt) + 2):
        now = sample * loop.dt, beyond(sample * loop.dt)
        if now[1] > 0.0:
            return zero_between(beyond, lambda value: round(value, 9), before, now)
        before = now
    raise UsageError(f"{loop.component.outputs[i]}: its delay margin near {estimate:.4g} s cannot be computed")


def radius_with(loop: Linearised, i: int, factor: complex) -> float:
    """The spectral radius with a factor on all samples of a command."""
    return radius(loop, _factors(loop, i, factor))


def _with(loop: Linearised, i: int, late: StateSpace) -> Linearised:
    """The loop in which a command reaches the rest as it reaches `late`."""
    own, rest = places(loop, i), loop.rest
    count = len(rest.A)
    others = np.setdiff1d(np.arange(rest.B.shape[1]), own)
    A = np.block([[rest.A, np.zeros((count, len(late.A)))], [np.zeros((len(late.A), count)), late.A]])
    B, D = np.zeros((len(A), rest.B.shape[1])), rest.D.copy()
    B[:count, others], B[count:, own], D[:, own] = rest.B[:, others], late.B[:, own], late.D[:, own]
    return with_rest(loop, *reduced(A, B, np.hstack([rest.C, late.C])), D)


def _with_samples(loop: Linearised, i: int, late: int) -> Linearised:
    """The loop in which a command is late by whole samples: its last ones are further states."""
    own, rest, samples = places(loop, i), loop.rest, loop.samples
    given = np.eye(late + samples)  # the last ones before the period, and those of it
    sent, kept = given[:samples], given[samples:]
    B, D = rest.B.copy(), rest.D.copy()
    B[:, own], D[:, own] = rest.B[:, own] @ sent[:, late:], rest.D[:, own] @ sent[:, late:]
    further = np.zeros((late, B.shape[1]))
    further[:, own] = kept[:, late:]
    A = np.block([[rest.A, rest.B[:, own] @ sent[:, :late]], [np.zeros((late, len(rest.A))), kept[:, :late]]])
    return with_rest(loop, A, np.vstack([B, further]), np.hstack([rest.C, rest.D[:, own] @ sent[:, :late]]), D)


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


def _halved(fails: Callable[[float], bool], good: float, bad: float) -> float:
    for _ in range(HALVINGS):
        middle = 0.5 * (good + bad)
        good, bad = (good, middle) if fails(middle) else (middle, bad)
    return 0.5 * (good + bad)
