"""The growth of the difference of two runs, one of them perturbed by a short pulse: for FMUs without saved states, too.

Both begin at the operating point, without jitter, loss, noise and quantisation. The pulse is added to every Real input
of every component until its first step is done. While the difference is small it follows a linear law, the same for
every period of the loop; that law is fitted to the exchanged signals, by the singular values of their delayed values
(dynamic mode decomposition), and its largest eigenvalue is the growth.
"""

import math
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from orchestration.components.fmi.instance import Instance, Loader
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.simulator import Floats, Transfer
from orchestration.foundation.basics.times import NANOSECONDS, exact_nanoseconds
from orchestration.simulation.runs.prepared import PreparedRun, prepared
from orchestration.systems.system.distribution import highest
from orchestration.systems.system.model import System
from orchestration.theory.stability import operating_point
from orchestration.theory.stability.excitation import PULSE
from orchestration.theory.stability.in_double import expect_same_law
from orchestration.theory.stability.loop_at_rest import (
    KnownTangents,
    start_of,
    tracing_loader,
    wrapping_loader,
    written_in,
)
from orchestration.theory.stability.periodic_schedule import common_period

LARGE, SMALL = 1e3, 1e-7
"""Factors on the initial difference: sizes between which it is followed, linear and above rounding"""
FEWEST_INSTANTS, MOST_INSTANTS = 100, 400
"""instants of a run at which the twins are compared"""
LONGEST_SCHEDULE = 100
"""Longest repetition of a schedule, in longest periods: a run compares a hundred of them"""
DELAYS = 24
"""values of each signal over which the law is fitted, in addition to those in transit"""
NOISE = 1e-9
"""Share of the largest singular value: smaller ones are taken for noise"""
SHORTEST = 8
"""instants to which a law is fitted; over fewer the growth is that from the first to the last"""
_NOTHING, _TOO_MUCH = 1e-6, 1e3
"""Factors on the difference at the end: smaller modes are ignored, larger ones taken for errors of the fit"""


@dataclass(frozen=True, kw_only=True)
class Growth:
    """The growth of small deviations from an operating point."""

    rate: float
    """Rate of their logarithm [1/s]; negative: they decay"""
    horizon: float
    """Duration of the two runs [s]"""


def growth_of(system: System, instances: Instances, factor: float = 1.0, known: KnownTangents | None = None) -> Growth:
    """The growth about the operating point of `system`; raises `UsageError` where the system does not rest there.

    `factor` is that of the pulse. Where one has come to rest that runs to rest is kept in `known`.
    """
    nominal = operating_point.deterministic(system)
    period = repeating_period(nominal) or operating_point.longest_period(nominal)
    horizon = max(exact_nanoseconds(nominal.stop_time), FEWEST_INSTANTS * period)
    nominal = replace(nominal, stop_time=float(horizon) / NANOSECONDS)
    interval = period * max(1, math.floor(horizon / period / MOST_INSTANTS))
    start = start_of(nominal, period, instances, KnownTangents() if known is None else known)
    load = tracing_loader(instances, start)
    unperturbed = _exchanged_rows(
        nominal, load, interval, lambda run: expect_same_law(nominal, instances, written_in(run))
    )
    perturbed = _exchanged_rows(
        nominal, wrapping_loader(load, lambda fmu: Pulsed(fmu, factor)), interval, lambda run: None
    )
    operating_point.expect_rest(nominal, unperturbed[1:6], unperturbed[:1])
    count = min(len(unperturbed), len(perturbed))
    scale = np.maximum(1.0, np.abs(unperturbed[0]))
    difference = (perturbed[:count] - unperturbed[:count]) / scale
    size = np.abs(difference).max(axis=1)
    if not size.any():
        raise UsageError("a pulse on the inputs changes no exchanged signal")
    begin = 2  # the pulse is over
    initial = float(size[: begin + 1].max())
    ends = np.flatnonzero((size[begin:] > LARGE * initial) | (size[begin:] < SMALL * initial))
    end = begin + int(ends[0]) if len(ends) else count
    seconds = float(interval) / NANOSECONDS
    window = difference[begin:end]
    rounding = float(np.finfo(float).eps * (np.abs(unperturbed[begin:end]) / scale).max(initial=0.0))
    delays = DELAYS + math.ceil(max((highest(x.delay) for x in nominal.connections), default=0.0) / seconds)
    fitted = _rate(window, delays, rounding) if len(window) >= SHORTEST else None
    rate = _between(size, begin, min(end, count - 1)) if fitted is None else fitted
    return Growth(rate=rate / seconds, horizon=nominal.stop_time)


