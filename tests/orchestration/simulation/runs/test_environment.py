"""Environments that Gymnasium's own checker passes, whose episodes are runs."""

import importlib
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import quadcosim
from orchestration.components.building import fmus
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
from orchestration.systems.system.connection import Source
from tests.native import NATIVE
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.runs.test_stepping import law
from tests.places import ROOT

gymnasium = pytest.importorskip("gymnasium")
env_checker = pytest.importorskip("gymnasium.utils.env_checker")  # it sets what others would see as a change
SHORT = NATIVE.with_changes(stop_time=0.2, timing={"period": 0.02, "plant_interval": 0.01, "noise": {"position": 0.01}})
gym: Any = importlib.import_module("quadcosim.gym")
LOW, HIGH = [0.0, -5.0, -5.0, -5.0], [20.0, 5.0, 5.0, 5.0]
X = "plant.initial.position.x"


def reward(now: Any) -> Any:
    return -sum((now[f"plant.position.{a}"] - now[f"reference.position.{a}"]) ** 2 for a in "xyz")


def starts(random: np.random.Generator) -> dict[str, float]:
    return {X: random.uniform(-1.0, 1.0)}


@pytest.fixture
def environment() -> Iterator[Any]:
    environment = gym.Environment(SHORT, reward, low=LOW, high=HIGH, starts=starts)
    yield environment
    environment.close()


@pytest.mark.filterwarnings("ignore:.*Box (observation|action) space")
def test_gymnasiums_checker_passes_it() -> None:
    environment = gymnasium.make("quadcosim/Quadrotor-v0", scenario=SHORT).unwrapped
    env_checker.check_env(environment)
    environment.close()


