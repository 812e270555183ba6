"""The sampled loop of any system about its operating point: how what is small grows, from saved states."""

import math

import numpy as np

from orchestration.fmi.reuse import Instances
from orchestration.stability.linear_loop import at_rest, map_of
from orchestration.stability.linearised_component import PULSE
from orchestration.system.model import System
from orchestration.system.times import NANOSECONDS


def growth_of_loop(system: System, instances: Instances, pulse: float = PULSE) -> float:
    """The growth [1/s] of what is small about the operating point of `system`; negative: it decays.

    Raises `UsageError` where the system does not rest there, or cannot be put into a linear loop, saying why.
    """
    with at_rest(system, instances, pulse) as loop:
        radius = float(np.abs(np.linalg.eigvals(map_of(loop))).max(initial=0.0))
        return math.log(radius) / (float(loop.period) / NANOSECONDS) if radius > 0.0 else -math.inf
