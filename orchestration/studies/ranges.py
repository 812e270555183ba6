"""Where a limit is looked for: the quantities, and how each is scanned."""

import math
from dataclasses import dataclass
from typing import Literal

from orchestration.scenario import Scenario

Quantity = Literal["period", "delay", "jitter", "loss"]


@dataclass(frozen=True, kw_only=True)
class Range:
    """How a quantity is scanned: `before`, then from `first` in steps to `last`; then bisected to `tolerance`."""

    before: tuple[float, ...] = ()
    first: float
    step: float
    last: float
    tolerance: float
    unit: str = " s"

    def values(self) -> list[float]:
        """The scan, upward."""
        count = math.floor((self.last - self.first) / self.step + 1e-9)
        steps = (float(f"{self.first + i * self.step:.12g}") for i in range(count + 1))
        return [*(value for value in self.before if value < self.first), *steps]


def range_of(scenario: Scenario, of: str) -> Range:
    """The range in which a quantity of this scenario is looked for."""
    period = scenario.timing.period
    if of == "period":
        shortest = scenario.timing.jitter * scenario.timing.clock_ratio
        before = tuple(value for value in (0.001, 0.002, 0.003, 0.004) if value > shortest)
        first = 0.005 * (math.floor(shortest / 0.005) + 1)
        return Range(before=before, first=first, step=0.005, last=0.5, tolerance=0.0005)
    if of == "delay":
        return Range(first=0.0, step=0.005, last=0.5, tolerance=0.0005)
    if of == "jitter":
        return Range(first=0.0, step=period / 10.0, last=0.999 * period, tolerance=period / 100.0)
    length = scenario.timing.burst_length
    return Range(first=0.0, step=0.05, last=1.0 if length is None else length / (length + 1.0), tolerance=0.01, unit="")
