"""Search ranges of the quantities of `limit` that have names."""

import math

from orchestration.foundation.basics.bisection import Range
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.systems.system.distribution import highest


def range_of(timing: Timing, of: str) -> Range | None:
    """The search range of `period`, `delay`, `jitter` or `loss` with the rest of `timing` fixed; None: other names."""
    if of == "period":
        shortest = highest(timing.jitter) * timing.clock_ratio
        before = tuple(value for value in (0.001, 0.002, 0.003, 0.004) if value > shortest)
        first = 0.005 * (math.floor(shortest / 0.005) + 1)
        return Range(before=before, first=first, step=0.005, last=0.5, tolerance=0.0005)
    if of == "delay":
        return Range(first=0.0, step=0.005, last=0.5, tolerance=0.0005)
    if of == "jitter":
        return Range(first=0.0, step=timing.period / 10.0, last=0.999 * timing.period, tolerance=timing.period / 100.0)
    if of == "loss":
        length = timing.burst_length
        last = 1.0 if length is None else length / (length + 1.0)
        return Range(first=0.0, step=0.05, last=last, tolerance=0.01, unit=None)
    return None
