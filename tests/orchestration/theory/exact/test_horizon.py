"""Expectations from initial conditions to a horizon: formulas by hand, runs without chance, stationary values."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.components.building import fmus
from orchestration.components.scaffold.folder import write
from orchestration.foundation.basics.simulator import Floats
from orchestration.systems.system.connection import Source
from orchestration.systems.system.file import load_system
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import Criterion
from orchestration.systems.system.paths import changed
from orchestration.theory.exact import initial_state
from orchestration.theory.exact.expect import Expected, expect, expected_of
from orchestration.theory.exact.loops import Loops
from quadcosim import UsageError, run
from tests.commands import Main
from tests.examples.common import native_example as example
from tests.extent import sample
from tests.orchestration.theory.exact.common import GAIN
from tests.places import EXAMPLES

START, LOSS, BURST = (
    "components.plant.parameters.initial.x",
    "connections.command.loss",
    "connections.command.burst_length",
)
COMMAND, MEASUREMENT, SAMPLING = "connections.command", "connections.measurement", "components.controller.sampling"


def over_hold(V: Floats, h: float) -> float:
    """The integral of E[x²] over a hold of h s, V the second moments of (x, u) as it begins."""
    return float(V[0, 0] * h + V[0, 1] * h**2 + V[1, 1] * h**3 / 3.0 + h**2 / 2.0)


def by_hand(start: float, periods: int, loss: float = 0.0) -> float:
    """The mean of x² under commands of which each is lost with a probability, the first one after initialisation."""
    law, keep, flow = (np.array(rows) for rows in ([[1.0, 0.0], [-GAIN, 0.0]], np.eye(2), [[1.0, 1.0], [0.0, 1.0]]))
    z = np.array([start, -GAIN * start])
    V, cost = np.outer(z, z), 0.0
    for _ in range(periods):
        V = (1.0 - loss) * law @ V @ law.T + loss * keep @ V @ keep.T
        cost += over_hold(V, 1.0)
        V = flow @ V @ flow.T + np.diag([1.0, 0.0])
    return cost / periods


def variance(horizon: float, **changes: Any) -> float:
    system = example("minimum_variance", {key.replace("__", "."): value for key, value in changes.items()})
    found = expect(at_zero(system), horizon=horizon).objectives["variance"]
    assert found is not None
    return found


def at_zero(system: Any) -> Any:
    return dataclasses.replace(system, operating_point={START: 0.0})


@pytest.mark.parametrize("start", [0.0, 3.0])
@pytest.mark.parametrize("periods", [1, 7])
def test_minimum_variance_control_costs_from_its_start_what_a_hand_finds(start: float, periods: int) -> None:
    found = variance(float(periods), **{START: start})
    assert found == pytest.approx(by_hand(start, periods), rel=1e-9)


def test_a_horizon_within_a_period_ends_there() -> None:
    assert variance(0.5, **{START: 3.0}) == pytest.approx(
        over_hold(np.outer([3.0, -3.0 * GAIN], [3.0, -3.0 * GAIN]), 0.5) / 0.5, rel=1e-9
    )


def test_a_cost_to_a_horizon_is_finite_where_the_stationary_one_is_not() -> None:
    lossy = at_zero(example("minimum_variance", {LOSS: 0.3, START: 3.0}))
    found = expect(lossy, horizon=20.0)
    assert found.mean_square_radius > 1.0
    assert not found.reasons
    assert found.objectives["variance"] == pytest.approx(by_hand(3.0, 20, loss=0.3), rel=1e-9)


@pytest.mark.parametrize(
    "changes",
    [{"connections__command__delay_jitter": 0.5}, {LOSS.replace(".", "__"): 0.1, BURST.replace(".", "__"): 1.5}],
    ids=["late", "bursts"],
)
def test_far_away_it_comes_to_the_stationary_value(changes: dict[str, Any]) -> None:
    """The extra cost of the initial state is constant from some horizon on: two horizons determine the limit."""
    first, second = variance(200.0, **changes), variance(400.0, **changes)
    stationary = expect(example("minimum_variance", {k.replace("__", "."): v for k, v in changes.items()}))
    assert 2.0 * second - first == pytest.approx(stationary.objectives["variance"], rel=1e-8)


@pytest.mark.parametrize(
    "changes",
    sample(
        [
            {},
            {f"{COMMAND}.delay": 0.7},
            {f"{COMMAND}.hold": "first", f"{COMMAND}.delay": 0.1},
            {f"{COMMAND}.order": "jacobi", f"{COMMAND}.delay": 0.05},
            {f"{MEASUREMENT}.delay": 0.5, f"{COMMAND}.scale": 0.9},
            {f"{MEASUREMENT}.delay": 0.9, f"{MEASUREMENT}.hold": "first"},
            {f"{SAMPLING}.offset": 0.2, f"{COMMAND}.delay": 0.1},
        ],
        4,
    ),
    ids=sample(["prompt", "late", "first", "jacobi", "measured", "measured first", "offset"], 4),
)
def test_without_chance_it_is_what_a_run_prints(changes: dict[str, Any]) -> None:
    """Of squares and of signals themselves, from where the example begins, to a time between two samples."""
    whole = example(
        "double_integrator", {f"{SAMPLING}.period": 0.4, "components.plant.step": 0.05, "stop_time": 3.3, **changes}
    )
    system = dataclasses.replace(
        whole,
        criterion=Criterion(),
        objectives={"square": "mean(plant.x ** 2)", "effort": "rms(plant.u)", "mean": "mean(plant.x) - 2"},
    )
    found = expect(system, horizon=3.3, as_simulated=True)
    printed = run(system, progress=None, announce=None).metrics
    assert found.objectives == pytest.approx({name: printed[name] for name in system.objectives}, rel=1e-8)


def test_a_step_of_a_source_is_an_input_from_the_begin_on() -> None:
    """Of a plant by hand, and of a set point as a run prints it, from an initial value elsewhere."""
    whole = example("minimum_variance")
    load = Source(constant=0.3, to=("plant.w",))
    rests = {"sources.load.constant": 0.0, START: 0.0}
    system = changed(dataclasses.replace(whole, sources={"load": load}, operating_point=rests), {START: 2.0})
    x, cost = 2.0, 0.0
    for _ in range(7):
        rate = 0.3 - GAIN * x
        cost += x**2 + x * rate + rate**2 / 3.0
        x += rate
    assert expect(system, horizon=7.0).objectives["variance"] == pytest.approx(cost / 7.0, rel=1e-9)
    with pytest.raises(UsageError, match=r"as initial ones and sources.load.constant, without after"):
        expect(dataclasses.replace(system, operating_point={"after": 100.0}), horizon=7.0)

    servo = dataclasses.replace(
        example("dc_servo", {LOSS: 0.0, f"{COMMAND}.delay_jitter": 0.0, "stop_time": 0.5}), criterion=Criterion(),
        sources={"wanted": Source(constant=0.2, to=("controller.reference",))},
        operating_point={"sources.wanted.constant": 0.0, "components.servo.parameters.initial.angle": 0.0},
        objectives={
            "error": "mean((servo.angle - wanted.reference) ** 2)", "effort": "rms(controller.u)",
            "wanted": "mean(controller.reference * servo.angle)",
        },
    )  # fmt: skip
    printed = run(servo, progress=None, announce=None).metrics
    found = expect(servo, horizon=0.5, as_simulated=True).objectives
    assert found == pytest.approx({name: printed[name] for name in servo.objectives}, rel=1e-8)


def test_over_all_that_may_be_lost_runs_print_on_average_what_is_expected() -> None:
    """Of three commands, each as likely to be lost as not."""
    whole = example("double_integrator", {f"{SAMPLING}.period": 0.4, "components.plant.step": 0.05, "stop_time": 1.2})
    system = dataclasses.replace(
        whole, criterion=Criterion(), objectives={"square": "mean(plant.x ** 2)"},
        connections=(whole.connections[0], dataclasses.replace(whole.connections[1], loss=0.5)),
    )  # fmt: skip
    found: dict[str, float] = {}
    for seed in range(60):
        if len(found) == 8:
            break
        result = run(dataclasses.replace(system, seed=seed), progress=None, announce=None)
        found[str([event for event in result.events if event.kind == "lost"])] = float(result.metrics["square"] or 0.0)
    assert len(found) == 8
    expected = expect(system, horizon=1.2, as_simulated=True).objectives["square"]
    assert sum(found.values()) / 8.0 == pytest.approx(expected, rel=1e-8)


def test_a_start_at_which_a_component_is_not_linear_is_refused_by_name() -> None:
    speed, constant = "components.servo.parameters.initial.speed", "components.servo.parameters.time_constant"
    servo = example("dc_servo", {LOSS: 0.0, speed: 1.0})
    driven = dataclasses.replace(
        servo, objectives={"cost": "mean(servo.angle ** 2)"}, criterion=Criterion(),
        operating_point={**dict.fromkeys(("components.servo.parameters.initial.angle", speed), 0.0), constant: 2.0},
    )  # fmt: skip
    with pytest.raises(UsageError, match=r"its initial state is not linear .* at most 0.0156 times as far"):
        expect(driven, horizon=1.0)


def test_the_cost_from_a_pendulum_that_leans_is_linear_theory_and_says_how_far_it_is_off(tmp_path: Path) -> None:
    write("plant", "pendulum", tmp_path, author="Ada", license="MIT")
    objectives = {"cost": "mean((plant.angle - 3.141592653589793) ** 2)"}
    written = fmus.native_twins(load_system(tmp_path / "pendulum" / "system.toml"))
    upright = dataclasses.replace(written, objectives=objectives, criterion=Criterion())

    def leaning(by: float) -> Expected:
        return expect(changed(upright, {"components.plant.parameters.initial.angle": math.pi + by}), horizon=1.0)

    little, far = leaning(1e-5), leaning(0.1)
    costs = [one.objectives["cost"] or math.nan for one in (little, far)]
    assert costs[0] * 1e8 == pytest.approx(costs[1], rel=1e-6)
    ran = run(changed(upright, {"components.plant.parameters.initial.angle": math.pi + 0.1, "stop_time": 1.0}))
    simulated = expect(ran.system, horizon=1.0, as_simulated=True).objectives["cost"]
    assert little.accuracy < 1e-6 < abs(ran.metrics["cost"] / simulated - 1.0) < far.accuracy < 2e-3
    with pytest.raises(UsageError, match=r"expected initial values at most 0\.\d+ times as far from it"):
        leaning(1.0)


@pytest.mark.parametrize("saturated", [0.1, 0.0])
def test_coordinates_are_measured_nearer_to_rest_where_a_tenth_of_the_way_is_no_better(
    monkeypatch: pytest.MonkeyPatch, saturated: float
) -> None:
    measured = initial_state._measured

    def far(*given: Any) -> tuple[initial_state.InitialState, str]:
        found, worst = measured(*given)
        share = given[5] if len(given) > 5 else 1.0
        return (found if share < saturated else dataclasses.replace(found, accuracy=0.17)), worst

    monkeypatch.setattr(initial_state, "_measured", far)
    system = at_zero(example("minimum_variance", {START: 3.0}))
    loops = Loops(files_of(system).models)
    if saturated:
        assert expected_of(system, loops, 7.0).objectives["variance"] == pytest.approx(by_hand(3.0, 7), rel=1e-9)
    else:
        with pytest.raises(UsageError, match=r"plant: .* its inputs do not reach .* misses 0\.2 of it"):
            expected_of(system, loops, 7.0)


@pytest.mark.parametrize("horizon", [0.0, -1.0, math.inf, math.nan])
def test_a_horizon_is_a_finite_time_above_zero(horizon: float) -> None:
    with pytest.raises(UsageError, match=r"horizon = \S+ s: expected a finite time above 0"):
        expect(example("minimum_variance"), horizon=horizon)


def test_the_command_says_how_far_it_looked(main: Main) -> None:
    path = EXAMPLES / "minimum_variance/system.toml"
    document = json.loads(main("expect", path, "--horizon", "7", "--json").stdout)
    assert document["horizon"] == 7.0
    assert document["objectives"]["variance"] == pytest.approx(by_hand(0.0, 7), rel=1e-9)
    assert "from its initial conditions to 7 s" in document["method"]
