"""Vehicles: what their files may contain, which value takes precedence, and that one law controls them all alike."""

import dataclasses
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadcosim
from orchestration.command.cli import main
from orchestration.command.flags import FlightFlags, request_from
from orchestration.components.building.fmus import locate
from orchestration.quadrotor.scenarios.vehicle import load_vehicle, names
from orchestration.quadrotor.scenarios.wiring import RIGID_BODY
from orchestration.systems.system.vehicle import Vehicle
from quadcosim import Scenario, Timing, UsageError, load_scenario

HEAVY = """
[plant]
mass = 2.0
motor = { thrust_max = 9.0, arm.x = 0.2 }
[controller]
mass = 2.0
gravity = 9.8
[controllers.UnifiedController]
gain.theta = 30.0
"""


@pytest.fixture
def heavy(tmp_path: Path) -> str:
    path = tmp_path / "heavy.toml"
    path.write_text(HEAVY, encoding="utf-8")
    return str(path)


def parameters(scenario: Scenario | Any) -> tuple[Any, Any]:
    resolved = scenario.resolved()
    return resolved.plant.parameters, resolved.controller.parameters


def test_a_vehicle_gives_plant_and_controller_its_parameters(heavy: str) -> None:
    plant, controller = parameters(Scenario(vehicle=load_vehicle(heavy, Path())))
    assert plant == {"mass": 2.0, "motor.thrust_max": 9.0, "motor.arm.x": 0.2}
    assert controller == {"mass": 2.0, "gravity": 9.8, "gain.theta": 30.0}


@pytest.mark.parametrize("fmu", ["native/UnifiedController", "there/UnifiedController.fmu"])
def test_what_is_for_one_controller_is_for_it_however_it_is_packed(heavy: str, fmu: str) -> None:
    assert "gain.theta" in load_vehicle(heavy, Path()).for_controller(fmu)


