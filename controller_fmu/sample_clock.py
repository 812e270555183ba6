"""The controller's own sample clock, on a grid that does not drift."""

import math
from dataclasses import dataclass

TOLERANCE = 1e-6
"""Relative to a period: masters accumulate time, and some end with a step of 1e-13 s."""
ROUNDING = 1e-9
"""Relative to a time, for the same reason, where there is no period"""


@dataclass(slots=True)
class SampleClock:
    """Due times offset + k·period, k = 0, 1, …; a sample is taken at the first communication point from then on."""

    period: float
    """Period [s]; 0: every communication point from the offset on is a sample"""
    offset: float
    """Offset [s]"""
    next_index: int = 0
    """k of the next due time"""

    def start(self, t: float) -> None:
        """Begin at `t` [s]: due times before it are past."""
        if self.period > 0.0:
            self.next_index = max(0, math.ceil((t - self.offset) / self.period - TOLERANCE))

    def is_due(self, t: float) -> bool:
        """Whether a sample is due at the communication point `t` [s]; if so, the clock moves on to the next."""
        if self.period == 0.0:
            return t >= self.offset * (1.0 - ROUNDING)
        elapsed = (t - self.offset) / self.period + TOLERANCE
        if elapsed < self.next_index:
            return False
        self.next_index = math.floor(elapsed) + 1
        return True
