"""Code of the caller in the place of a component: the run is the one with the FMU of the same law, to the byte."""

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import quadcosim
from controller_fmu.sliding_mode.law import Gains, evaluate
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import Quaternion, Vec3
from fmu_kit.trajectory import Trajectory
from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.scenarios.scenario import Scenario
from quadcosim import Result, Simulation

SHORT = Scenario().with_changes(stop_time=0.3, timing={"period": 0.02, "plant_interval": 0.005})


def law(t: float, measured: np.ndarray) -> list[float]:
    """The paper's law, of its built-in trajectory."""
    x = measured.tolist()
    attitude = Quaternion.from_xyzw(*x[6:10]).normalised()
    state = Measurement(Vec3(*x[0:3]), Vec3(*x[3:6]), attitude, Vec3(*x[10:13]))
    found = evaluate(state, Trajectory().at(t), Gains(), Model())
    return [found.thrust, *found.torque]


def initial(scenario: Scenario, **reset: Any) -> list[float]:
    """The command of the law when it is initialised, from the state of the plant."""
    with Simulation(scenario.with_changes(timing=vars(SHORT.timing))) as at_once:
        return law(0.0, at_once.reset(**reset))


def stepped(scenario: Scenario, **reset: Any) -> Result:
    with Simulation(scenario, initial=initial(scenario, **reset)) as simulation:
        measured = simulation.reset(**reset)
        while not simulation.is_over:
            measured = simulation.step(law(simulation.time, measured))
        return simulation.result


def assert_the_same_flight(found: Result, expected: Result) -> None:
    shared = [name for name in found.columns if name in expected.columns]
    assert {"plant.position.x", "plant.thrust", "controller.torque.z", "reference.position.y"} <= {*shared}
    differing = [name for name in shared if found.signals[name].tobytes() != expected.signals[name].tobytes()]
    assert differing == []
    assert found.events == expected.events
    assert {k: v for k, v in found.metrics.items() if v is not None}.items() <= expected.metrics.items()


@pytest.mark.parametrize(
    "timing",
    [
        {},
        {"offset": 0.013, "jitter": 0.004},
        {"delay": 0.03, "delay_jitter": 0.01, "measurement_loss": 0.3, "command_loss": 0.2, "hold": "first"},
        {"noise": {"position": 0.01, "quaternion": 0.01}, "quantisation": {"velocity": 0.01}, "order": "jacobi"},
    ],
    ids=["plain", "late samples", "late messages", "noise"],
)
def test_a_law_in_python_gives_the_bytes_of_its_fmu(timing: dict[str, Any]) -> None:
    scenario = SHORT.with_changes(timing=timing, seed=5)
    assert_the_same_flight(stepped(scenario), quadcosim.run(scenario))


def test_a_run_that_diverges_is_over_when_it_does() -> None:
    far = SHORT.with_changes(parameters={"plant.initial.position.x": 90.0, "plant.initial.velocity.x": 100.0})
    found = stepped(far)
    assert found.divergence is not None
    assert_the_same_flight(found, quadcosim.run(far))


def test_each_run_has_its_seed_and_its_values() -> None:
    noisy = SHORT.with_changes(timing={"noise": {"position": 0.01}})
    found = stepped(noisy, seed=7, values={"plant.initial.position.x": 1.0})
    expected = noisy.with_changes(seed=7, parameters={"plant.initial.position.x": 1.0})
    assert_the_same_flight(found, quadcosim.run(expected))


def test_a_run_that_is_left_leaves_nothing_to_the_next() -> None:
    expected = stepped(SHORT)
    before = threading.active_count()
    with Simulation(SHORT, initial=initial(SHORT)) as simulation:
        simulation.reset(values={"plant.initial.position.x": 3.0})
        simulation.step([9.0, 0.1, 0.1, 0.1])
        measured = simulation.reset()
        while not simulation.is_over:
            measured = simulation.step(dict(zip(simulation.commanded, law(simulation.time, measured))))
        assert simulation.result.rows.tobytes() == expected.rows.tobytes()
        simulation.reset()
    assert threading.active_count() == before


def test_hover_stands_until_the_first_command_arrives_or_what_is_given() -> None:
    late = SHORT.with_changes(timing={"delay": 0.03}, plant={"mass": 2.0}, model_mismatch=True)
    given = dict(zip(("thrust", "torque.x", "torque.y", "torque.z"), (9.0, 0.1, 0.2, 0.3)))
    for command, expected in ((None, [2.0 * 9.81, 0.0, 0.0, 0.0]), (given, [*given.values()])):
        with Simulation(late, initial=command) as simulation:
            simulation.reset()
            while not simulation.is_over:
                simulation.step([1.0, 0.0, 0.0, 0.0])
            thrust, *torque = (simulation.result.signals[f"plant.{name}"] for name in given)
        assert np.transpose([thrust, *torque])[:6].tolist() == [expected] * 6
        assert thrust[6] == 1.0
    with pytest.raises(UsageError, match=r"^initial: expected 4 numbers: thrust, torque.x"):
        Simulation(late, initial=[1.0])


