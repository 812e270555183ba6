"""The varying delay that a linear loop certainly tolerates, and one by which it becomes unstable.

The loop: a plant dx = A x + B u in continuous time, its state sampled every `period`, the command u = F x held from its
arrival to the next. A command from the sample at t arrives at t + d + δ, with any δ in [0, J], different for each.

Certainly tolerated: C.-Y. Kao, B. Lincoln, Simple stability criteria for systems with time-varying delays, Automatica
40 (2004) 1429-1434, theorem 3, a small-gain bound, here for several commands that travel together, with singular values
in place of magnitudes: stable for every sequence of δ if, with N = J/T, g its fractional part and n its whole one,

    σ( S [F P(j(ω + 2πk)/T)]_k ) < 1 / (Ñ |e^jω - 1|) for all ω in (0, π],    Ñ² = n² + 2 n g + g,

P = (sI - A)⁻¹ B, S the sensitivity of the sampled loop with the delay d, and all the aliases k side by side.
"""

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orchestration.foundation.basics.bisection import first_failure
from orchestration.foundation.basics.simulator import Floats

Complexes = npt.NDArray[np.complex128]
Held = Callable[[float], tuple[Floats, Floats]]
"""The state after a duration [s], by the state and the held command before"""

FREQUENCIES = 800
"""Frequencies at which the bound is evaluated, from `LOWEST` to π by period"""
LOWEST = 1e-4
POORLY_DAMPED = 0.1
"""poles whose distance from the unit circle is less, relative to their angle: peaks too narrow for these frequencies"""
AROUND = 40
"""frequencies to each side of such a peak"""
ALIASES = 40
"""Aliases to each side; those beyond are B/(jω), whose sum is known"""
LONGEST_PATTERN = 4
"""samples after which the tried sequences of delays repeat"""
SCAN = 16
"""values of the jitter at which each of them is tried, before the first unstable one is bisected"""
_INSTANT = 1e-9
"""Share of a period that counts as an instant"""


@dataclass(frozen=True, kw_only=True)
class SampledLoop:
    """A linear loop; `delay` and `period` in seconds, F of shape (commands, states)."""

    A: Floats
    B: Floats
    F: Floats
    period: float
    delay: float = 0.0

    def held(self, duration: float) -> tuple[Floats, Floats]:
        """The state after `duration` [s], by the state and the held command before."""
        n, m = self.B.shape
        from scipy.linalg import expm

        block = expm(np.block([[self.A, self.B], [np.zeros((m, n + m))]]) * duration)
        return block[:n, :n], block[:n, n:]


def certain_jitter(loop: SampledLoop) -> float:
    """J [s] up to which no sequence of delays in [d, d + J] makes the loop unstable: sufficient, not necessary.

    0 for a loop that is unstable without jitter.
    """
    poles = np.linalg.eigvals(turn_of(loop.held, loop.F, loop.period, loop.delay))
    if np.abs(poles).max() >= 1.0:
        return 0.0
    omega = np.concatenate([np.geomspace(LOWEST, math.pi, FREQUENCIES), *map(_around, poles)])
    largest = float((np.abs(np.exp(1j * omega) - 1.0) * _gains(loop, omega)).max())
    return loop.period * _periods(1.0 / largest)


def _around(pole: complex) -> Floats:
    """Frequencies around the peak that a poorly damped pole makes, up to as far as others are; else none."""
    angle, distance = abs(float(np.angle(pole))), 1.0 - abs(pole)
    far = 0.5 * POORLY_DAMPED * angle
    if distance >= 2.0 * far:
        return np.zeros(0)
    off = np.geomspace(0.1 * distance, far, AROUND)
    omega: Floats = np.concatenate([angle - off, [angle], angle + off])
    return omega[omega <= math.pi]


def _gains(loop: SampledLoop, omega: Floats) -> Floats:
    """The singular values on the left-hand side of the bound, at frequencies in 1 by period."""
    identity, T = np.eye(len(loop.F)), loop.period
    aliased = omega[:, None] + 2.0 * math.pi * np.arange(-ALIASES, ALIASES + 1)
    each = _response(loop, aliased / T)
    power = (each @ each.conj().swapaxes(-1, -2)).sum(axis=1)
    beyond = 2.0 * (T / (2.0 * math.pi)) ** 2 / (ALIASES + 0.5)  # Σ 1/ω² of the aliases left out
    power += beyond * (loop.F @ loop.B) @ (loop.F @ loop.B).T
    sensitivity = np.linalg.inv(identity - _sampled_response(loop, omega))
    whole = sensitivity @ power @ sensitivity.conj().swapaxes(-1, -2)
    return np.asarray(np.sqrt(np.linalg.norm(whole, 2, axis=(-2, -1))))


