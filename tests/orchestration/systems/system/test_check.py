"""A system against the model descriptions of its FMUs: one line for each error, before any FMU is loaded."""

from pathlib import Path

import pytest

from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.results import objectives
from orchestration.systems.system.check import check, recorded_variables
from orchestration.systems.system.file import load_system
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from tests.orchestration.systems.system.described import described

TANK = Path(__file__).with_name("test_check.toml").read_text(encoding="utf-8")


def checked(folder: Path, text: str) -> dict[str, tuple[str, ...]]:
    """What is recorded of each component."""
    described(
        folder, "Tank", inputs={"valve": "Real", "inflow": "Real"},
        outputs={"level": "Real m", "name": "String", "count": "Integer", "flow.x": "Real", "flow.y": "Real"},
        parameters={"area": "Real", "rough": "Boolean", "pipes": "Integer"},
    )  # fmt: skip
    described(
        folder, "Controller", inputs={"level": "Real m", "height": "Real mm", "on": "Boolean"},
        outputs={"valve": "Boolean"},
    )  # fmt: skip
    (folder / "system.toml").write_text(text)
    system = load_system(folder / "system.toml")
    models = {name: read_model(Path(component.fmu)) for name, component in system.components.items()}
    check(system, models)
    recorded = recorded_variables(system, models)
    signals = {f"{name}.{each}" for name, variables in recorded.items() for each in variables}
    objectives.with_available_objectives(system, signals, set())
    return recorded


def test_a_valid_system_is_accepted(tmp_path: Path) -> None:
    checked(tmp_path, TANK)


@pytest.mark.parametrize(
    ("chosen", "recorded"), [([], ["level", "flow.x", "flow.y"]), (["flow.y"], ["flow.y", "level", "flow.x"])]
)
def test_a_vector_in_an_expression_is_recorded_whole_whatever_is_chosen(
    chosen: list[str], recorded: list[str], tmp_path: Path
) -> None:
    text = TANK.replace("step = 0.01", f"step = 0.01\nrecord = {chosen}").replace("tank.level)", "norm(tank.flow))")
    assert checked(tmp_path, text)["tank"] == (*recorded,)


def test_an_input_of_a_sampled_component_is_recorded_where_it_is_named_and_a_source_by_its_own_name(
    tmp_path: Path,
) -> None:
    assert "level" in checked(tmp_path, TANK.replace("tank.level)", "tank.level - controller.level)"))["controller"]
    with pytest.raises(UsageError, match=r"tank.inflow is no signal of a run: expected rain.inflow, the source that"):
        checked(tmp_path, TANK.replace("tank.level)", "tank.inflow)"))


@pytest.mark.parametrize("stated", ["scale = 1.0", "offset = 0.0", "scale = 1000.0"])
def test_units_may_differ_where_a_conversion_is_stated(stated: str, tmp_path: Path) -> None:
    differing = TANK.replace('["controller.level"]', '["controller.height"]')
    with pytest.raises(UsageError, match=r"connections.level: tank.level is in m, controller.height in mm; expected "):
        checked(tmp_path, differing)
    converted = differing.replace('["controller.height"]', f'["controller.height"]\n{stated}')
    checked(tmp_path, converted)
    checked(tmp_path, load_system(tmp_path / "system.toml").to_toml())
    checked(tmp_path, changed(system_of(tmp_path, differing), {"connections.level.scale": 1.0}).to_toml())


@pytest.mark.parametrize("kind", ["constant = 1.0", 'file = "rain.csv"', "noise = 1.0\nperiod = 0.1"])
def test_a_source_that_feeds_nothing_is_rejected(kind: str, tmp_path: Path) -> None:
    rest = TANK.replace('to = ["tank.inflow"]\n', "")
    with pytest.raises(UsageError, match=r"^sources.rain.to = nothing: expected inputs; only a motion may feed none$"):
        checked(tmp_path, rest.replace("constant = 1.0", kind))
    checked(tmp_path, rest.replace("constant = 1.0", 'signal = "circle"'))


def system_of(folder: Path, text: str) -> System:
    (folder / "system.toml").write_text(text)
    return load_system(folder / "system.toml")


@pytest.mark.parametrize(
    ("right", "wrong", "place", "valid"),
    [
        ("area =", "aria =", "components.tank.parameters.aria: ", "area"),
        ("area = 2.0", "level = 2.0", "components.tank.parameters.level: ", "expected a parameter"),
        ("area = 2.0", "valve = 2.0", "components.tank.parameters.valve: is connected; ", "expected a parameter,"),
        ("area = 2.0", 'area = "big"', "components.tank.parameters.area = big: ", "expected a number"),
        ("rough = true", "rough = 1.5", "components.tank.parameters.rough = 1.5: ", "expected true or false"),
        ("rough = true", "pipes = 1.5", "components.tank.parameters.pipes = 1.5: ", "expected a whole number"),
        ('["valve"]\n', '["vale"]\n', "components.controller.record: ", "did you mean valve?"),
        ('["tank.level"]', '["tank.leval"]', "connections.level.from: Tank has no output leval; ", "level"),
        ('["tank.level"]', '["tank.inflow"]', "connections.level.from: tank.inflow is an input; ", "an output: level"),
        ('["tank.level"]', '["tank.name"]', "connections.level.from: tank.name is a String; ", "can be connected"),
        ('["controller.level"]', '["controller.levl"]', "connections.level.to: Controller has no input levl; ",
         "level"),
        ('["controller.level"]', '["controller.valve"]', "connections.level.to: controller.valve is an output; ",
         "expected an input: level"),
        ('["controller.level"]', '["controller.on"]', "connections.level: tank.level is a Real, controller.on a ",
         "expected Real"),
        ('["controller.level"]', '["controller.height"]', "connections.level: tank.level is in m, controller.height in "
         "mm; ", "scale = 1000"),
        ('["tank.inflow"]', '["tank.inflw"]', "sources.rain.to: Tank has no input inflw; ", "inflow"),
        ('["tank.inflow"]', '["tank.level"]', "sources.rain.to: tank.level is an output; ", "an input: valve, inflow"),
        ("peak =", "outcome =", "objectives.outcome: every run has a result of that name", "expected another"),
        ("peak =", "stop_time =", "objectives.stop_time: that name has another meaning in", "expected another"),
        ("tank.level > 5", "tank.level", "criterion.diverged: tank.level is a Real; ", "as in tank.level > 1"),
        ("max(tank.level)", "max(tank.levl)", "objectives.peak: there is no tank.levl; ", "did you mean tank.level"),
    ],
)  # fmt: skip
def test_one_error_is_one_line_with_its_place_and_what_is_valid(
    right: str, wrong: str, place: str, valid: str, tmp_path: Path
) -> None:
    assert right in TANK
    with pytest.raises(UsageError) as refused:
        checked(tmp_path, TANK.replace(right, wrong, 1))
    line = str(refused.value)
    assert line.startswith(place)
    assert valid in line
    assert line.isprintable()