def test_inputs_of_a_system_keep_their_start_values_until_the_first_command() -> None:
    late = SHORT.with_changes(timing={"delay": 0.03}, plant={"mass": 2.0}).as_system()
    *others, command = late.connections
    scaled = replace(late, connections=(*others, replace(command, scale=2.0, offset=1.0)))
    with Simulation(scaled) as simulation:
        simulation.reset()
        assert simulation.values["plant.thrust"] == 9.81
        assert simulation.step([0.0] * 4).shape == (13,)
        assert simulation.values["plant.thrust"] == 9.81
    gust = replace(command, name="gust", start=("controller.thrust",), end=("plant.external_force.x",))
    with (
        Simulation(replace(late, connections=(*late.connections, gust))) as simulation,
        pytest.raises(UsageError, match=r"^initial: expected a command: controller.thrust goes to plant.thrust and"),
    ):
        simulation.reset()


def test_a_plant_can_be_replaced_too() -> None:
    with Simulation(SHORT, "plant") as simulation:
        assert simulation.measured == ("thrust", "torque.x", "torque.y", "torque.z")
        hover = {name: float(name == "quaternion.w") for name in simulation.commanded}
        command = simulation.reset()
        while not simulation.is_over:
            command = simulation.step(hover)
        assert command.shape == (4,)
        assert simulation.result.metrics["position_max"] == pytest.approx(
            np.abs(np.linalg.norm([simulation.result.signals[f"reference.position.{x}"] for x in "xyz"], axis=0)).max()
        )


def test_what_is_measured_and_all_values_of_now_are_there() -> None:
    with Simulation(SHORT) as simulation:
        measured = simulation.reset()
        measured = simulation.step([12.0, 0.0, 0.0, 0.0])
        now = simulation.values
        assert simulation.time == now["time"] == 0.02
        assert measured.tolist() == [now[f"plant.{name}"] for name in simulation.measured]
        assert now["controller.thrust"] == now["plant.thrust"] == 12.0


def test_the_last_measurement_is_that_of_the_end() -> None:
    with Simulation(SHORT) as simulation:
        measured = simulation.reset()
        while not simulation.is_over:
            measured = simulation.step([9.81, 0.0, 0.0, 0.0])
        last = simulation.result.rows[-1]
        columns = simulation.result.columns
        assert measured.tolist() == [last[columns.index(f"plant.{name}")] for name in simulation.measured]


COMMANDS: list[tuple[Any, str]] = [
    ([1.0, 2.0], r"^command: expected 4 numbers: thrust, torque.x, torque.y, torque.z$"),
    (None, r"^command: expected 4 numbers"),
    ("up", r"^command: expected 4 numbers"),
    ([[1.0, 2.0], [3.0]], r"^command: expected 4 numbers"),
    ([1.0, float("nan"), 0.0, 0.0], r"^command: torque.x = nan: expected a finite number$"),
    ({"thrust": 1.0}, r"^command: torque.x: expected values of thrust, torque.x, torque.y, torque.z$"),
    ({"thrus": 1.0}, r"^command: thrus: expected values of thrust"),
]


@pytest.mark.parametrize(("command", "message"), COMMANDS)
def test_a_command_that_is_none_is_refused_and_the_run_goes_on(command: Any, message: str) -> None:
    with Simulation(SHORT) as simulation:
        simulation.reset()
        with pytest.raises(UsageError, match=message):
            simulation.step(command)
        simulation.step([9.81, 0.0, 0.0, 0.0])
        assert simulation.time == 0.02


def test_steps_without_a_run_and_components_that_are_none_are_refused() -> None:
    for wrong in ("wing", 3):
        with pytest.raises(UsageError, match=rf"^component: {wrong}: expected one of plant, controller$"):
            Simulation(SHORT, wrong)  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"^timing.clock = fmu: expected master: your code has no clock$"):
        Simulation(SHORT.with_changes(timing={"clock": "fmu"}))
    with Simulation(SHORT) as simulation:
        with pytest.raises(UsageError, match=r"^step: no run is under way; expected reset before it$"):
            simulation.step([0.0] * 4)
        simulation.reset(values={"stop_time": 0.02})
        simulation.step([9.81, 0.0, 0.0, 0.0])
        with pytest.raises(
            UsageError, match=r"^step: the run is over, at its end, t = 0.02 s; expected reset before it$"
        ):
            simulation.step([0.0] * 4)
    with Simulation(SHORT) as simulation:
        with pytest.raises(UsageError, match=r"^result: the run is not over; expected it after the last step$"):
            _ = simulation.result
        with pytest.raises(UsageError, match=r"^no run is under way; expected reset before$"):
            _ = simulation.values
        with pytest.raises(UsageError, match=r"^plant.mass = -1.0: expected at least"):
            simulation.reset(values={"plant.mass": -1.0})
        with pytest.raises(UsageError, match=r"^values: expected those of a run of the same FMUs"):
            simulation.reset(values={"controller.fmu": "CascadedController"})
        with pytest.raises(UsageError, match=r"^seed = 0.5: expected a whole number"):
            simulation.reset(seed=0.5)  # type: ignore[arg-type]


def test_what_an_fmu_refuses_is_raised_where_the_run_is_begun() -> None:
    nowhere = {f"plant.initial.quaternion.{axis}": 0.0 for axis in "xyzw"}
    with Simulation(SHORT) as simulation:
        with pytest.raises(quadcosim.QuadcosimError, match="quaternion"):
            simulation.reset(values=nowhere)
        assert simulation.reset().shape == (13,)
