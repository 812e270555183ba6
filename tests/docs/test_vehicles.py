"""The page on vehicles: its scenario flies, its commands end as it says, and the scaling is what it says."""

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orchestration
from orchestration import Result, Scenario, Timing
from orchestration.command.cli import main
from orchestration.quadrotor.scenario_file import load_scenario

PAGE = (Path(__file__).parents[2] / "docs" / "vehicles.md").read_text(encoding="utf-8")
SHORT = ["--stop-time", "10", "--plant-interval", "0.002", "--json"]
INERTIA = ("inertia.xx", "inertia.yy", "inertia.zz")


def commands() -> list[tuple[str, str]]:
    """The commands of the table, and the outcome of each."""
    return re.findall(r"^\| `quadcosim (run[^`]*)` \| (settled|diverged)", PAGE, re.M)


@pytest.fixture
def vehicle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The scenario of the page, in the working directory."""
    (text,) = re.findall(r"^```toml vehicle.toml\n(.*?)^```$", PAGE, re.M | re.S)
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_table_has_its_commands() -> None:
    assert [outcome for _, outcome in commands()].count("settled") == 3
    assert len(commands()) == 6


@pytest.mark.usefixtures("vehicle")
@pytest.mark.parametrize(("command", "outcome"), commands())
def test_command_of_the_page_ends_as_it_says(command: str, outcome: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = shlex.split(command)
    with pytest.raises(SystemExit) as ended:
        main([*arguments, *SHORT, *(["--plant-interval", "0.001"] if "0.001" in arguments else [])])
    printed = capsys.readouterr()
    assert not ended.value.code
    assert json.loads(printed.out)["outcome"] == outcome
    only_plant_changed = "vehicle.toml" not in arguments
    assert ("nominal model is not the plant" in printed.err) is only_plant_changed


@pytest.mark.parametrize("meant", [False, True])
def test_flag_says_that_the_mismatch_is_meant(meant: bool, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--set", "plant.mass=1.2", "--stop-time", "0.1", *(["--model-mismatch"] if meant else [])])
    warned = "warning: the controller's nominal model is not the plant: controller.mass = 1 where plant.mass = 1.2."
    assert (warned in capsys.readouterr().err) is not meant


def test_scenario_of_the_page_scales_the_gains_of_the_paper_by_its_inertia(vehicle: Path) -> None:
    scenario = load_scenario(vehicle)
    j = scenario.controller.parameters["inertia.xx"]
    gains = {name: scenario.controller.parameters[name] / j for name in ("gain.theta", "gain.attitude", "coupling")}
    assert gains == pytest.approx({"gain.theta": 15.0, "gain.attitude": 15.0, "coupling": 1.0})
    assert all(scenario.plant.parameters[n] == scenario.controller.parameters[n] for n in ("mass", *INERTIA))


def test_gains_per_unit_inertia_fly_the_same_path_with_every_mass_and_inertia() -> None:
    """J = j times the identity, and a wind that accelerates alike."""
    m, j = 3.7, 0.012
    body = {name: m if name == "mass" else j for name in ("mass", *INERTIA)}
    scaled: dict[str, Any] = {
        f"{side}.{name}": value for side in ("plant", "controller") for name, value in body.items()
    }
    scaled |= {"controller.gain.theta": 15.0 * j, "controller.gain.attitude": 15.0 * j, "controller.coupling": j}
    scaled |= {f"plant.wind.amplitude.{axis}": 0.01 * m for axis in "xyz"}

    def fly(parameters: dict[str, Any]) -> Result:
        scenario = Scenario(stop_time=5.0, timing=Timing(period=0.02, plant_interval=0.002))
        return orchestration.run(scenario.with_changes(parameters=parameters))

    paper, own = fly({}), fly(scaled)
    for axis in "xyz":
        name = f"plant.position.{axis}"
        np.testing.assert_allclose(own.signals[name], paper.signals[name], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(own.signals["plant.thrust"], m * paper.signals["plant.thrust"], rtol=1e-11)
    np.testing.assert_allclose(own.signals["controller.energy"], j * paper.signals["controller.energy"], rtol=1e-7)
