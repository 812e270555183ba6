"""Values of a system by path, as axes, flags and operating points name them."""

import dataclasses
import pickle
from pathlib import Path

import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.systems.system.computers import Computer, Task
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed, value_at

CHANGES = {
    "stop_time": 5.0,
    "seed": 7,
    "components.plant.step": 0.002,
    "components.controller.sampling.period": 0.02,
    "components.controller.parameters.gain.eta": 12.0,
    "connections.command.delay": 0.003,
    "connections.command.hold": "first",
    "connections.measurement.noise.position.x": 0.01,
}


@pytest.mark.parametrize(("path", "value"), CHANGES.items())
def test_a_change_by_path_changes_nothing_else(path: str, value: object) -> None:
    system = changed(quadrotor(), {path: value})
    assert value_at(system, path) == value != value_at(quadrotor(), path)
    others = [other for other in CHANGES if other != path]
    assert [value_at(system, other) for other in others] == [value_at(quadrotor(), other) for other in others]


def test_values_at_rest_are_changed_by_path_beside_each_other_and_the_systems_own_are_not() -> None:
    gain, own = "components.controller.parameters.gain.eta", 12.0
    system = changed(quadrotor(), {gain: own})
    assert value_at(system, f"operating_point.{gain}") == own
    rested = changed(system, {f"operating_point.{gain}": 11.0, "operating_point.after": 3.0})
    assert rested.operating_point == {**system.operating_point, gain: 11.0, "after": 3.0}
    assert (value_at(rested, f"operating_point.{gain}"), value_at(rested, gain)) == (11.0, own)
    with pytest.raises(UsageError, match=r"operating_point\.components\.controler\.step: expected .*mean controller"):
        changed(system, {"operating_point.components.controler.step": 1.0})


DRAWN = Distribution(uniform=(0.0, 0.002))


@pytest.mark.parametrize("written", ["{uniform=[0.0,0.002]}", {"uniform": [0.0, 0.002]}, DRAWN])
@pytest.mark.parametrize("path", ["connections.command.delay", "components.controller.sampling.jitter"])
def test_a_distribution_is_given_as_a_table_or_its_text(path: str, written: object) -> None:
    assert value_at(changed(quadrotor(), {path: written}), path) == DRAWN


def test_the_execution_time_of_a_task_takes_a_distribution() -> None:
    load = System(stop_time=1.0, computers={"c": Computer(tasks={"t": Task(period=0.01)})})
    path = "computers.c.tasks.t.execution"
    assert value_at(changed(load, {path: "{uniform=[0.0,0.002]}"}), path) == DRAWN


@pytest.mark.parametrize(
    ("path", "written", "line"),
    [
        ("connections.command.delay", "{unifrm=[0,1]}", "connections.command.delay.unifrm: no such key; expected one"),
        (
            "connections.command.delay",
            "{uniform=[1,0]}",
            "connections.command.delay.uniform = [1.0, 0.0]: expected two",
        ),
        ("connections.command.delay", "{uniform=[0,", "connections.command.delay = {uniform=[0,: expected TOML: "),
        (
            "connections.command.delay",
            "late",
            "connections.command.delay = late: expected zero or a positive number, or",
        ),
        (
            "connections.command.delay",
            "1ms",
            "connections.command.delay = 1ms: expected zero or a positive number without its unit, or a table that "
            "says how it is distributed, as {uniform = [0.001, 0.004]}; times are in seconds",
        ),
        ("components.plant.step", "1ms", "components.plant.step = '1ms': expected a positive number without its unit;"),
        ("components.plant.step", "{uniform=[0,1]}", "components.plant.step = '{uniform=[0,1]}': expected a positive"),
    ],
)
def test_an_invalid_table_is_rejected_in_one_line_with_its_path(path: str, written: str, line: str) -> None:
    with pytest.raises(UsageError) as refused:
        changed(quadrotor(), {path: written})
    assert str(refused.value).startswith(line)
    assert str(refused.value).isprintable()


def test_several_changes_are_made_at_once() -> None:
    system = changed(quadrotor(), CHANGES)
    assert {path: value_at(system, path) for path in CHANGES} == CHANGES
    once = {"components.controller.sampling.period": 0.5, "components.controller.sampling.jitter": 0.4}
    sampling = changed(quadrotor(), once).components["controller"].sampling
    assert sampling is not None
    assert sampling.jitter == 0.4  # more than the period there was


