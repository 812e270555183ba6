"""What happens when: the instants of one run, in integer nanoseconds.

Nothing here knows an FMU. Instant k of a period T with offset o is round(o + kT) from exact rationals,
never accumulated. Random numbers come from one seed with one stream for each cause, so that switching
one cause on leaves those of the others as they were.
"""

import math
from collections import deque
from collections.abc import Iterator
from fractions import Fraction
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from orchestration.timing import Timing, exact_nanoseconds, nanoseconds


class Grid:
    """The instants round(offset + k·period), k = 0, 1, …, in nanoseconds."""

    def __init__(self, offset: Fraction, period: Fraction) -> None:
        self._denominator = math.lcm(offset.denominator, period.denominator)
        self._offset = int(offset * self._denominator)
        self._period = int(period * self._denominator)

    def __getitem__(self, k: int) -> int:
        if self._denominator == 1:
            return self._offset + k * self._period
        return _round_ratio(self._offset + k * self._period, self._denominator)


def _round_ratio(numerator: int, denominator: int) -> int:
    """round(numerator / denominator), half to even, in integers."""
    quotient, rest = divmod(numerator, denominator)
    twice = 2 * rest
    return quotient + (twice > denominator or (twice == denominator and quotient % 2 == 1))


class Sample(NamedTuple):
    """One sampling instant of the controller."""

    k: int
    """its index"""
    time: int
    """true time [ns]"""
    next_time: int
    """true time of the sample after it [ns], also if that lies beyond the end"""
    measurement_lost: bool
    sent: int
    """when its command is computed and goes out [ns]"""
    arrival: int | None
    """when its command is applied [ns]; None: lost on the way"""


class Instant(NamedTuple):
    """A point at which the plant halts, and what happens there, in the order of the fields."""

    time: int
    """[ns]"""
    sample: Sample | None
    """the sample that is due"""
    arrivals: tuple[int, ...]
    """indices of the samples whose commands are applied, in order of sending: the last one stays"""


CAUSES = ("jitter", "delay_jitter", "measurement_loss", "command_loss", "noise")
"""Each has its own stream; new causes go to the end, so that the streams of the others stay."""


def random_streams(seed: int) -> dict[str, np.random.Generator]:
    """One generator for each cause, from one seed."""
    children = np.random.SeedSequence(seed).spawn(len(CAUSES))
    return {cause: np.random.Generator(np.random.PCG64(child)) for cause, child in zip(CAUSES, children, strict=True)}


class Clock(Iterator[Instant]):
    """The instants of one run over [0, stop], in order; its state can be saved and put back at any point.

    The plant's own grid, every sampling instant, every arrival and the end are instants; at the end the
    controller does not sample.
    """

    def __init__(self, timing: Timing, stop_time: float, streams: dict[str, np.random.Generator]) -> None:
        self._timing = timing
        self._streams = streams
        self.stop = nanoseconds(stop_time)
        ratio = Fraction(repr(float(timing.clock_ratio)))
        self._samples = Grid(exact_nanoseconds(timing.offset) / ratio, exact_nanoseconds(timing.period) / ratio)
        self._points = Grid(Fraction(0), exact_nanoseconds(timing.plant_interval))
        self._delay = nanoseconds(timing.delay)
        self._queue: deque[tuple[int, int]] = deque()  # (arrival, index), in order
        self._last_arrival = 0
        self._in_burst: dict[str, bool] = {}
        self._point = 0
        self._index = 0
        self._finished = False
        self._sample_time = self._jittered(0)
        self._next = self._draw()

    def __next__(self) -> Instant:
        if self._finished:
            raise StopIteration
        sample, queue, time = self._next, self._queue, self.next_time()
        if time == self._points[self._point]:
            self._point += 1
        due = None
        if time == self.stop:
            self._finished = True
        elif time == sample.time:
            due = sample
            if due.arrival is not None:
                queue.append((due.arrival, due.k))
            self._next = self._draw()
        if not (queue and queue[0][0] == time):
            return Instant(time, due, ())
        arrivals = []
        while queue and queue[0][0] == time:
            arrivals.append(queue.popleft()[1])
        return Instant(time, due, tuple(arrivals))

    def next_time(self) -> int:
        """The time of the instant that comes next [ns]."""
        time = min(self._points[self._point], self._next.time, self.stop)
        return min(time, self._queue[0][0]) if self._queue else time

    def state(self) -> dict[str, Any]:
        """All that the instants to come depend on beside the timing, in JSON types."""
        return {
            "queue": list(self._queue),
            "last_arrival": self._last_arrival,
            "in_burst": dict(self._in_burst),
            "point": self._point,
            "index": self._index,
            "finished": self._finished,
            "sample_time": self._sample_time,
            "next": self._next._asdict(),
            "streams": {cause: stream.bit_generator.state for cause, stream in self._streams.items()},
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Continue where `state` was taken."""
        self._queue = deque((arrival, index) for arrival, index in state["queue"])
        self._last_arrival = state["last_arrival"]
        self._in_burst = dict(state["in_burst"])
        self._point = state["point"]
        self._index = state["index"]
        self._finished = state["finished"]
        self._sample_time = state["sample_time"]
        self._next = Sample(**state["next"])
        for cause, stream in self._streams.items():
            stream.bit_generator.state = state["streams"][cause]

    def _draw(self) -> Sample:
        """The next sample, everything about it decided."""
        index, time = self._index, self._sample_time
        self._index += 1
        self._sample_time = self._jittered(self._index)
        measurement_lost = self._lost("measurement_loss")
        command_lost = self._lost("command_loss")
        sent = time if self._timing.order == "gauss-seidel" else self._sample_time
        late = self._late("delay_jitter", self._timing.delay_jitter)
        arrival = None
        if not command_lost:  # commands never overtake
            self._last_arrival = arrival = max(sent + self._delay + late, self._last_arrival)
        return Sample(index, time, self._sample_time, measurement_lost, sent, arrival)

    def _jittered(self, index: int) -> int:
        return self._samples[index] + self._late("jitter", self._timing.jitter)

    def _late(self, cause: str, largest: float) -> int:
        """A random lateness [ns] in [0, largest]."""
        if largest == 0.0:
            return 0
        share = self._streams[cause].random()
        if self._timing.jitter_distribution == "normal":
            share = _cut_normal(share)
        return math.floor(share * nanoseconds(largest))

    def _lost(self, cause: str) -> bool:
        probability = getattr(self._timing, cause)
        if probability == 0.0:
            return False
        mean_length, draw = self._timing.burst_length, self._streams[cause].random()
        if mean_length is None or probability == 1.0:
            return bool(draw < probability)
        before = self._in_burst.get(cause)
        if before is None:  # the chain starts in its stationary distribution
            lost = draw < probability
        elif before:
            lost = draw >= 1.0 / mean_length
        else:
            lost = draw < probability / (mean_length * (1.0 - probability))
        self._in_burst[cause] = bool(lost)
        return bool(lost)


_NORMAL = NormalDist(0.5, 1.0 / 6.0)
_LOWEST, _HIGHEST = 0.0013498980316301035, 0.9986501019683699
"""`_NORMAL.cdf` of 0 and 1, written down: versions of Python compute it by formulas that differ in the last digits."""


def _cut_normal(uniform: float) -> float:
    """A normal variate around 0.5 with standard deviation 1/6, cut to [0, 1], from a uniform one."""
    return min(1.0, max(0.0, _NORMAL.inv_cdf(_LOWEST + uniform * (_HIGHEST - _LOWEST))))
