"""A run as an environment of Gymnasium; it needs `pip install 'quadcosim[gym]'`.

For example one that rewards being near the paper's path::

    from quadcosim import Scenario
    from quadcosim.gym import Environment

    def reward(now):
        return -sum((now[f"plant.position.{a}"] - now[f"reference.position.{a}"]) ** 2 for a in "xyz")

    environment = Environment(Scenario(), reward, low=[0, -5, -5, -5], high=[30, 5, 5, 5])
    observation, info = environment.reset(seed=0)
    observation, reward, terminated, truncated, info = environment.step([9.81, 0, 0, 0])
"""

from importlib import import_module
from typing import TYPE_CHECKING

from orchestration.foundation.basics.extras import explains_missing

if TYPE_CHECKING:
    from orchestration.simulation.runs.environment import Environment
else:
    Environment = explains_missing(import_module)("orchestration.simulation.runs.environment").Environment

__all__ = ["Environment"]