def _response(loop: SampledLoop, omega: Floats) -> Complexes:
    """F P(jω), at frequencies in rad/s."""
    n = len(loop.A)
    return loop.F @ np.linalg.solve(
        1j * omega[..., None, None] * np.eye(n) - loop.A, np.broadcast_to(loop.B + 0j, (*omega.shape, *loop.B.shape))
    )


def _sampled_response(loop: SampledLoop, omega: Floats) -> Complexes:
    """F P of the plant behind the hold and the delay d."""
    late = math.floor(loop.delay / loop.period + _INSTANT)
    rest = max(loop.delay - late * loop.period, 0.0)
    (whole, _), (after, newer), (_, older) = (loop.held(t) for t in (loop.period, loop.period - rest, rest))
    z: Complexes = np.exp(1j * omega)[:, None, None]
    drive: Complexes = z**-late * (newer + after @ older / z)
    return loop.F @ np.linalg.solve(z * np.eye(len(whole)) - whole + 0j, drive)


def _periods(bound: float) -> float:
    """The N whose Ñ is `bound`."""
    whole = math.floor(bound)
    return whole + (bound**2 - whole**2) / (2 * whole + 1)


def breaking_jitter(loop: SampledLoop, limit: float) -> tuple[float, tuple[float, ...]] | None:
    """The least J [s] found up to `limit` that makes the loop unstable, and the shares of J of the delays in turn.

    Sequences of delays, each d or d + J, repeat after at most `LONGEST_PATTERN` samples. None: none makes it unstable.
    """
    best, found = limit, None
    for pattern in patterns(LONGEST_PATTERN):
        rising = [best * i / SCAN for i in range(SCAN + 1)]
        fails = functools.partial(_fails, loop, pattern)
        bracket = first_failure(fails, rising, 1e-4 * loop.period)
        if bracket is not None:
            best, found = bracket.bad, pattern
    return None if found is None else (best, tuple(map(float, found)))


def _fails(loop: SampledLoop, pattern: Sequence[int], jitter: float) -> bool:
    return jitter > 0.0 and _radius(loop, [jitter * share for share in pattern]) >= 1.0


def patterns(longest: int) -> Iterator[tuple[int, ...]]:
    """Sequences of zeros and ones that repeat, none a rotation of another or a repetition of a shorter one."""
    for length in range(1, longest + 1):
        for pattern in itertools.product((0, 1), repeat=length):
            turns = [pattern[i:] + pattern[:i] for i in range(length)]
            if any(pattern) and pattern == max(turns) and turns.count(pattern) == 1:
                yield pattern


def _radius(loop: SampledLoop, late: Sequence[float]) -> float:
    """The spectral radius over one turn of delays d + `late` [s]."""
    return float(np.abs(np.linalg.eigvals(turn_of(loop.held, loop.F, loop.period, loop.delay, late))).max())


def turn_of(held: Held, F: Floats, T: float, delay: float, late: Sequence[float] = (0.0,)) -> Floats:
    """The map over one turn of delays `delay` + `late` [s], one by sample: arrivals never overtake each other.

    It is of the state and of the commands sent before, the newest first.
    """
    (m, n), count = F.shape, len(late)
    oldest = math.ceil((delay + max(late)) / T - _INSTANT) + 1  # commands before this sample's that may matter
    arrival = [k * T + delay + late[k % count] for k in range(-oldest, count)]
    arrival = np.maximum.accumulate(arrival).tolist()
    held = functools.cache(held)  # the same few, turn after turn
    total = np.eye(n + m * oldest)
    for k in range(count):
        x, cursor = np.eye(n, n + m * oldest), k * T
        sent = [np.hstack([F, np.zeros((m, m * oldest))])]  # of sample k, then k - 1, …
        sent += [np.eye(m, n + m * oldest, n + m * i) for i in range(oldest)]
        end = (k + 1) * T
        for at, acting in _pieces(arrival, k, oldest, cursor, end, T):
            A, B = held(round(at - cursor, 13))
            x, cursor = A @ x + B @ sent[acting], at
        total = np.vstack([x, *sent[:oldest]]) @ total
    return total


def _pieces(arrival: list[float], k: int, oldest: int, begin: float, end: float, T: float) -> list[tuple[float, int]]:
    """The ends of the pieces of a period with one command each, and its age in samples."""
    pieces: list[tuple[float, int]] = []
    for age in range(oldest, -1, -1):
        until = end if age == 0 else min(max(arrival[k - age + 1 + oldest], begin), end)
        if until > (pieces[-1][0] if pieces else begin) + _INSTANT * T:
            pieces.append((until, age))
    return pieces
