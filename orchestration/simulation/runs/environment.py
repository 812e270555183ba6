"""A simulation as an environment of Gymnasium, which the extra `gym` installs."""

from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np

from orchestration.foundation.basics.errors import UsageError, shown
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.requests.request import RequestLike
from orchestration.simulation.runs.stepping import Simulation

Reward = Callable[[Mapping[str, float]], float]
"""Computed from the values of all columns after a step, by name: `Simulation.values`"""
InitialValues = Callable[[np.random.Generator], Mapping[str, Any]]
"""Draws the values by path that an episode begins with"""


class Environment(gymnasium.Env[Floats, Floats]):  # type: ignore[misc]
    """A system, or a scenario, for learning: an action is a command of a component, an observation its measurement.

    An episode is a run. It is terminated where that diverges or an FMU ends it, truncated at its stop time; `info` then
    has the `metrics`. Each episode has its own seed for noise, loss and jitter, drawn from that of `reset`.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 - as Gymnasium has it

    def __init__(
        self,
        request: RequestLike,
        reward: Reward,
        *,
        low: Any,
        high: Any,
        component: str | None = None,
        starts: InitialValues | None = None,
    ) -> None:
        """`low` and `high` bound each number of an action, in the units of the component's outputs.

        `reward` computes a number from the values of all columns after a step; those of the last instant for a run that
        has ended early. `starts` draws the values that an episode begins with, by path as axes of studies name them.
        `component` is the one that is replaced; default: the only sampled one. Raises `UsageError` as `Simulation`.
        """
        self.simulation = Simulation(request, component)
        """The simulation that it steps: names of observations and actions, and the result of a finished episode."""
        self._reward, self._starts = reward, starts
        count = len(self.simulation.commanded)
        try:
            lowest, highest = (np.broadcast_to(np.asarray(x, dtype=np.float64), (count,)) for x in (low, high))
            fits = bool((lowest < highest).all())
        except (TypeError, ValueError):
            fits = False
        if not fits:
            names = ", ".join(self.simulation.commanded)
            raise UsageError(f"low, high: expected a number, or {count} of them, each low below its high: {names}")
        self.action_space = gymnasium.spaces.Box(lowest, highest, dtype=np.float64)
        shape = (len(self.simulation.measured),)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, shape, dtype=np.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode; `options` are values by path on top of those that `starts` draws."""
        super().reset(seed=seed)
        values = {} if self._starts is None else dict(self._starts(self.np_random))
        seed_of_episode = int(self.np_random.integers(2**63 - 1))
        return self.simulation.reset(seed_of_episode, {**values, **(options or {})}), {}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Go on to the next sample; returns observation, reward, whether terminated or truncated, and `info`."""
        observation = self.simulation.step(action)
        value, info = self._reward(self.simulation.values), {}
        try:
            reward = float(value)
        except (TypeError, ValueError):
            raise UsageError(f"reward: returned {shown(value)}; expected a number") from None
        terminated = truncated = False
        if self.simulation.is_over:
            result = self.simulation.result
            terminated = result.divergence is not None or result.termination is not None
            truncated, info = not terminated, {"metrics": result.metrics}
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Free the FMUs."""
        self.simulation.close()
