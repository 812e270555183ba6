"""The SSP as other tools read it: what they fly is the scenario, its parameters included."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from orchestration.interop.catalogue import Tool, chosen
from orchestration.interop.compare import Agreement, agreements
from orchestration.interop.table import AIM, agrees
from orchestration.requests.ssp import writing
from orchestration.system.model import System
from quadcosim import Scenario, load_scenario
from tests.orchestration.interop.common import LOOP, farthest, states_of_master, with_other_parameters

FROM_SSP = ("libcosim, SSP", "ecos, SSP", "fmpy, SSP")


def one_of_each() -> list[Tool]:
    """A way of each tool that flies both, by the SSP where there is such a way."""
    return chosen([*FROM_SSP, "fmucontainer"], LOOP.ports)


@pytest.fixture(scope="module")
def other(paper: Scenario) -> Scenario:
    """Two seconds with parameters that are not the defaults."""
    return with_other_parameters(paper.with_changes(stop_time=2.0, timing={"plant_interval": 0.01}))


@pytest.fixture(scope="module")
def others(other: Scenario) -> list[Agreement]:
    return agreements(other, chosen(None, LOOP.ports))


def test_every_tool_flies_the_parameters_of_the_scenario(others: list[Agreement]) -> None:
    assert [agreement.tool.name for agreement in others] == [tool.name for tool in chosen(None, LOOP.ports)]
    for agreement in others:
        assert farthest(agreement, agreement.same_start) <= AIM, agreement.tool.name


def test_the_defaults_would_have_been_seen(paper: Scenario, other: Scenario) -> None:
    """That the flight of each tool is this one, and not the one of the default parameters."""
    defaults = paper.with_changes(stop_time=2.0, timing={"plant_interval": 0.01})
    apart = np.abs(states_of_master(other) - states_of_master(defaults)).max(axis=0)
    assert apart.min() > 1e-2


def test_each_tool_takes_the_parameters_from_the_ssp(
    other: Scenario, paper: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Given an SSP with the default parameters, they all fly those."""
    write = writing.write

    def without_parameters(system: System, path: Path) -> Path:
        defaults = paper.with_changes(timing={"plant_interval": 0.01}, stop_time=2.0)
        fmus = {side: Path(system.components[side].fmu) for side in ("plant", "controller")}
        return write(defaults.with_fmus(**fmus), path)

    monkeypatch.setattr(writing, "write", without_parameters)
    for agreement in agreements(other, chosen(FROM_SSP, LOOP.ports)):
        assert farthest(agreement, agreement.same_start) > 1e-2, agreement.tool.name
        assert not agrees(agreement)


def test_fmus_of_any_name_in_any_folder_with_parameters_of_every_type(
    odd_plant: Path, built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a scenario file that is named relative to where the command is started, as are its FMUs."""
    folder = tmp_path / "my flights" / "später"
    folder.mkdir(parents=True)
    shutil.copyfile(odd_plant, folder / "plant.fmu")
    shutil.copyfile(built["UnifiedController"], folder / "Größerer Regler.fmu")
    (folder / "flight.toml").write_text(FLIGHT, encoding="utf-8")
    monkeypatch.chdir(folder.parent)
    scenario = load_scenario(Path("später") / "flight.toml")
    for agreement in agreements(scenario, one_of_each()):
        assert farthest(agreement, agreement.same_start) <= AIM, agreement.tool.name
    empty = scenario.with_changes(parameters={"plant.cargo": 0})
    apart = np.abs(states_of_master(scenario) - states_of_master(empty)).max(axis=0)
    assert apart.max() > 1e-3


FLIGHT = """
stop_time = 0.3
[controller]
fmu = "Größerer Regler.fmu"
use_reference_inputs = false
[plant]
fmu = "plant.fmu"
mass = 1
cargo = 3
loaded = true
[timing]
plant_interval = 0.01
[record]
plant = ["tilt"]
controller = ["energy"]
"""


def test_a_lag_and_a_late_first_sample_depend_on_the_inputs_of_initialisation(short: Scenario) -> None:
    """The actuators start at the command that they find as it ends; the first command is held to the first sample."""
    scenario = short.with_changes(
        parameters={"plant.actuator_time_constant": 0.05}, timing={"period": 0.02, "offset": 0.05}, stop_time=0.4
    )
    for agreement in agreements(scenario, one_of_each()):
        assert farthest(agreement, agreement.same_start) <= AIM, agreement.tool.name


def test_a_redesign_given_by_the_integer_beside_its_enumeration_flies_in_every_tool(short: Scenario) -> None:
    """libcosim and ecos leave the Enumeration itself as it starts."""
    redesign = {"controller.discretisation_index": 4, "controller.stages": 2}
    scenario = short.with_changes(parameters=redesign, timing={"period": 0.05, "plant_interval": 0.01}, stop_time=0.4)
    explicit = short.with_changes(timing={"period": 0.05, "plant_interval": 0.01}, stop_time=0.4)
    assert np.abs(states_of_master(scenario) - states_of_master(explicit)).max() > 1e-3
    for agreement in agreements(scenario, chosen(FROM_SSP, LOOP.ports)):
        assert farthest(agreement, agreement.same_start) <= AIM, agreement.tool.name
