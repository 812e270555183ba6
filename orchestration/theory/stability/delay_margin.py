"""The delay margin of a command: how much later it may come before the loop is unstable, in whole nanoseconds.

A delay by a part of a sample shifts the hold at a receiver in continuous time, and at a sampled one it acts in jumps,
where a message misses a sample. So the loop is made as late by such a part; whole samples are further states of it, or
whole periods where the samples are uneven. A
loop tolerates a further delay d of all samples for certain where, with its complementary sensitivity T over them and
the frequencies W that they consist of, d σ(T W) < 1 (a small gain): so far the next delay is not tried.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.model import System
from orchestration.theory.stability.linearise import Linearised
from orchestration.theory.stability.loop_halves import Sensitivity, places, radius, sensitivity_of, with_rest
from orchestration.theory.stability.operating_point import hyperperiod
from orchestration.theory.stability.periodic_schedule import PeriodicSchedule, periodic_schedule
from orchestration.theory.stability.poles import Complexes
from orchestration.theory.stability.sign_changes import zero_between
from orchestration.theory.stability.state_space import StateSpace, reduced

SAFE = 0.75
"""Share of a delay that is tolerated for certain, after which the next one is tried"""
PARTS, FINEST = 8, 32
"""Delays that are tried in a sample, and where less is tolerated for certain"""
STILL = 1e-8
"""Growth rate that counts as 0 [1/s]"""
MOST = 500
"""Delays that are tried, at most"""
REFINED = 16
"""Times that frequencies are halved where the return difference changes by more than its own size, in any direction"""
SIDES = (0.0, 1.0 / NANOSECONDS)
"""Delays beyond a jump [s]: none, and the next one"""
RESOLVED = 1e-6
"""Least gain of a sensitivity, in any direction, of which rounding leaves the inverse in all others: where it is less
the loop has too much gain to be near the end of its stability"""
MOST_VALUES = 2_000_000
"""Numbers that return differences at all frequencies consist of, at most"""
MOST_JUMPS = 40
"""Jumps in a sample, to both sides of which the loop is tried, at most"""


@dataclass(frozen=True, kw_only=True)
class Late:
    """The rest of a loop to which commands come later by less than a turn."""

    rest: Callable[[float], StateSpace]
    """The rest by that delay [s]"""
    jumps: Sequence[float] = ()
    """Delays at which a command comes just at a sample of its receiver, and misses it with more [s]"""
    turn: int = 1
    """Samples after which they come at even times: more than 1 where a schedule makes samples or latencies vary"""


def delay_margin(loop: Linearised, i: int, frequencies: Floats, late: Late) -> float | None:
    """The least further delay of a command at which the loop becomes unstable [s].

    Where it becomes so in a jump, that is the longest one at which it is stable. `frequencies` go up to half the rate
    of the period [rad/s]. None: no delay makes it unstable. Raises `UsageError` where it is not found.
    """
    of = sensitivity_of(loop, i)
    soon = of(frequencies)
    resolved = np.linalg.svd(soon, compute_uv=False).min(axis=1) > RESOLVED
    command = LateCommand(loop, i, frequencies[resolved], late, sensitivities={0.0: of}, soon={0.0: soon[resolved]})
    parts = np.arange(PARTS * late.turn) * loop.dt / PARTS
    if not any(command.ends_stability(part) for part in (*parts, *command.sides)):
        return None
    delay, before = 0.0, (0.0, command.growth(0.0))
    for _ in range(MOST):
        certain = SAFE * command.tolerated(delay)
        if certain >= loop.dt:
            delay = _rounded(delay + math.floor(certain / loop.dt) * loop.dt)
            continue
        delay = command.next(delay, certain)
        now = delay, command.growth(delay)
        if now[1] > 0.0:
            return zero_between(command.growth, _rounded, before, now, zero=STILL)[0]
        before = now
    raise UsageError(f"the loop is stable with all delays up to {quantity(delay, 's')}, the longest that was tried")


def jumps_of(system: System, name: str) -> tuple[float, ...]:
    """The `jumps` of all that a sampled component sends, less than a turn, in rising order."""
    own, found = system.components[name].sampling, set[Fraction]()
    for x in system.connections:
        apart = apart_of(system, x) if x.sender == name else None
        if own is None or apart is None or own.true_period * len(apart.delays) / apart.interval > MOST_JUMPS:
            continue
        count = max(1, int(own.true_period / apart.interval))
        least = ((each - exact_nanoseconds(lowest(x.delay))) % apart.interval for each in apart.delays)
        found.update(each + k * apart.interval for each in least for k in range(count))
    return tuple(float(jump) / NANOSECONDS for jump in sorted(found))


class Apart(NamedTuple):
    """Delays of a connection at which a message comes just at a sample of its receiver [ns]."""

    delays: Sequence[Fraction]
    interval: Fraction


def apart_of(system: System, connection: Connection) -> Apart | None:
    """Those of a connection; None where its ends are not both sampled, or it releases its receiver."""
    own, other = (system.components[end].sampling for end in (connection.sender, connection.receiver))
    if own is None or other is None:
        return None
    if not system.uses_scheduler:
        interval = own.true_period / (other.true_period / own.true_period).denominator
        return Apart([(other.true_offset - own.true_offset) % interval], interval)
    schedule = periodic_schedule(system)
    if connection.name in schedule.with_own_delay:
        return None
    whole = hyperperiod([own.true_period, other.true_period, NANOSECONDS * schedule.period])
    sent, received = (_instants(schedule, end, system, whole) for end in (connection.sender, connection.receiver))
    late = schedule.transit_times.get(connection.name, (0,))
    arrivals = [each + (late[k % len(late)] or 0) for k, each in enumerate(sent)]
    return Apart(sorted({(then - now) % whole for now in arrivals for then in received}), whole)


def _instants(schedule: PeriodicSchedule, name: str, system: System, whole: Fraction) -> list[Fraction]:
    """The times in a hyperperiod at which a component samples, in order [ns]."""
    sampling = system.components[name].sampling
    assert sampling is not None
    period, offsets = sampling.true_period, [sampling.true_offset]
    if name in schedule.samples:
        period, offsets = NANOSECONDS * schedule.period, [NANOSECONDS * each for each in schedule.samples[name]]
    return [each + k * period for k in range(int(whole / period)) for each in offsets]


@dataclass(frozen=True)
class LateCommand:
    """A loop, one command of which comes later."""

    loop: Linearised
    i: int
    frequencies: Floats
    late: Late
    known: dict[float, Linearised] = field(default_factory=dict)
    """The loop, by the part of a sample by which the command is late"""
    sensitivities: dict[float, Sensitivity] = field(default_factory=dict)
    """The sensitivity of that command over its samples"""
    soon: dict[float, Complexes] = field(default_factory=dict)
    """Its values at the frequencies"""

    @property
    def sides(self) -> list[float]:
        """The delays to both sides of each jump, less than a turn [s]."""
        sides = {_rounded(jump + side) for jump in self.late.jumps for side in SIDES}
        return sorted(side for side in sides if side < self._turn)

    @property
    def _turn(self) -> float:
        return self.late.turn * self.loop.dt

    def growth(self, delay: float) -> float:
        """The growth rate of small deviations [1/s]."""
        whole, part = self._split(delay)
        found = radius(_with_samples(self._late_by(part), self.i, whole))
        return math.log(max(found, np.finfo(float).tiny)) / self.loop.rest.dt

    def next(self, delay: float, most: float) -> float:
        """The next delay that is tried: nearer than `most` where that is less than the usual interval."""
        dt = self.loop.dt
        interval = dt / (PARTS if most >= dt / PARTS else FINEST)
        usual = (math.floor(max(delay + most, delay + interval) / interval + 0.01)) * interval
        whole = math.floor(delay / self._turn) * self._turn
        sides = (_rounded(begin + side) for begin in (whole, whole + self._turn) for side in self.sides)
        return min((_rounded(usual), *(side for side in sides if side > delay)))

    def tolerated(self, delay: float) -> float:
        """The further delay that is tolerated for certain [s]."""
        samples, dt = self.loop.samples, self.loop.dt
        frequencies, difference = self._fine(delay)
        turns = np.arange(samples) - samples // 2
        at = np.add.outer(frequencies, 2.0 * math.pi * turns / self.loop.rest.dt)
        at = np.abs((at + math.pi / dt) % (2.0 * math.pi / dt) - math.pi / dt)
        waves = np.exp(1j * np.outer(np.arange(samples), 2.0 * math.pi * turns / samples)) / math.sqrt(samples)
        waves = waves * np.exp(1j * np.outer(frequencies * dt, np.arange(samples)))[:, :, None]
        moved = (np.eye(samples) - np.linalg.inv(difference)) @ waves * at[:, None, :]
        return float(1.0 / max(np.linalg.norm(moved, 2, axis=(1, 2)).max(), np.finfo(float).tiny))

    def ends_stability(self, part: float) -> bool:
        """Whether enough whole samples beside a part of one make the loop unstable: its gain is somewhere above 1."""
        samples = self.loop.samples
        gains = np.linalg.inv(self._soon(_rounded(part))) - np.eye(samples)
        shifts = (self._shift(whole, self.frequencies) for whole in range(0, samples, self.late.turn))
        each = (np.linalg.eigvals(gains @ shift) for shift in shifts)
        return any(bool(np.abs(values).max() > 1.0) for values in each)

    def _fine(self, delay: float) -> tuple[Floats, Complexes]:
        """Frequencies, so close that the return difference is not near 0 between two of them, and it at each."""
        whole, part = self._split(delay)
        frequencies = self.frequencies
        difference = self._difference(self._soon(part), whole, frequencies)
        for _ in range(REFINED):
            inverse, change = np.linalg.inv(difference), np.diff(difference, axis=0)
            relative = (np.linalg.norm(end @ change, axis=(1, 2)) for end in (inverse[:-1], inverse[1:]))
            apart = np.maximum(*relative) > 1.0
            if not apart.any():
                break
            if difference.size > MOST_VALUES:
                raise UsageError("the return difference of the loop changes too fast over the frequency to be followed")
            between = 0.5 * (frequencies[:-1] + frequencies[1:])[apart]
            added = self._difference(self._sensitivity(part)(between), whole, between)
            order = np.argsort(frequencies := np.append(frequencies, between))
            frequencies, difference = frequencies[order], np.concatenate([difference, added])[order]
        return frequencies, difference

    def _difference(self, soon: Complexes, whole: int, frequencies: Floats) -> Complexes:
        """The return difference over the samples, of the loop whose sensitivity without the whole ones is `soon`."""
        one = np.eye(self.loop.samples)
        return np.asarray(one + (np.linalg.inv(soon) - one) @ self._shift(whole, frequencies))

    def _shift(self, whole: int, frequencies: Floats) -> Complexes:
        """A delay by whole samples at each frequency, shape (n, samples, samples)."""
        samples = self.loop.samples
        z = np.exp(1j * frequencies * self.loop.rest.dt)
        found = np.zeros((len(z), samples, samples), dtype=complex)
        for sample in range(samples):
            periods, place = divmod(sample - whole, samples)
            found[:, sample, place] = z**periods
        return found

    def _late_by(self, part: float) -> Linearised:
        if part not in self.known:
            self.known[part] = _with(self.loop, self.i, self.late.rest(part)) if part else self.loop
        return self.known[part]

    def _soon(self, part: float) -> Complexes:
        if part not in self.soon:
            self.soon[part] = self._sensitivity(part)(self.frequencies)
        return self.soon[part]

    def _sensitivity(self, part: float) -> Sensitivity:
        if part not in self.sensitivities:
            self.sensitivities[part] = sensitivity_of(self._late_by(part), self.i)
        return self.sensitivities[part]

    def _split(self, delay: float) -> tuple[int, float]:
        """Whole samples, in whole turns, and what is left [s]."""
        whole = self.late.turn * math.floor(delay / self._turn + 0.5 / (NANOSECONDS * self._turn))
        return whole, max(0.0, _rounded(delay - whole * self.loop.dt))


def _rounded(delay: float) -> float:
    """A delay in whole nanoseconds."""
    return round(delay, 9)


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
