"""The growth of small deviations of any system about its operating point, from saved states."""

import math

import numpy as np

from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.times import NANOSECONDS
from orchestration.systems.system.model import System
from orchestration.theory.stability.linearised_component import PULSE
from orchestration.theory.stability.loop_at_rest import at_rest
from orchestration.theory.stability.period_map import period_map


def growth_of_loop(system: System, instances: Instances, pulse: float = PULSE) -> float:
    """The growth rate [1/s] of small deviations from the operating point of `system`; negative: they decay.

    Raises `UsageError` where the system does not rest there, or has no linear loop, saying why.
    """
    with at_rest(system, instances, pulse) as loop:
        radius = float(np.abs(np.linalg.eigvals(period_map(loop))).max(initial=0.0))
        return math.log(radius) / (float(loop.period) / NANOSECONDS) if radius > 0.0 else -math.inf
