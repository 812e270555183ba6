"""An environment that Gymnasium's own checker passes, whose episodes are runs."""

import importlib
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from tests.native import NATIVE

env_checker = pytest.importorskip("gymnasium.utils.env_checker")  # it sets what others would see as a change
SHORT = NATIVE.with_changes(stop_time=0.2, timing={"period": 0.02, "plant_interval": 0.01, "noise": {"position": 0.01}})
gym: Any = importlib.import_module("quadcosim.gym")
LOW, HIGH = [0.0, -5.0, -5.0, -5.0], [20.0, 5.0, 5.0, 5.0]


def reward(now: Any) -> float:
    return -sum((now[f"plant.position.{a}"] - now[f"reference.position.{a}"]) ** 2 for a in "xyz")


def starts(random: np.random.Generator) -> dict[str, float]:
    return {"plant.initial.position.x": random.uniform(-1.0, 1.0)}


@pytest.fixture
def environment() -> Iterator[Any]:
    environment = gym.Environment(SHORT, reward, low=LOW, high=HIGH, starts=starts)
    yield environment
    environment.close()


@pytest.mark.filterwarnings("ignore:.*Box (observation|action) space", "ignore:.*not having a spec")
def test_gymnasiums_checker_passes_it(environment: Any) -> None:
    env_checker.check_env(environment, skip_render_check=True)


def test_an_episode_is_a_run_of_its_seed_and_start(environment: Any) -> None:
    first, _ = environment.reset(seed=3)
    again, _ = environment.reset(seed=3)
    other, _ = environment.reset()
    assert first.tobytes() == again.tobytes() != other.tobytes()
    rewards, over = [], False
    while not over:
        _, got, terminated, truncated, info = environment.step([9.81, 0.0, 0.0, 0.0])
        rewards.append(got)
        over = terminated or truncated
    result = environment.simulation.result
    assert (terminated, truncated, info["metrics"]) == (False, True, result.metrics)
    errors = [result.signals[f"plant.position.{a}"] - result.signals[f"reference.position.{a}"] for a in "xyz"]
    assert len(rewards) == 10
    assert rewards == pytest.approx(-np.sum(np.square(errors), axis=0)[2::2])


def test_a_run_that_diverges_is_terminated(environment: Any) -> None:
    environment.reset(seed=0, options={"plant.initial.position.x": 95.0, "plant.initial.velocity.x": 100.0})
    over = False
    while not over:
        _, _, over, truncated, info = environment.step([9.81, 0.0, 0.0, 0.0])
        assert not truncated
    assert info["metrics"]["diverged"] is True


@pytest.mark.parametrize(("low", "high"), [(0.0, 0.0), ([0.0, 1.0], 2.0), ("x", 1.0), (float("nan"), 1.0)])
def test_bounds_that_are_none_are_refused(low: Any, high: Any) -> None:
    with pytest.raises(UsageError, match=r"^low, high: expected a number, or 4 of them, each low below its high: thr"):
        gym.Environment(SHORT, reward, low=low, high=high)


def test_without_gymnasium_one_line_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    for name in ("quadcosim.gym", "orchestration.simulation.runs.environment"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with pytest.raises(QuadcosimError, match=r"^gymnasium is not installed; this needs: pip install 'quadcosim\[gym\]"):
        importlib.import_module("quadcosim.gym")
