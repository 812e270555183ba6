"""Simulations as environments of Gymnasium, which the extra `gym` installs: one run, or many in SIMD lanes."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode

from orchestration.foundation.basics.errors import UsageError, expected_name, shown
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.simulation.requests.request import RequestLike
from orchestration.simulation.runs.arguments import function_in, names_in, values_by_path
from orchestration.simulation.runs.stepped_runs import SteppedRuns
from orchestration.simulation.runs.stepping import Simulation

Reward = Callable[[Mapping[str, Any]], Any]
"""Computed from the values of all columns after a step, by name: numbers, or arrays of those of many runs"""
InitialValues = Callable[[np.random.Generator], Mapping[str, Any]]
"""Draws the values by path that an episode begins with"""


class Environment(gymnasium.Env[Floats, Floats]):  # type: ignore[misc]
    """A system, or a scenario, for learning: an action is a command of a component, an observation its measurement.

    An episode is a run. It is terminated where that diverges or an FMU ends it, truncated at its stop time; `info` then
    has the `metrics`. Each episode has its own seed for noise, loss and jitter, drawn from that of `reset`. Its last
    observation has the true values: neither late, lost nor noisy.
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
        observe: Sequence[str] = (),
        initial: Any = None,
        in_process: bool = False,
    ) -> None:
        """`low` and `high` bound each number of an action, in the units of the component's outputs.

        `reward` computes a number from the values of all columns after a step; those of the last instant for a run that
        has ended early. `starts` draws the values that an episode begins with, by path as axes of studies name them.
        `component` is the one that is replaced; default: the only sampled one. `observe` are columns or signals of
        sources whose present values follow the measurement. `initial` is the action that stands until the first one
        arrives; it, its default, and `in_process` are those of `Simulation`. Raises `UsageError` as `Simulation`.
        """
        self.simulation = Simulation(request, component, initial=initial, in_process=in_process)
        """The simulation that it steps: names of observations and actions, and the result of a finished episode."""
        self._reward, self._starts, self._observe = _chosen(reward, starts, observe, self.simulation.names)
        self.action_space = _actions(self.simulation.commanded, low, high)
        self.observation_space = _observations(self.simulation.measured, self._observe)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode; `options` are values by path on top of those that `starts` draws.

        `info["values"]` has all of these, and the `seed` of the episode: `fly` takes them, to fly it again.
        """
        super().reset(seed=seed)
        drawn, seed_of_episode = _episode(self.np_random, self._starts)
        values = {**drawn, **_options(options)}
        observation = self._with_others(self.simulation.reset(seed_of_episode, values))
        return observation, {"values": {**values, "seed": seed_of_episode}}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Go on to the next sample; returns observation, reward, whether terminated or truncated, and `info`."""
        observation = self._with_others(self.simulation.step(action))
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

    def _with_others(self, measurement: Floats) -> Floats:
        if not self._observe:
            return measurement
        values = self.simulation.values
        return np.concatenate([measurement, [values[name] for name in self._observe]])


