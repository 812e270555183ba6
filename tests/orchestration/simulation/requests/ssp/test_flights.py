"""The SSP in other tools: they simulate the scenario with its parameters."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from orchestration.simulation.interop.catalogue import Tool, chosen
from orchestration.simulation.interop.compare import TOLERANCE, Agreement, agreements, agrees
from orchestration.simulation.requests.ssp import writing
from orchestration.systems.system.model import System
from quadcosim import Scenario, load_scenario
from tests.extent import in_test_all
from tests.native import NATIVE
from tests.orchestration.simulation.interop.common import LOOP, farthest, states_of_master, with_other_parameters

FROM_SSP = ("libcosim, SSP", "ecos, SSP", "fmpy, SSP")


def one_of_each() -> list[Tool]:
    """A way for each tool to simulate both, by the SSP where possible."""
    return chosen([*FROM_SSP, "fmucontainer"], LOOP.ports)


@pytest.fixture(scope="module")
def defaults(paper: Scenario) -> Scenario:
    """A second of the paper's flight."""
    return paper.with_changes(stop_time=1.0, timing={"plant_interval": 0.01})


@pytest.fixture(scope="module")
def other(defaults: Scenario) -> Scenario:
    """The same flight with parameters that are not the defaults.

    A lag and a late first sample depend on the inputs of initialisation: the actuators start at the command that they
    find as it ends; the first command is held to the first sample.
    """
    late = defaults.with_changes(parameters={"plant.actuator_time_constant": 0.05}, timing={"offset": 0.05})
    return with_other_parameters(late)


@pytest.fixture(scope="module")
def others(other: Scenario) -> list[Agreement]:
    return agreements(other, chosen(None, LOOP.ports))


@in_test_all
def test_every_tool_simulates_the_parameters_of_the_scenario(others: list[Agreement]) -> None:
    assert [agreement.tool.name for agreement in others] == [tool.name for tool in chosen(None, LOOP.ports)]
    for agreement in others:
        assert farthest(agreement, agreement.same_first_inputs) <= TOLERANCE, agreement.tool.name


def test_the_defaults_would_have_been_seen(defaults: Scenario, other: Scenario) -> None:
    """Each tool simulates this flight, and not that of the defaults, of all parameters or of those of times."""
    states = states_of_master(other)
    apart = np.abs(states - states_of_master(defaults)).max(axis=0)
    assert apart.min() > 1e-2
    at_once = other.with_changes(parameters={"plant.actuator_time_constant": 0.0})
    for usual in (at_once, other.with_changes(timing={"offset": 0.0})):
        assert np.abs(states - states_of_master(usual)).max() > 1e-2


def test_each_tool_takes_the_parameters_from_the_ssp(monkeypatch: pytest.MonkeyPatch) -> None:
    """With an SSP of the default parameters, all tools simulate those."""
    write = writing.write
    defaults = NATIVE.with_changes(timing={"plant_interval": 0.01}, stop_time=0.4)

    def without_parameters(system: System, path: Path) -> Path:
        fmus = {side: Path(system.components[side].fmu) for side in ("plant", "controller")}
        return write(defaults.with_fmus(**fmus), path)

    monkeypatch.setattr(writing, "write", without_parameters)
    for agreement in agreements(with_other_parameters(defaults), chosen(FROM_SSP, LOOP.ports)):
        assert farthest(agreement, agreement.same_first_inputs) > 1e-2, agreement.tool.name
        assert not agrees(agreement)


@in_test_all
def test_fmus_of_any_name_in_any_folder_with_parameters_of_every_type(
    odd_plant: Path, built: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a scenario file with a path relative to the current folder, as are its FMUs."""
    folder = tmp_path / "my flights" / "später"
    folder.mkdir(parents=True)
    shutil.copyfile(odd_plant, folder / "plant.fmu")
    shutil.copyfile(built["UnifiedController"], folder / "Größerer Regler.fmu")
    (folder / "flight.toml").write_text(FLIGHT, encoding="utf-8")
    monkeypatch.chdir(folder.parent)
    scenario = load_scenario(Path("später") / "flight.toml")
    for agreement in agreements(scenario, one_of_each()):
        assert farthest(agreement, agreement.same_first_inputs) <= TOLERANCE, agreement.tool.name
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


def test_a_redesign_given_by_the_integer_beside_its_enumeration_runs_in_every_tool() -> None:
    """libcosim and ecos leave the Enumeration itself at its start value."""
    redesign = {"controller.discretisation_index": 4, "controller.stages": 2}
    explicit = NATIVE.with_changes(timing={"period": 0.05, "plant_interval": 0.01}, stop_time=0.4)
    scenario = explicit.with_changes(parameters=redesign)
    assert np.abs(states_of_master(scenario) - states_of_master(explicit)).max() > 1e-3
    for agreement in agreements(scenario, chosen(FROM_SSP, LOOP.ports)):
        assert farthest(agreement, agreement.same_first_inputs) <= TOLERANCE, agreement.tool.name
