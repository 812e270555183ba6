"""The growth of small deviations of any system about its operating point, from saved states."""

import math

import numpy as np

from orchestration.fmi.reuse import Instances
from orchestration.stability.linearised_component import PULSE
from orchestration.stability.loop_at_rest import at_rest
from orchestration.stability.period_map import period_map
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS


def growth_of_loop(system: System, instances: Instances, pulse: float = PULSE) -> float:
    """The growth rate [1/s] of small deviations from the operating point of `system`; negative: they decay.

    Raises `UsageError` where the system does not rest there, or has no linear loop, saying why.
    """
    with at_rest(system, instances, pulse) as loop:
        radius = float(np.abs(np.linalg.eigvals(period_map(loop))).max(initial=0.0))
        return math.log(radius) / (float(loop.period) / NANOSECONDS) if radius > 0.0 else -math.inf