class VectorEnvironment(gymnasium.vector.VectorEnv[Floats, Floats, Any]):  # type: ignore[misc]
    """Many environments in SIMD lanes: each has the episodes of an `Environment` of its seed, to the bit.

    Lanes run the C of your FMUs in Python, which may differ in the last bits.
    Where one is over, the next step begins its next episode: it ignores the action and returns the first observation
    with a reward of 0 (`AutoresetMode.NEXT_STEP`). There are no metrics.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        request: RequestLike,
        reward: Reward,
        *,
        num_envs: int,
        low: Any,
        high: Any,
        component: str | None = None,
        starts: InitialValues | None = None,
        observe: Sequence[str] = (),
        initial: Any = None,
        in_process: bool = False,
    ) -> None:
        """As `Environment`, for `num_envs` of them; `reward` gets arrays with a value for each, and returns one.

        Raises `UsageError` also for FMUs that cannot run in lanes of this process, in a line: those of your own need
        `in_process`; `gymnasium.vector.SyncVectorEnv` steps single ones of any.
        """
        if isinstance(num_envs, bool) or not isinstance(num_envs, int) or num_envs < 1:
            raise UsageError(f"num_envs = {shown(num_envs)}: expected a positive whole number")
        self.runs = SteppedRuns(request, component, num_envs, initial=initial, in_process=in_process)
        """The runs that it steps: names of observations and actions."""
        self.num_envs = num_envs
        self._reward, self._starts, self._observe = _chosen(reward, starts, observe, self.runs.names)
        self.single_action_space = _actions(self.runs.commanded, low, high)
        self.single_observation_space = _observations(self.runs.measured, self._observe)
        batched = gymnasium.vector.utils.batch_space
        self.action_space = batched(self.single_action_space, num_envs)
        self.observation_space = batched(self.single_observation_space, num_envs)
        self._random: list[np.random.Generator] = []

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begin an episode in each; a number as `seed` is that of the first, one more for each that follows.

        `options` are values by path on top of those that `starts` draws: one for all, or an array with one for each.
        They hold for the episodes that this begins, not for those that begin by themselves later. `info["values"]` has
        the values of each episode as `Environment` has them, an array by path, with a mask by `_path`.
        """
        seeds = self._seeds(seed)
        if not self._random:
            self._random = [seeding.np_random(None)[0] for _ in seeds]
        for i, own in enumerate(seeds):
            if own is not None:
                self._random[i] = seeding.np_random(own)[0]
        info = self._begin(np.arange(self.num_envs), _options(options))
        return self._observation(), info

    def step(self, actions: Floats) -> tuple[Floats, Floats, Booleans, Booleans, dict[str, Any]]:
        """Go on to the next samples; `info` has the values of episodes that begin here, as `reset` has them.

        Raises `UsageError` for actions that are not finite, and before `reset`.
        """
        if not self._random:
            raise UsageError("step: no run is under way; expected reset before it")
        actions = _numbers(actions)
        if actions.shape != self.action_space.shape or not np.isfinite(actions).all():
            raise UsageError(f"actions: expected finite numbers, shape {self.action_space.shape}")
        fresh = self.runs.over.copy()
        self.runs.step(actions)
        info = self._begin(np.flatnonzero(fresh), {}) if fresh.any() else {}
        value = self._reward(_Values(self.runs))
        rewards = _numbers(value)
        if rewards.shape != (self.num_envs,):
            raise UsageError(f"reward: returned {shown(repr(value))}; expected an array of {self.num_envs} numbers")
        terminated = self.runs.diverged.copy()
        return self._observation(), np.where(fresh, 0.0, rewards), terminated, self.runs.over & ~terminated, info

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        """The seed of each environment; None: it goes on with its random numbers."""
        if seed is None or isinstance(seed, int):
            return [None if seed is None else seed + i for i in range(self.num_envs)]
        seeds = [*seed] if isinstance(seed, Sequence) else []
        if len(seeds) != self.num_envs:
            raise UsageError(f"seed = {shown(repr(seed))}: expected a whole number, or a list of {self.num_envs}")
        return seeds

    def _begin(self, places: Integers, options: Mapping[str, Any]) -> dict[str, Any]:
        """Begin episodes at some places; their values, in the form that Gymnasium has of many environments."""
        drawn, seeds = zip(*(_episode(self._random[place], self._starts) for place in places.tolist()))
        for each in drawn:
            if each.keys() != drawn[0].keys():
                raise UsageError(f"starts: returned {[*each]} and {[*drawn[0]]}: expected the same paths in each call")
        values = {path: np.array([each[path] for each in drawn]) for path in drawn[0]}
        self.runs.begin(places, seeds, {**values, **options})
        begun = np.zeros(self.num_envs, dtype=np.bool_)
        begun[places] = True
        info: dict[str, Any] = {}
        for path, some in {**values, **options, "seed": seeds}.items():
            found = np.asarray(some)
            info[path] = np.zeros(self.num_envs, dtype=found.dtype if found.dtype.kind in "biuf" else object)
            info[path][places] = found
            info[f"_{path}"] = begun.copy()
        return {"values": info, "_values": begun}

    def _observation(self) -> Floats:
        others = [self.runs.value(name) for name in self._observe]
        return np.column_stack([self.runs.measurement, *others])


class _Values(Mapping[str, Any]):
    """The values of columns now by name, arrays with one for each run."""

    def __init__(self, runs: SteppedRuns) -> None:
        self._runs = runs

    def __getitem__(self, name: str) -> Floats:
        return self._runs.value(name)

    def __iter__(self) -> Any:
        return iter(self._runs.names)

    def __len__(self) -> int:
        return len(self._runs.names)


def _episode(random: np.random.Generator, starts: InitialValues | None) -> tuple[Mapping[str, Any], int]:
    """The values that an episode begins with, and its seed."""
    values = {} if starts is None else values_by_path(starts(random), "starts: returned")
    return values, int(random.integers(2**63 - 1))


def _chosen(
    reward: Reward, starts: InitialValues | None, observe: Sequence[str], known: Sequence[str]
) -> tuple[Reward, InitialValues | None, tuple[str, ...]]:
    """What an environment is made with; raises `UsageError` for what is not of its kind."""
    function_in(reward, "reward", "the values after a step, which returns a number")
    if starts is not None:
        function_in(starts, "starts", "a generator of random numbers, which returns values by path")
    observed = names_in(observe, "observe")
    for name in observed:
        if name not in known:
            raise UsageError(f"observe: {name}: {expected_name(name, known)}")
    return reward, starts, observed


def _options(options: Any) -> dict[str, Any]:
    return {} if options is None else values_by_path(options, "options =")


def _numbers(values: Any) -> Floats:
    """An array of numbers, empty for what is none."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        return np.zeros(0)


def _actions(commanded: Sequence[str], low: Any, high: Any) -> Any:
    """The space of commands; raises `UsageError` for bounds that are none."""
    count = len(commanded)
    try:
        lowest, highest = (np.broadcast_to(np.asarray(x, dtype=np.float64), (count,)) for x in (low, high))
        fits = bool((lowest < highest).all())
    except (TypeError, ValueError):
        fits = False
    if not fits:
        names = ", ".join(commanded)
        raise UsageError(f"low, high: expected a number, or {count} of them, each low below its high: {names}")
    return gymnasium.spaces.Box(lowest, highest, dtype=np.float64)


def _observations(measured: Sequence[str], observe: Sequence[str]) -> Any:
    return gymnasium.spaces.Box(-np.inf, np.inf, (len(measured) + len(observe),), dtype=np.float64)
