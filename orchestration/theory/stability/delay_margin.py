"""The delay margin of a command: how much later it may come before the loop is unstable, in whole nanoseconds.

A delay by a part of a sample shifts the hold at a receiver in continuous time, and at a sampled one it acts in jumps,
where a message misses a sample. So the loop is made as late by such a part; whole samples are further states of it, or,
where all samples of a period are alike, a turn of the phase.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.number_text import quantity
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.model import System
from orchestration.theory.stability.lifted_margins import places
from orchestration.theory.stability.linearise import Linearised
from orchestration.theory.stability.loop_halves import loop_gains, radius, with_rest
from orchestration.theory.stability.sign_changes import root, sign_changes, zero_between
from orchestration.theory.stability.state_space import StateSpace, reduced

FARTHEST = 5.0
"""Longest delay of a command that is tried, in first estimates"""
PARTS = 4
"""Delays that are tried in a sample, where samples of a period differ"""
SIDES = (0.0, 1.0 / NANOSECONDS)
"""Delays beyond a jump [s]: none, and the next one"""
MOST_JUMPS = 40
"""Jumps in a sample, to both sides of which the loop is tried, at most"""


@dataclass(frozen=True, kw_only=True)
class Late:
    """The rest of a loop to which commands come later by less than a sample."""

    rest: Callable[[float], StateSpace]
    """The rest by that delay [s]"""
    jumps: Sequence[float] = ()
    """Delays at which a command comes just at a sample of its receiver, and misses it with more [s]"""


Crossover = tuple[float, float]
"""A frequency at which the loop gain is 1 [rad/s], and the delay by which its phase is that of -1 [s]"""


def delay_margin(loop: Linearised, i: int, crossovers: Sequence[Crossover], late: Late) -> float | None:
    """The least further delay of a command at which the loop becomes unstable [s].

    Where it becomes so in a jump, that is the longest one at which it is stable. `crossovers` are those of the command,
    without a further delay. None: no delay makes it unstable. Raises `UsageError` where it is not found.
    """
    if not crossovers:
        return None
    of = _of_one_rate if loop.samples == 1 else _of_several
    return of(loop, i, crossovers, late)


def crossover_at(frequency: float, gain: complex) -> Crossover:
    """A crossover, by its gain."""
    return frequency, _turn(gain) / frequency


def jumps_of(system: System, name: str) -> tuple[float, ...]:
    """The `jumps` of all that a sampled component sends, less than a sample, in rising order."""
    own, found = system.components[name].sampling, set[Fraction]()
    for x in system.connections:
        other = system.components[x.receiver].sampling if x.sender == name else None
        if own is None or other is None:
            continue
        ratio = other.true_period / own.true_period
        apart = own.true_period / ratio.denominator
        first = (other.true_offset - own.true_offset - exact_nanoseconds(lowest(x.delay))) % apart
        if ratio.denominator <= MOST_JUMPS:
            found.update(first + k * apart for k in range(ratio.denominator))
    return tuple(float(jump) / NANOSECONDS for jump in sorted(found))


def _of_one_rate(loop: Linearised, i: int, crossovers: Sequence[Crossover], late: Late) -> float:
    """Between the whole samples where the first crossover comes to -1: there its phase is followed over the delay."""
    dt = loop.dt
    least = min(delay for _, delay in crossovers)
    whole = math.floor(least / dt)
    near = [one for one in crossovers if one[1] < least + 2.0 * dt]

    def beyond(delay: float) -> float:
        rest = late.rest(_rounded(delay - whole * dt))
        return max(_beyond(loop, i, rest, one, delay, whole) for one in near)

    low, high = whole * dt, (whole + 1) * dt
    return zero_between(beyond, _rounded, (low, low - least), (high, high - least))[0]


def _beyond(loop: Linearised, i: int, rest: StateSpace, crossover: Crossover, delay: float, whole: int) -> float:
    """By how much a delay is beyond that at which a crossover, followed to a later rest, comes to -1 [s]."""
    dt, (at, expected) = loop.dt, crossover
    frequencies = np.linspace(0.8 * at, min(1.25 * at, math.pi / dt), 61)

    def gain(frequency: float) -> complex:
        return complex(loop_gains(loop, np.array([frequency]), i, rest)[i, 0])

    ends = sign_changes(frequencies, np.abs(loop_gains(loop, frequencies, i, rest)[i]) - 1.0)
    if not ends:
        return -2.0 * dt  # its gain is below 1 now
    nearest = min(ends, key=lambda pair: abs(sum(pair) / 2.0 - at))
    now = root(lambda w: abs(gain(w)) - 1.0, *nearest)
    left = _turn(gain(now) * np.exp(-1j * now * dt * whole)) / now
    whole_turn = 2.0 * math.pi / now
    return -left - whole_turn * round((expected - delay - left) / whole_turn)


def _of_several(loop: Linearised, i: int, crossovers: Sequence[Crossover], late: Late) -> float:
    """The first of a few delays in each sample at which the spectral radius is above 1, and the zero before it.

    They are those to both sides of each jump, too.
    """
    dt, known = loop.dt, dict[float, Linearised]()

    def beyond(delay: float) -> float:
        whole = math.floor(delay / dt + 0.5 / (NANOSECONDS * dt))
        part = max(0.0, _rounded(delay - whole * dt))
        if part not in known:
            known[part] = _with(loop, i, late.rest(part)) if part else loop
        return radius(_with_samples(known[part], i, whole)) - 1.0

    before = (0.0, loop.radius - 1.0)
    farthest = FARTHEST * min(delay for _, delay in crossovers) + dt
    steps = range(1, math.ceil(PARTS * farthest / dt) + 1)
    sides = (k * dt + jump + side for k in range(math.ceil(farthest / dt)) for jump in late.jumps for side in SIDES)
    for delay in sorted({_rounded(one) for one in (*(step * dt / PARTS for step in steps), *sides)} - {0.0}):
        now = delay, beyond(delay)
        if now[1] > 0.0:
            return zero_between(beyond, _rounded, before, now)[0]
        before = now
    raise UsageError(f"the loop is stable with all delays up to {quantity(before[0], 's')}, the longest that was tried")


def _rounded(delay: float) -> float:
    """A delay in whole nanoseconds."""
    return round(delay, 9)


def _turn(gain: complex) -> float:
    """The angle from -1 up to a gain, in a turn [rad]."""
    return float(np.angle(-gain)) % (2.0 * math.pi)


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
