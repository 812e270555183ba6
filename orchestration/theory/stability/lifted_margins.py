"""Margins of a command at all of its samples in a period, by the gains of its loop with the others closed.

A command has N samples in a period, and its loop N gains at each frequency, the eigenvalues of a matrix: a factor on
the command, or a turn of it, makes the loop unstable where it brings one of them to -1. Where samples do not differ
they are the gain of the one loop at frequencies that are whole numbers of turns in a period apart: so each belongs to
the frequency that its eigenvector has most of, up to half the sampling rate of the command.
"""

import math
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.stability.linearise import Linearised
from orchestration.theory.stability.loop_halves import Sensitivity, places, radius, sensitivity_of
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.sign_changes import roots

LEAST = 1e-6
"""Least factor that is a gain margin, and the inverse of the largest"""
PROVED = 1e-3
"""Relative distance from a gain margin at which the loop is stable on one side and unstable on the other"""
PASSED = 1e-6
"""Size of a part of a sensitivity that counts as 0"""


def lifted_gains(loop: Linearised, i: int, frequencies: Floats) -> tuple[Complexes, float]:
    """The gain of the loop of a command at each frequency, shape (n,), and the largest gain of its sensitivity.

    That is by the norm of a signal over all samples. Both follow from the closed loop: beside whole turns in a period
    rounding would decide on what the halves have, by poles of 1, as of a position.
    """
    sensitivity = sensitivity_of(loop, i)(frequencies)
    values, vectors = np.linalg.eig(sensitivity)
    harmonic = np.exp(-1j * np.outer(frequencies * loop.dt, np.arange(loop.samples)))
    chosen = np.abs(np.einsum("nj,njk->nk", harmonic, vectors)).argmax(axis=1)
    of_chosen = np.take_along_axis(values, chosen[:, None], axis=1)[:, 0]
    return np.asarray(1.0 / of_chosen - 1.0, dtype=complex), float(np.linalg.norm(sensitivity, 2, axis=(1, 2)).max())


def gain_margins(loop: Linearised, i: int, frequencies: Floats) -> list[tuple[float, float]]:
    """The nearest factors below and above 1 on all samples of a command beyond which the loop is unstable.

    Each with its frequency [rad/s]; a missing one: none is known. `frequencies` go up to half the rate of the period.
    """
    of = sensitivity_of(loop, i)
    ends = ((w, s) for w in (0.0, math.pi / loop.rest.dt) for s in _values(of, w) if abs(s.imag) < PASSED)
    found = [(float((s / (s - 1.0)).real), w, s) for w, s in [*ends, *_passing(of, frequencies, np.imag)] if _counts(s)]
    nearest = sorted((one for one in found if one[0] > 0.0), key=lambda one: abs(math.log(one[0])))
    margins = list[tuple[float, float]]()
    for side in (-1.0, 1.0):
        of_side = (one for one in nearest if side * (one[0] - 1.0) > 0.0)
        for factor, w, s in islice((one for one in of_side if _ends_stability(loop, i, one[0])), 1):
            margins.append((factor, abs(_frequency_of(loop, of, w, s))))
    return margins


def phase_margin(loop: Linearised, i: int, frequencies: Floats) -> tuple[float, float] | None:
    """The least turn of the phase of a command at which the loop becomes unstable [rad], and the frequency [rad/s].

    Negative: it is ahead. None: no turn makes it unstable. `frequencies` go up to half the rate of the period.
    """
    of = sensitivity_of(loop, i)
    found = [(float(np.angle(1.0 - 1.0 / s)), w, s) for w, s in _passing(of, frequencies, lambda s: s.real - 0.5)]
    if not found:
        return None
    turn, w, s = min(found, key=lambda one: abs(one[0]))
    frequency = _frequency_of(loop, of, w, s)
    return math.copysign(1.0, frequency) * turn, abs(frequency)


def _passing(of: Sensitivity, frequencies: Floats, part: Callable[[Any], Any]) -> Iterator[tuple[float, complex]]:
    """Frequencies at which a part of a sensitivity, an eigenvalue over all samples, passes 0, with that sensitivity."""
    values = np.linalg.eigvals(of(frequencies))
    before, after = values[:-1], values[1:]
    nearest = np.abs(after[:, None, :] - before[:, :, None]).argmin(axis=2)
    after = np.take_along_axis(after, nearest, axis=1)
    place, which = np.nonzero((part(before) * part(after) < 0.0) & _counts(before))
    if not len(place):
        return
    low, high = frequencies[place], frequencies[place + 1]
    start, change = before[place, which], after[place, which] - before[place, which]

    def at(w: Floats) -> Complexes:
        """Each on its course between two frequencies."""
        values, expected = np.linalg.eigvals(of(w)), start + (w - low) / (high - low) * change
        chosen = np.abs(values - expected[:, None]).argmin(axis=1)
        return np.asarray(np.take_along_axis(values, chosen[:, None], axis=1)[:, 0])

    passed = roots(lambda w: part(at(w)), low, high)
    for w, sensitivity in zip(passed.tolist(), at(passed).tolist()):
        if abs(part(sensitivity)) < PASSED:
            yield w, sensitivity


def _counts(sensitivity: Any) -> Any:
    """Whether the factor that takes its gain to -1 is no smaller than `LEAST`, and no larger than the inverse."""
    return (np.abs(sensitivity) > LEAST) & (np.abs(sensitivity - 1.0) > LEAST)


def _values(of: Sensitivity, frequency: float) -> Complexes:
    return np.asarray(np.linalg.eigvals(of(np.array([frequency]))[0]))


def _ends_stability(loop: Linearised, i: int, factor: float) -> bool:
    """Whether the loop is stable with a factor on one command that is a little nearer to 1, and not beyond."""
    away = math.copysign(PROVED, factor - 1.0)
    return _radius_with(loop, i, factor * (1.0 - away)) < 1.0 <= _radius_with(loop, i, factor * (1.0 + away))


def _radius_with(loop: Linearised, i: int, factor: float) -> float:
    factors = np.ones(len(loop.component.outputs))
    factors[places(loop, i)] = factor
    return radius(loop, factors)


def _frequency_of(loop: Linearised, of: Sensitivity, w: float, sensitivity: complex) -> float:
    """That of which a command has most [rad/s], with whole turns in a period, negative if it turns backward."""
    values, vectors = np.linalg.eig(of(np.array([w]))[0])
    command = vectors[:, np.abs(values - sensitivity).argmin()]
    at = w + 2.0 * math.pi / loop.rest.dt * (np.arange(loop.samples) - loop.samples // 2)
    content = np.abs(np.exp(-1j * np.outer(at, np.arange(loop.samples)) * loop.dt) @ command)
    return float(at[content.argmax()])