def test_an_episode_is_a_run_of_its_seed_and_start(environment: Any) -> None:
    first, info = environment.reset(seed=3)
    again, _ = environment.reset(seed=3)
    assert [*info["values"]] == [X, "seed"]
    start = quadcosim.fly(SHORT, info["values"], outputs=[], record=["plant.position"])
    assert start["plant.position.x"][0] == info["values"][X], "what was drawn, which fly takes"
    assert environment.reset(seed=3, options={X: 0.25})[1]["values"] == {**info["values"], X: 0.25}
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


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"reward": 3}, r"^reward = 3: expected a function of the values after a step, which returns a number$"),
        (
            {"starts": {X: 1.0}},
            r"^starts = \{.*\}: expected a function of a generator of random numbers, which returns",
        ),
        ({"starts": lambda random: 3}, r"^starts: returned 3: expected a dictionary of values by path"),
        ({"observe": "time"}, r"^observe = 'time': expected a list of names$"),
        ({"observe": ["plant.tlt"]}, r"^observe: plant.tlt: did you mean plant.tilt\? expected one of time, plant.thr"),
    ],
    ids=["reward", "starts", "what starts returns", "observe", "what is observed"],
)
def test_what_an_environment_cannot_be_made_with_is_refused_in_a_line(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        gymnasium.make("quadcosim/Quadrotor-v0", scenario=SHORT, **settings).reset()
    with pytest.raises(UsageError, match=r"^options = 3: expected a dictionary of values by path"):
        gym.Environment(SHORT, reward, low=LOW, high=HIGH).reset(options=3)


def test_without_gymnasium_one_line_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    for name in ("quadcosim.gym", "orchestration.simulation.runs.environment"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    with pytest.raises(QuadcosimError, match=r"^gymnasium is not installed; this needs: pip install 'quadcosim\[gym\]"):
        importlib.import_module("quadcosim.gym")


@needs_compiler
@pytest.mark.parametrize("initial", [None, [9.0, 0.1, 0.2, 0.3]])
def test_environments_in_lanes_have_the_episodes_of_each_alone(initial: Any) -> None:
    timing = {"timing.period": 0.02, "timing.delay": 0.01, "timing.jitter": 0.002, "timing.loss": 0.1}
    settings = {"scenario": SHORT.with_values({**timing, "stop_time": 0.1}), "starts": far, "initial": initial}
    many = gymnasium.make_vec("quadcosim/Quadrotor-v0", num_envs=6, **settings)
    each = gymnasium.make_vec("quadcosim/Quadrotor-v0", num_envs=6, vectorization_mode="sync", **settings)
    assert isinstance(many, gym.VectorEnvironment)
    assert many.observation_space == each.observation_space
    assert many.metadata["autoreset_mode"] == each.metadata["autoreset_mode"]
    (begun, values), (same, others) = many.reset(seed=3), each.reset(seed=3)
    np.testing.assert_array_equal(begun, same)
    np.testing.assert_equal(values, others)
    assert values["values"][X].shape == (6,)
    actions, ends = np.random.default_rng(0), []
    for _ in range(14):
        action = actions.uniform(LOW, HIGH, (6, 4))
        (observed, got, *over, info), (expected, rewards, *ended, others) = many.step(action), each.step(action)
        np.testing.assert_equal(info, {name: some for name, some in others.items() if "metrics" not in name})
        np.testing.assert_array_equal(observed, expected)
        np.testing.assert_array_equal(got, rewards)
        np.testing.assert_array_equal(over, ended)
        ends.append(over)
    terminated, truncated = np.sum(ends, axis=0)
    assert terminated.any()
    assert (truncated > 1).any()
    many.close()
    each.close()


@needs_compiler
def test_the_last_observation_has_what_a_source_feeds_then(tmp_path: Path) -> None:
    (tmp_path / "line.csv").write_text("time,position.x\n0.0,0.0\n1.0,1.0\n")
    system = SHORT.with_values({"timing.period": 0.02, "stop_time": 0.1}).as_system()
    ends = {x.name: [(*each,) for each in zip(x.start, x.end) if each[1] != "controller.position.x"]
            for x in system.connections}  # fmt: skip
    fed = replace(
        system,
        connections=tuple(replace(x, start=(*next(zip(*ends[x.name])),), end=(*list(zip(*ends[x.name]))[1],))
                          for x in system.connections),
        sources={**system.sources, "line": Source(to=("controller.position.x",), file=tmp_path / "line.csv")},
    )  # fmt: skip
    begin = lambda random: {f"components.plant.parameters.{k[6:]}": value for k, value in far(random).items()}  # noqa: E731
    settings = {"low": LOW, "high": HIGH, "starts": begin}
    many = gym.VectorEnvironment(fed, lambda now: now["plant.position.x"], num_envs=6, **settings)
    alone = [gym.Environment(fed, lambda now: now["plant.position.x"], **settings) for _ in range(6)]
    place, over, times = many.runs.measured.index("position.x"), np.zeros(6, dtype=bool), set[float]()
    many.reset(seed=3)
    for i, each in enumerate(alone):
        each.reset(seed=3 + i)
    while not over.all():
        observed, _, terminated, truncated, _ = many.step(np.tile([9.81, 0.0, 0.0, 0.0], (6, 1)))
        for i in np.flatnonzero(~over).tolist():
            expected, _, *ended, _ = alone[i].step([9.81, 0.0, 0.0, 0.0])
            assert observed[i].tobytes() == expected.tobytes()
            assert observed[i, place] == pytest.approx(alone[i].simulation.time)
            assert any(ended) == (terminated | truncated)[i]
            times |= {alone[i].simulation.time} if any(ended) else set()
        over |= terminated | truncated
    assert len(times) > 1, "one that diverged, one at its end"
    for each in (many, *alone):
        each.close()


def far(random: np.random.Generator) -> dict[str, float]:
    """Starts of vehicles that differ, of which some diverge before the end."""
    mass = random.uniform(0.5, 2.0)
    return {X: random.uniform(80.0, 98.0), "plant.initial.velocity.x": 100.0, "plant.mass": mass}


@needs_compiler
def test_an_lqr_policy_from_the_linearised_loop_comes_to_hover_from_everywhere_near() -> None:
    hover = NATIVE.with_changes(stop_time=3.0, timing={"period": 0.02}, reference={"name": "hover"})
    rest, input_cost = quadcosim.linearise(hover).rest, 0.1 * np.eye(4)
    measurement_cost = np.diag([4.0] * 3 + [1.0] * 3 + [10.0] * 3 + [0.0] + [0.1] * 3)
    P = solve_discrete_are(rest.A, rest.B, rest.C.T @ measurement_cost @ rest.C, input_cost)
    gain = np.linalg.solve(input_cost + rest.B.T @ P @ rest.B, rest.B.T @ P @ rest.A) @ np.linalg.pinv(rest.C)
    level = np.eye(13)[rest.outputs.index("quaternion.w")]
    many = gymnasium.make_vec("quadcosim/Quadrotor-v0", num_envs=16, scenario=hover, starts=near)
    observation, _ = many.reset(seed=0)
    total, over = np.zeros(16), np.zeros(16, np.bool_)
    while not over.any():
        command = np.array([9.81, 0.0, 0.0, 0.0]) - (observation[:, :13] - level) @ gain.T
        observation, got, terminated, truncated, _ = many.step(command)
        total, over = total + got, terminated | truncated
    many.close()
    assert truncated.all()
    assert not observation[:, 13:].any()  # the reference: the origin
    assert np.linalg.norm(observation[:, :3], axis=1).max() < 0.05
    assert total.min() > 100.0  # of 150


def near(random: np.random.Generator) -> dict[str, float]:
    return {f"plant.initial.position.{axis}": random.uniform(-1.0, 1.0) for axis in "xyz"}


@needs_compiler
def test_your_commands_stand_in_for_a_law_that_follows_a_reference() -> None:
    one = gymnasium.make("quadcosim/Quadrotor-v0", scenario=SHORT.with_changes(reference={"name": "hover"}))
    observation, _ = one.reset(seed=0)
    assert observation.shape == (16,)
    assert not observation[13:].any()
    one.close()


@needs_compiler
def test_the_projects_controller_as_a_policy_flies_as_fly_has_it() -> None:
    starts = np.array([-1.0, 0.0, 1.0])
    scenario = SHORT.with_values({"timing.noise.position": 0.0})
    flown = quadcosim.fly(scenario, {X: starts}, outputs=["steps"], record=["plant.position.x", "plant.thrust"])
    many = gym.VectorEnvironment(scenario, reward, num_envs=3, low=LOW, high=HIGH)
    observed, _ = many.reset(seed=0, options={X: starts})
    for step in range(10):
        (time,) = set(many.runs.value("time"))
        assert time == pytest.approx(0.02 * step)
        observed, _, terminated, truncated, _ = many.step(np.array([law(time, each) for each in observed]))
    assert truncated.all()
    assert not terminated.any()
    assert many.runs.value("plant.position.x").tobytes() == flown["plant.position.x"][:, -1].tobytes()
    assert many.runs.value("plant.thrust").tobytes() == flown["plant.thrust"][:, -1].tobytes()


@needs_compiler
def test_foreign_fmus_are_in_lanes_if_they_may_be_and_what_is_replaced_needs_no_code(tmp_path: Path) -> None:
    plant, controller = (shutil.copy(fmus.locate(fmu), tmp_path) for fmu in (SHORT.plant.fmu, SHORT.controller.fmu))
    for path in (plant, controller):
        with zipfile.ZipFile(path, "a") as archive:
            archive.writestr("extra/changed", "so that it is another file")
    law = SHORT.with_values({"timing.delay": 0.03}).with_fmus(plant=SHORT.plant.fmu, controller=controller)
    first, _ = gym.VectorEnvironment(law, reward, num_envs=2, low=LOW, high=HIGH).reset(seed=3)
    again, _ = gym.Environment(law, reward, low=LOW, high=HIGH).reset(seed=3)
    assert first[0].tobytes() == again.tobytes()
    foreign = law.with_fmus(plant=plant, controller=controller)
    with pytest.raises(UsageError, match=r"^plant.fmu: not built here .* expected in_process=True to run it in lanes"):
        gym.VectorEnvironment(foreign, reward, num_envs=2, low=LOW, high=HIGH)
    inside, _ = gym.VectorEnvironment(foreign, reward, num_envs=2, low=LOW, high=HIGH, in_process=True).reset(seed=3)
    assert inside.tobytes() == first.tobytes()


@needs_compiler
def test_what_cannot_be_is_refused_in_a_line_in_lanes_too() -> None:
    with pytest.raises(UsageError, match=r"^num_envs = 0: expected a positive whole number$"):
        gym.VectorEnvironment(SHORT, reward, num_envs=0, low=LOW, high=HIGH)
    with pytest.raises(UsageError, match=r"^observe: plant.tlt: did you mean plant.tilt\? expected one of time"):
        gym.VectorEnvironment(SHORT, reward, num_envs=2, low=LOW, high=HIGH, observe=["plant.tlt"])
    many = gym.VectorEnvironment(SHORT, lambda now: 1.0, num_envs=2, low=LOW, high=HIGH)
    with pytest.raises(UsageError, match=r"^step: no run is under way; expected reset before it$"):
        many.step(np.zeros((2, 4)))
    many.reset(seed=0)
    for wrong in (np.zeros(4), np.full((2, 4), np.nan), "level"):
        with pytest.raises(UsageError, match=r"^actions: expected finite numbers, shape \(2, 4\)$"):
            many.step(wrong)
    with pytest.raises(UsageError, match=r"^reward: returned 1.0; expected an array of 2 numbers$"):
        many.step(np.zeros((2, 4)))
    with pytest.raises(UsageError, match=r"^seed = \[1\]: expected a whole number, or a list of 2$"):
        many.reset(seed=[1])
    with pytest.raises(UsageError, match=r"^paper.toml: expected a readable system or scenario file"):
        gymnasium.make("quadcosim/Quadrotor-v0", scenario="paper.toml")
    with pytest.raises(UsageError, match=r"^there is no plant.mas"):
        many.runs.value("plant.mas")
    with pytest.raises(UsageError, match=r"plant.initial.position.w: QuadrotorPlant has no such variable"):
        many.reset(options={"plant.initial.position.w": 1.0})
    with pytest.raises(
        UsageError, match=r"^plant.mass = array\(\[1., 2.\]\): expected a number, true, false or a text$"
    ):
        gym.VectorEnvironment(SHORT, reward, num_envs=2, low=LOW, high=HIGH, starts=two_masses).reset()
    with pytest.raises(SimulatorError, match=r"^run 1, counted from 0, has failed in lanes at t = 0 s"):
        many.reset(options={"plant.mass": np.array([1.0, 0.0])})
    masses = iter([{"plant.mass": 1.0}, {}])
    uneven = gym.VectorEnvironment(SHORT, reward, num_envs=2, low=LOW, high=HIGH, starts=lambda random: next(masses))
    with pytest.raises(
        UsageError, match=r"^starts: returned \[\] and \['plant.mass'\]: expected the same paths in each"
    ):
        uneven.reset()


def two_masses(random: np.random.Generator) -> dict[str, Any]:
    return {"plant.mass": np.array([1.0, 2.0])}


def test_who_imports_gymnasium_finds_it() -> None:
    code = "import gymnasium, quadcosim; print(gymnasium.spec('quadcosim/Quadrotor-v0').id)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "quadcosim/Quadrotor-v0\n"
