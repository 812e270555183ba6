"""How the difference of two runs grows, one of which a short pulse has struck: for any system, whatever its FMUs save.

Both begin at the operating point, without jitter, loss, noise and quantisation. The pulse is added to every Real input
of every component until its first step is done. While the difference is small it follows a linear law, the same for
every period of the loop; that law is fitted to what is exchanged, by the singular values of its delayed values
(dynamic mode decomposition), and its largest eigenvalue is the growth.
"""

import math
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np

from orchestration.basics.errors import UsageError
from orchestration.basics.simulator import Floats, Transfer
from orchestration.fmi.instance import Instance, Loader
from orchestration.fmi.reuse import Instances
from orchestration.runs.prepared import prepared
from orchestration.stability.operating_point import (
    common_period,
    deterministic,
    exchanged,
    expect_rest,
    latest_offset,
    longest_period,
)
from orchestration.system.distribution import highest
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS, exact_nanoseconds

PULSE = 1e-6
"""of an input: of its value, or absolute where that is smaller than 1"""
LARGE, SMALL = 1e3, 1e-7
"""of what the pulse has made: sizes between which the difference is followed, linear and above what rounding leaves"""
FEWEST, MOST = 100, 400
"""instants of a run at which the twins are compared"""
DELAYS = 24
"""values of each signal that the law is fitted over, beside those that are on their way"""
NOISE = 1e-9
"""of the largest singular value: what is smaller is taken for noise"""
SHORTEST = 8
"""instants that a law is fitted to; over fewer the growth is that from the first to the last"""
_NOTHING, _TOO_MUCH = 1e-6, 1e3
"""of the difference at the end: a mode that is smaller is taken for none, a larger one for an error of the fit"""


@dataclass(frozen=True, kw_only=True)
class Growth:
    """How what is small about an operating point grows."""

    rate: float
    """[1/s], of its logarithm; negative: it decays"""
    horizon: float
    """[s] of the two runs"""


def growth_of(system: System, instances: Instances) -> Growth:
    """The growth about the operating point of `system`; raises `UsageError` where the system does not rest there."""
    nominal = deterministic(system)
    period = common_period(nominal) or longest_period(nominal)
    horizon = max(exact_nanoseconds(nominal.stop_time), FEWEST * period)
    nominal = replace(nominal, stop_time=float(horizon) / NANOSECONDS)
    interval = period * max(1, math.floor(horizon / period / MOST))
    calm, struck = (_exchanged(nominal, load, interval) for load in (instances.load, _striking(instances)))
    expect_rest(nominal, calm[1:6])
    count = min(len(calm), len(struck))
    scale = np.maximum(1.0, np.abs(calm[0]))
    difference = (struck[:count] - calm[:count]) / scale
    size = np.abs(difference).max(axis=1)
    if not size.any():
        raise UsageError("a pulse on the inputs moves nothing that is exchanged")
    begin = 2  # the pulse is over
    made = float(size[: begin + 1].max())
    ends = np.flatnonzero((size[begin:] > LARGE * made) | (size[begin:] < SMALL * made))
    end = begin + int(ends[0]) if len(ends) else count
    seconds = float(interval) / NANOSECONDS
    window = difference[begin:end]
    rounding = float(np.finfo(float).eps * (np.abs(calm[begin:end]) / scale).max(initial=0.0))
    delays = DELAYS + math.ceil(max((highest(x.delay) for x in nominal.connections), default=0.0) / seconds)
    fitted = _rate(window, delays, rounding) if len(window) >= SHORTEST else None
    rate = _between(size, begin, min(end, count - 1)) if fitted is None else fitted
    return Growth(rate=rate / seconds, horizon=nominal.stop_time)


def _rate(window: Floats, delays: int, rounding: float) -> float | None:
    """The logarithm of the largest eigenvalue of the linear law that rows, shape (n, signals), follow but for rounding.

    Of the law's modes those count that are seen at the end, and are no larger there than what is seen; None: none is.
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
    seen = float(np.linalg.norm(left.T @ stacked[:, -1]))
    present = (at_end > _NOTHING * seen) & (at_end < _TOO_MUCH * seen)
    return math.log(float(np.abs(eigenvalues[present]).max())) if present.any() else None


def _between(size: Floats, begin: int, end: int) -> float:
    """The mean growth of the logarithm from one instant to another, of what is soon too large or too small."""
    if size[begin] == 0.0 or size[end] == 0.0 or end <= begin:
        return -math.inf
    return math.log(float(size[end] / size[begin])) / (end - begin)


def _exchanged(system: System, load: Loader, interval: Fraction) -> Floats:
    """What connections carry at each instant that is compared, shape (n, signals)."""
    with prepared(system, load=load) as simulation:
        simulation.master.initialise()
        simulation.master.run()
        result = simulation.result()
    times = np.round(result.rows[:, 0] * NANOSECONDS).astype(np.int64)
    count = math.floor(Fraction(int(times[-1])) / interval)  # at the stop itself nobody samples
    instants = [math.floor(latest_offset(system) + k * interval) + 1 for k in range(count)]
    rows = np.searchsorted(times, instants, side="right") - 1
    columns = [result.columns.index(name) for name in exchanged(system)]
    found: Floats = result.rows[rows][:, columns]
    return found


def _striking(instances: Instances) -> Loader:
    @contextmanager
    def load(path: Path, instance_name: str) -> Iterator[Instance]:
        with instances.load(path, instance_name) as fmu:
            yield cast(Instance, Pulsed(fmu))

    return load


class Pulsed:
    """An FMU whose Real inputs get a pulse on top until its first step is done."""

    def __init__(self, fmu: Instance) -> None:
        self._fmu = fmu
        self._stepped = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._fmu, name)

    def writer(self, names: Sequence[str], source: Floats) -> Transfer:
        """As `Simulator`."""
        given: Floats = np.zeros(len(names))
        write = self._fmu.writer(names, given)
        real = [self._fmu.model.variables[name].kind == "Real" for name in names]
        pulse = np.array([PULSE * _weight(name) if is_real else 0.0 for name, is_real in zip(names, real)])

        def transfer() -> None:
            given[:] = source
            if not self._stepped:
                given[:] += pulse * np.maximum(1.0, np.abs(source))
            write()

        return transfer

    def step(self, t: float, h: float) -> None:
        """As `Simulator`."""
        self._fmu.step(t, h)
        self._stepped = True


def _weight(name: str) -> float:
    """Between 0.5 and 1.5, another for each input: no two of them cancel."""
    return 0.5 + zlib.crc32(name.encode()) / 2**32
