"""Units of objectives: from the declarations of the FMUs to the tables of `run` and `show`."""

import json
from pathlib import Path

import pytest

from orchestration.components.building import fmus
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import UsageError
from orchestration.quadrotor.scenarios.translation import quadrotor
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.systems.system.file import load_system
from tests.commands import Main
from tests.orchestration.systems.system.described import described

SYSTEM = Path(__file__).with_name("test_units.toml").read_text(encoding="utf-8")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    described(
        tmp_path, "Car", inputs={"slope": "Real m/s2"}, outputs={"place": "Real m", "speed": "Real", "gear": "Integer"}
    )
    described(tmp_path, "Driver", inputs={"seen": "Real m"}, parameters={"goal": "Real m", "weight": "Real N"})
    (tmp_path / "system.toml").write_text(SYSTEM, encoding="utf-8")
    return tmp_path / "system.toml"


def units(file: Path) -> dict[str, str]:
    system = load_system(file)
    return check_against_fmus(system, {name: read_model(Path(c.fmu)) for name, c in system.components.items()}).units


def test_objectives_have_the_units_of_signals_parameters_sources_and_of_one_another(file: Path) -> None:
    assert units(file) == {
        "far": "m",
        "absement": "m.s",
        "late": "s",
        "climbed": "m/s2",
        "told": "m",
        "horizon": "s",
        "divergence_time": "s",
    }


@pytest.mark.parametrize(
    ("right", "wrong", "line"),
    [
        ("max(car.place)", "max(car.place + driver.weight)",
         "objectives.far: +: car.place is in m, driver.weight is in N; expected one unit, or a number as a factor"),
        ("told < far", "told < absement", "criterion.good: <: told is in m, absement is in m.s; expected one unit"),
        ("> 10 * driver.goal", "> driver.weight", "criterion.diverged: >: abs(car.place) is in m, driver.weight is "),
    ],
)  # fmt: skip
def test_incompatible_units_are_one_line_before_anything_is_loaded(
    right: str, wrong: str, line: str, file: Path, main: Main
) -> None:
    file.write_text(SYSTEM.replace(right, wrong), encoding="utf-8")
    with pytest.raises(UsageError) as refused:
        units(file)
    assert str(refused.value).startswith(line)
    assert main("run", file, code=2).stderr.startswith(f"quadcosim: {line}")


def test_show_has_units_where_the_fmus_exist(file: Path, main: Main) -> None:
    assert "  absement [m.s]  integral(car.place)" in main("show", file).stdout
    assert "  gear            max(" in main("show", file).stdout
    (file.parent / "Car.fmu").unlink()
    assert "  absement  integral(car.place)" in main("show", file).stdout


def test_the_quadrotors_metrics_have_units() -> None:
    system = quadrotor()
    found = check_against_fmus(
        system, {name: read_model(fmus.locate(c.fmu)) for name, c in system.components.items()}
    ).units
    effort = ["control_effort.thrust", "control_effort.torque", "total_variation.thrust", "total_variation.torque"]
    assert [found[name] for name in effort] == ["N2.s", "N2.m2.s", "N", "N.m"]
    assert [found[f"position_{name}"] for name in ("rmse", "iae", "itae", "max")] == ["m", "m.s", "m.s2", "m"]
    assert {found["attitude_error_rmse"], found["attitude_error_max"]} == {"rad"}
    assert {found["energy_growth_share"], found["saturation_share"]} == {"1"}
    assert set(found) == {*system.objectives, "horizon", "divergence_time"}


def test_a_run_prints_and_stores_units(main: Main, tmp_path: Path) -> None:
    lines = main("run", "--stop-time", "0.05", "--no-figures", "--out", tmp_path / "run").stdout.splitlines()
    values = {name: value for name, _, value in (line.partition(" ") for line in lines)}
    assert values["position_iae"].endswith(" m.s")
    assert values["horizon"].split() == ["0.05", "s"]
    assert values["settling_time"].split() == ["-"]
    assert len(values["saturation_share"].split()) == 1
    notes = json.loads((tmp_path / "run" / "provenance.json").read_text())
    assert notes["units"]["position_itae"] == "m.s2"