def test_what_is_for_an_fmu_of_one_s_own_is_named_by_its_path_from_the_vehicle_file(heavy: str, tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    shutil.copy(locate("GeometricController"), tmp_path / "own" / "Mine.fmu")
    with Path(heavy).open("a", encoding="utf-8") as file:
        file.write('[controllers."own/Mine.fmu"]\ngain_scaling = "inertia"\n')
    vehicle = load_vehicle("heavy.toml", tmp_path)
    assert vehicle.for_controller(str(tmp_path / "own" / "Mine.fmu"))["gain_scaling"] == "inertia"
    assert "gain_scaling" not in vehicle.for_controller("GeometricController")


def test_what_is_for_one_controller_is_for_no_other(heavy: str) -> None:
    assert load_vehicle(heavy, Path()).for_controller("GeometricController") == {"mass": 2.0, "gravity": 9.8}


def test_the_scenario_has_the_last_word_and_a_flag_beyond_it(heavy: str, tmp_path: Path) -> None:
    file = tmp_path / "scenario.toml"
    file.write_text('vehicle = "heavy.toml"\n[plant]\nmass = 3.0\n', encoding="utf-8")
    plant, controller = parameters(load_scenario(file))
    assert (plant["mass"], plant["motor.arm.x"], controller["mass"]) == (3.0, 0.2, 2.0)
    flagged = request_from(file, FlightFlags(vehicle="agilicious", set=["controller.mass=4"]))
    plant, controller = parameters(flagged)
    assert (plant["mass"], plant["motor.arm.x"], controller["mass"]) == (3.0, 0.075, 4.0)  # and nothing of heavy.toml
    assert "gravity" not in controller


def test_a_scenario_is_written_out_with_the_parameters_of_its_vehicle(heavy: str, tmp_path: Path) -> None:
    scenario = Scenario(vehicle=load_vehicle(heavy, Path()))
    (tmp_path / "written.toml").write_text(scenario.to_toml(), encoding="utf-8")
    assert load_scenario(tmp_path / "written.toml") == scenario.resolved()


def test_vehicles_by_name_are_those_that_are_shipped() -> None:
    assert names() == ["agilicious", "crazyflie", "hummingbird", "paper"]


@pytest.mark.parametrize("name", names())
def test_a_controller_has_the_parameters_of_the_body_of_its_plant(name: str) -> None:
    plant, controller = parameters(Scenario(vehicle=load_vehicle(name, Path())))
    values_by_target = {
        f"{side}.{key}": values[key]
        for side, values in (("plant", plant), ("controller", controller))
        for key in RIGID_BODY
        if key in values
    }
    assert len(values_by_target) == 8
    assert Scenario().mismatches(values_by_target) == ()


def ideal(vehicle: Vehicle) -> Vehicle:
    """Without motors, in a wind that moves it as the paper's moves 1 kg."""
    wind = {f"wind.amplitude.{axis}": 0.01 * float(vehicle.plant["mass"]) for axis in "xyz"}
    return dataclasses.replace(vehicle, plant={**vehicle.plant, "motor.thrust_max": 0.0, **wind})


def path_of(vehicle: Vehicle, period: float) -> Any:
    """P every millisecond for a second."""
    scenario = Scenario(stop_time=1.0, timing=Timing(period=period, plant_interval=period), vehicle=ideal(vehicle))
    flown = quadcosim.run(scenario.with_fmus(plant="native/QuadrotorPlant", controller="native/UnifiedController"))
    every = round(1e-3 / period)
    return np.column_stack([flown.signals[f"plant.position.{axis}"] for axis in "xyz"])[::every]


def test_ideal_flights_of_all_vehicles_are_the_same_path() -> None:
    """In continuous time: Ω × JΩ held over a period T differs with J, by an error of first order in T."""
    coarse, fine = ([path_of(load_vehicle(name, Path()), T) for name in names()] for T in (1e-3, 5e-4))
    for i in range(1, len(fine)):
        apart = np.abs(fine[i] - fine[0]).max()
        assert np.abs(coarse[i] - coarse[0]).max() == pytest.approx(2.0 * apart, rel=0.02)
        np.testing.assert_allclose(2.0 * fine[i] - coarse[i], 2.0 * fine[0] - coarse[0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[motor]\nx = 1.0", "motor: expected the tables [plant], [controller] and [controllers.NAME] only"),
        (
            "[controler]\nmass = 1.0",
            "controler: expected the tables [plant], [controller] and [controllers.NAME] only; did you mean "
            "controller?",
        ),
        ("plant = 1.0", "plant: expected the tables"),
        (
            "[controllers.UnifiedControler]\ngain_scaling = 'inertia'",
            "controllers.UnifiedControler: no controller of this project; did you mean UnifiedController? expected one "
            "of UnifiedController, GeometricController, CascadedController, or the path of an .fmu file",
        ),
        ("[controllers.QuadrotorPlant]\nmass = 2.0", "controllers.QuadrotorPlant: no controller of this project"),
        (
            "[controllers.GeometricController]\ngain_scalin = 'inertia'",
            "controllers.GeometricController.gain_scalin: GeometricController has no such variable; did you mean "
            "gain_scaling or gain_scaling_index?",
        ),
        (
            "[controllers.GeometricController]\ngain_scaling = 'weight'",
            "controllers.GeometricController.gain_scaling = weight: expected ",
        ),
        (
            "[controllers.'own/Missing.fmu']\nmass = 2.0",
            "fmu = ",
        ),
        ("[controllers]\ngain = 1.0", "controllers.gain: expected a table [controllers.NAME], NAME that of an FMU"),
        ("[plant]\nmass = [1.0]", "plant.mass = [1.0]: expected a number, true, false or a text"),
        ("[plant", "expected TOML"),
    ],
)
def test_a_file_that_is_no_vehicle_is_refused_in_a_line(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UsageError) as refused:
        load_vehicle("wrong.toml", tmp_path)
    assert str(refused.value).startswith(f"{path}: {words}")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            "crazyfly",
            "vehicle crazyfly: did you mean crazyflie? expected one of agilicious, crazyflie, hummingbird, paper, or",
        ),
        ("nowhere.toml", "nowhere.toml: expected a readable vehicle file: no such file or directory"),
    ],
)
def test_a_vehicle_that_is_not_there_is_refused(given: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["run", "--vehicle", given])
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(f"quadcosim: {words}")


def test_a_parameter_that_the_fmu_lacks_is_refused_by_name(heavy: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path(heavy).write_text("[plant]\nwings = 2.0", encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["run", "--vehicle", heavy])
    assert "plant.wings: QuadrotorPlant has no such variable" in capsys.readouterr().err