def repeating_period(nominal: System) -> Fraction | None:
    """After how long the periods of a system and the schedule of its computers and networks repeat [ns].

    None: they are not known to, within `LONGEST_SCHEDULE`.
    """
    with suppress(UsageError):
        return common_period(nominal, LONGEST_SCHEDULE)
    return None


def _rate(window: Floats, delays: int, rounding: float) -> float | None:
    """The logarithm of the largest eigenvalue of the linear law of rows, shape (n, signals), up to rounding.

    Only modes count that are present in the last row, and no larger there than the row; None: there are none.
    """
    delays = min(delays, len(window) // 3)
    stacked = np.stack([window[i : len(window) - delays + i + 1].ravel(order="C") for i in range(delays)])
    stacked = stacked.reshape(delays, -1, window.shape[1]).transpose(0, 2, 1).reshape(delays * window.shape[1], -1)
    left, values, right = np.linalg.svd(stacked[:, :-1], full_matrices=False)
    noise = max(NOISE, 100.0 * rounding / float(np.abs(window).max()))
    kept = values > noise * values[0]
    left, values, right = left[:, kept], values[kept], right[kept]
    law = left.T @ stacked[:, 1:] @ right.T / values
    eigenvalues, modes = np.linalg.eig(law)
    shares = np.linalg.lstsq(modes, (left.T @ stacked[:, 0]).astype(complex), rcond=None)[0]
    with np.errstate(over="ignore"):
        at_end = np.abs(shares) * np.abs(eigenvalues) ** (stacked.shape[1] - 1)
    final = float(np.linalg.norm(left.T @ stacked[:, -1]))
    present = (at_end > _NOTHING * final) & (at_end < _TOO_MUCH * final)
    return math.log(float(np.abs(eigenvalues[present]).max())) if present.any() else None


def _between(size: Floats, begin: int, end: int) -> float:
    """The mean growth of the logarithm from one instant to another, of a difference soon too large or too small."""
    if size[begin] == 0.0 or size[end] == 0.0 or end <= begin:
        return -math.inf
    return math.log(float(size[end] / size[begin])) / (end - begin)


def _exchanged_rows(
    system: System, load: Loader, interval: Fraction, afterwards: Callable[[PreparedRun], None]
) -> Floats:
    """The exchanged signals at each compared instant, shape (n, signals)."""
    with prepared(system, load=load) as simulation:
        simulation.master.initialise()
        simulation.master.run()
        result = simulation.result()
        afterwards(simulation)
    times = np.round(result.rows[:, 0] * NANOSECONDS).astype(np.int64)
    count = math.floor(Fraction(int(times[-1])) / interval)  # at the stop itself nothing samples
    instants = [math.floor(operating_point.latest_offset(system) + k * interval) + 1 for k in range(count)]
    rows = np.searchsorted(times, instants, side="right") - 1
    columns = [result.columns.index(name) for name in operating_point.exchanged_signals(system)]
    return result.rows[rows][:, columns]


class Pulsed:
    """An FMU to whose Real inputs a pulse is added until its first step is done."""

    def __init__(self, fmu: Instance, factor: float) -> None:
        self._fmu, self._pulse = fmu, PULSE * factor
        self._stepped = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._fmu, name)

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As `Simulator`."""
        perturbed: Floats = np.zeros(len(names))
        write = self._fmu.writer(names, perturbed)
        real = [self._fmu.model.variables[name].kind == "Real" for name in names]
        pulse = np.array([self._pulse * _weight(name) if is_real else 0.0 for name, is_real in zip(names, real)])

        def transfer() -> None:
            perturbed[:] = source
            if not self._stepped:
                perturbed[:] += pulse * np.maximum(1.0, np.abs(source))
            write()

        return transfer

    def step(self, t: float, h: float) -> None:
        """As `Simulator`."""
        self._fmu.step(t, h)
        self._stepped = True


def _weight(name: str) -> float:
    """Between 0.5 and 1.5, different for each input, so that none cancel."""
    return 0.5 + zlib.crc32(name.encode()) / 2**32
