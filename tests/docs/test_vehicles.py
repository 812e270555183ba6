"""The page on vehicles: its file loads, its commands end as stated, its numbers are those of the files."""

import json
import re
import shlex
from pathlib import Path

import pytest

from orchestration.command.cli import main
from orchestration.quadrotor.scenarios.vehicle import load_vehicle, names
from tests.places import ROOT

PAGE = (ROOT / "docs" / "vehicles.md").read_text(encoding="utf-8")


def commands() -> list[tuple[str, str, str]]:
    """The commands of the tables, with the outcome of each and the time that it is given for it."""
    found = re.findall(r"^\| `quadcosim (run[^`]*)` \| (settled|diverged)(?:.*?, at|.*?from) ([\d.]+) s", PAGE, re.M)
    return [(command, outcome, time) for command, outcome, time in found]


@pytest.fixture
def _mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle of the page, in the working directory."""
    (text,) = re.findall(r"^```toml mine.toml\n(.*?)^```$", PAGE, re.M | re.S)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")


def test_the_tables_have_their_commands() -> None:
    assert [outcome for _, outcome, _ in commands()].count("settled") == 7
    assert len(commands()) == 11


@pytest.mark.usefixtures("_mine")
@pytest.mark.parametrize(("command", "outcome", "time"), commands())
def test_command_of_the_page_ends_as_it_says(
    command: str, outcome: str, time: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*shlex.split(command), "--native", "--json"])
    printed = capsys.readouterr()
    assert not ended.value.code
    metrics = json.loads(printed.out)
    assert metrics["outcome"] == outcome
    found = metrics["settling_time" if outcome == "settled" else "divergence_time"]
    assert f"{found:.{len(time.partition('.')[2])}f}" == time
    assert ("nominal model is not the plant" in printed.err) is ("--vehicle" not in command)


@pytest.mark.parametrize("name", [name for name in names() if name != "paper"])
def test_the_table_of_vehicles_has_the_figures_of_their_files(name: str) -> None:
    vehicle = load_vehicle(name, Path())
    (row,) = re.findall(rf"^\| `{vehicle.name}` \| (.*) \|$", PAGE, re.M)
    mass, inertia, arms, thrusts, by_weight, drag, lags, _ = row.split(" | ")
    of = {name: float(value) for name, value in vehicle.plant.items()}
    assert float(mass) == of["mass"]
    assert [float(x) for x in inertia.split(", ")] == pytest.approx(
        [1e3 * of[f"inertia.{a}"] for a in ("xx", "yy", "zz")], rel=1e-3
    )
    assert [float(x[1:]) for x in arms.split(", ")] == pytest.approx([of["motor.arm.x"], of["motor.arm.y"]], rel=2e-3)
    assert [float(x) for x in thrusts.split(" to ")] == [of["motor.thrust_min"], of["motor.thrust_max"]]
    assert float(by_weight) == pytest.approx(4.0 * of["motor.thrust_max"] / (9.81 * of["mass"]), abs=0.005)
    assert float(drag) == pytest.approx(of["motor.drag_to_thrust"], rel=2e-3)
    assert [float(x) for x in lags.split(", ")] == [1e3 * of[f"motor.time_constant.{way}"] for way in ("up", "down")]


@pytest.mark.parametrize("intended", [False, True])
def test_flag_says_that_the_mismatch_is_meant(intended: bool, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--set", "plant.mass=1.2", "--stop-time", "0.1", *(["--model-mismatch"] if intended else [])])
    warned = "warning: the controller's nominal model is not the plant: controller.mass = 1 where plant.mass = 1.2."
    assert (warned in capsys.readouterr().err) is not intended