@pytest.mark.parametrize(
    ("path", "line"),
    [
        ("stop", "stop: "),
        ("component.plant.step", "component.plant.step: "),
        ("components.plan.step", "components.plan"),
        ("criterion.good", "criterion.good: is set in the file only; expected "),
        ("order", "order: is set in the file only; expected "),
        ("components.plant.interface", "components.plant.interface: is set in the file only; expected "),
        ("components.plant.parameters", "components.plant.parameters: is a table of several values; expected "),
        ("connections.command.from", "connections.command.from: is set in the file only; expected "),
        ("components.controller.step", "components.controller.step: no such key"),
        ("components.plant.stepp", "components.plant.stepp: "),
        ("components.plant.sampling.period", "components.plant.sampling"),
        ("components.controller.sampling.perod", "components.controller.sampling.perod: "),
        ("connections.commnd.delay", "connections.commnd"),
        ("connections.command.dela", "connections.command.dela: "),
        ("sources.wind.noise", "sources.wind"),
    ],
)
def test_a_path_that_does_not_exist_is_rejected_in_one_line(path: str, line: str) -> None:
    with pytest.raises(UsageError) as refused:
        changed(quadrotor(), {path: 1.0})
    assert str(refused.value).startswith(line)
    assert "expected" in str(refused.value)
    assert str(refused.value).isprintable()


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("components.plant.step", -1.0),
        ("components.plant.step", "fast"),
        ("components.controller.sampling.period", 0.0),
        ("connections.command.loss", 2.0),
        ("connections.command.hold", "last"),
        ("components.plant.record", "tilt"),
        ("sources.reference.to", "plant.mass"),
        ("seed", 1.5),
        ("stop_time", 0.0),
    ],
)
def test_an_invalid_value_is_rejected_with_its_path(path: str, value: object) -> None:
    with pytest.raises(UsageError, match=rf"^{path} = .*: expected"):
        changed(quadrotor(), {path: value})


@pytest.mark.parametrize("value", [-1, 2**63, True, "7"])
def test_a_seed_beside_parameters_is_checked(value: object) -> None:
    with pytest.raises(UsageError, match=r"^seed = .*: expected a whole number"):
        changed(quadrotor(), {"seed": value, "components.plant.parameters.mass": 1.5})


@pytest.mark.parametrize("given", [1.5, 2, "1.5", True])
def test_a_system_with_changed_parameters_and_seed_equals_one_made_with_them(given: float | str) -> None:
    """A change of numbers only is not checked again, and gives the same system, with types and order."""
    changes = {"components.plant.parameters.mass": given, "components.controller.parameters.gain.eta": 12.0, "seed": 7}
    found, components = changed(quadrotor(), changes), dict(quadrotor().components)
    new: dict[str, dict[str, float | str]] = {"plant": {"mass": given}, "controller": {"gain.eta": 12.0}}
    for name, parameters in new.items():
        there = components[name].parameters
        components[name] = dataclasses.replace(components[name], parameters={**there, **parameters})
    made = dataclasses.replace(quadrotor(), components=components, seed=7)
    assert (found, pickle.dumps(dataclasses.asdict(found))) == (made, pickle.dumps(dataclasses.asdict(made)))


def test_ranges_give_whole_seeds_and_the_command_line_gives_files() -> None:
    file = {"sources.reference.trajectory": None, "sources.reference.file": "path.csv"}
    found = changed(quadrotor(), {"seed": 3.0, **file})
    assert (repr(found.seed), found.sources["reference"].file) == ("3", Path("path.csv"))


def test_an_unknown_task_is_reported_with_the_known_ones() -> None:
    load = System(stop_time=1.0, computers={"c": Computer(tasks={"radio": Task(period=0.01)})})
    expected = "expected computers.c.tasks.NAME.KEY with NAME one of radio; did you mean radio?"
    with pytest.raises(UsageError) as refused:
        changed(load, {"computers.c.tasks.radi.period": 1.0})
    assert str(refused.value) == f"computers.c.tasks.radi.period: {expected}"
