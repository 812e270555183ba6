"""One controller, as `quadcosim new` writes it, flies every vehicle, every reference and every comparison unchanged."""

import json
import re
from pathlib import Path

import pytest

from orchestration.components.building import fmus
from orchestration.components.scaffold.folder import write
from orchestration.experiments.comparison.design import Comparison
from orchestration.experiments.comparison.file import load_comparison
from orchestration.quadrotor.scenarios import vehicle
from orchestration.simulation.runs.simulation import run
from orchestration.systems.signals.motions import MOTIONS
from orchestration.systems.system.request import errors_in_own_terms
from quadcosim import FmuChoice, ReferenceChoice, Scenario, UsageError, load_vehicle
from tests.commands import Main


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the controller, native and of the same law one that hears no reference."""
    folder = tmp_path_factory.mktemp("own")
    write("controller", "mine", folder, author="", license="")
    law = (folder / "mine" / "mine.py").read_text()
    deaf = re.sub(r"(target\w*) = Input.*", r"\1 = ZERO", law).replace("class Mine", "class Deaf")
    (folder / "mine" / "deaf.py").write_text(deaf)
    return folder


@pytest.fixture(scope="module")
def scenario(folder: Path) -> Scenario:
    """The first moments of the paper's flight, with the controller."""
    mine = FmuChoice(fmu=str(folder / "mine" / "native" / "Mine.fmu"))
    return Scenario(stop_time=0.3, controller=mine, plant=FmuChoice(fmu="native/QuadrotorPlant"))


@pytest.mark.parametrize("name", vehicle.names())
def test_a_controller_as_written_flies_each_vehicle(scenario: Scenario, name: str) -> None:
    of_vehicle = scenario.with_changes(vehicle=load_vehicle(name, Path()))
    result = run(of_vehicle)
    assert result.parameters["controller.mass"] == result.parameters["plant.mass"]
    assert result.parameters["controller.inertia.zz"] == result.parameters["plant.inertia.zz"]
    assert not result.metrics["diverged"]
    assert not result.warnings


@pytest.mark.parametrize("name", [None, *MOTIONS, "waypoints.csv"])
def test_a_controller_as_written_follows_each_reference(scenario: Scenario, folder: Path, name: str | None) -> None:
    (folder / "waypoints.csv").write_text("x,y,z\n0,0,0\n1,0,-1\n")
    is_file = name is not None and name.endswith(".csv")
    choice = ReferenceChoice(file=folder / name) if name and is_file else ReferenceChoice(name=name)
    result = run(scenario.with_changes(reference=choice))
    what = "the paper's trajectory" if name is None else str(folder / name) if is_file else name
    assert result.provenance["follows"] == f"{what}, fed to Mine as position, velocity, acceleration"
    fed = {name for name in result.signals if name.startswith("reference.acceleration")}
    assert len(fed) == 3


def test_what_it_is_fed_by_itself_is_the_path_that_others_have_built_in(scenario: Scenario) -> None:
    unified = run(scenario.with_changes(controller=FmuChoice(fmu="native/UnifiedController")))
    assert unified.provenance["follows"] == "the trajectory that UnifiedController has built in"
    mine = run(scenario)
    for axis in "xyz":
        name = f"reference.position.{axis}"
        assert mine.signals[name] == pytest.approx(unified.signals[name], abs=1e-12)


def test_one_that_hears_no_reference_is_refused_but_for_rest(scenario: Scenario, folder: Path) -> None:
    deaf = scenario.with_changes(controller=FmuChoice(fmu=str(folder / "mine" / "native" / "Deaf.fmu")))
    expected = (
        "reference: Deaf cannot follow it without the inputs reference.position.x, "
        "reference.position.y, reference.position.z; expected reference hover, for one that holds a point by itself"
    )
    for choice in (ReferenceChoice(), ReferenceChoice(name="circle")):
        with pytest.raises(UsageError) as refused:
            run(deaf.with_changes(reference=choice))
        assert str(refused.value) == expected
    hover = run(deaf.with_changes(reference=ReferenceChoice(name="hover"), stop_time=8.0))
    assert hover.provenance["follows"] == "hover, which Deaf holds by itself"
    assert hover.metrics["good"]


COMPARISON = """
[base]
stop_time = 6.0
timing = {{ plant_interval = 0.004 }}
plant = {{ fmu = "native/QuadrotorPlant" }}

[[controllers]]
name = "the paper's"
fmu = "native/UnifiedController"
bandwidth = 27.0

[[controllers]]
name = "mine"
fmu = "{fmu}"
bandwidth = 19.0

[axis]
name = "period"
sets = ["timing.period"]
values = [0.02, 0.16]

[starts]
count = 4
position = 1.0
velocity = 0.5
angle = 0.5
rate = 0.5
"""


def test_a_comparison_judges_it_as_single_runs_do_by_any_engine(scenario: Scenario, tmp_path: Path, main: Main) -> None:
    file = tmp_path / "comparison.toml"
    file.write_text(COMPARISON.format(fmu=scenario.controller.fmu))
    fmus.locate(scenario.controller.fmu)
    comparison = load_comparison(file)
    alone: dict[int, tuple[int, int]] = {}
    for name, engine in (("usual", ()), ("batch", ("--engine", "batch"))):
        done = main("compare", file, *engine, "--no-figures", "--json", "--out", tmp_path / name)
        found = json.loads(done.stdout)
        assert found["follows"] == [
            "the trajectory that UnifiedController has built in",
            "the paper's trajectory, fed to Mine as position, velocity, acceleration",
        ]
        alone = alone or {cell["cell"]: flown_alone(comparison, cell["cell"]) for cell in found["cells"]}
        assert {cell["cell"]: (cell["survives"], cell["settles"]) for cell in found["cells"]} == alone
        mine = [cell["settles"] for cell in found["cells"] if cell["controller"] == "mine"]
        assert mine == [4, 0]


def flown_alone(comparison: Comparison, cell: int) -> tuple[int, int]:
    """How many starts of a cell survive and settle, each flown as `run` flies a scenario."""
    starts = comparison.study.files().start_values
    with errors_in_own_terms(comparison.base):
        metrics = [
            run(comparison.request(i, starts)).metrics for i in comparison.runs_of(comparison.cell(cell))
        ]  # fmt: skip
    survive = [each for each in metrics if not each["diverged"]]
    return len(survive), sum(each["settling_time"] is not None for each in survive)


def test_fmus_checks_other_masters_and_limits_take_it_as_any_controller(
    scenario: Scenario, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, main: Main
) -> None:
    monkeypatch.chdir(tmp_path)
    mine = scenario.controller.fmu
    flight = ("--controller", mine, "--native", "--stop-time", "0.3")
    fmus.locate(mine)
    assert ": no problems" in main("validate", mine).stdout
    assert main("doctor", mine).returncode == 0
    assert main("ssp", *flight, "--reference", "hover", "--plant-interval", "0.01", "--out", "mine.ssp").stderr == (
        "mine.timing.toml has its timing, for quadcosim run\n"
    )
    grid = ("--plant-interval", "0.01", "--reference", "hover", "--tool", "fmpy, SSP", "--json")
    (other,) = json.loads(main("interop", *flight, *grid).stdout)["tools"]
    assert other["steps"] == 30
    assert json.loads(main("margin", *flight, "--json").stdout)["delay_limit"] > 0.01
    found = json.loads(main("limit", *flight, "--from", "0.01", "--to", "0.02", "--scan", "0.01", "--json").stdout)
    assert found["local_limit"] == pytest.approx(0.111, abs=0.001)
    assert found["follows"] == "the paper's trajectory, fed to Mine as position, velocity, acceleration"
    assert "follows\n  the paper's trajectory, fed to Mine" in main("show", *flight).stdout
    proposed = main("connect", "QuadrotorPlant", mine).stdout
    assert "sampling = { period = 0.01 }    # sampled" in proposed


@pytest.mark.usefixtures("blank_figures")
def test_its_own_system_is_drawn_as_a_flight_and_searched_over_its_period_without_a_word(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, main: Main
) -> None:
    monkeypatch.chdir(tmp_path)
    system = folder / "mine" / "system.toml"
    main("run", system, "--native", "--out", "flown", "--set", "stop_time=0.3")
    assert {path.name for path in Path("flown").glob("*.png")} == {
        "path.png", "errors.png", "components.png", "commands.png",
    }  # fmt: skip
    found = json.loads(main("limit", system, "--native", "--to", "0.01", "--no-figures", "--json").stdout)
    assert (found["of"], found["scan"]) == ("components.controller.sampling.period", 0.005)


STUDY = """
[base]
stop_time = 0.3
vehicle = "hummingbird"
controller = {{ fmu = "{fmu}" }}
plant = {{ fmu = "native/QuadrotorPlant" }}
reference = {{ name = "circle" }}
"""

TUNED = Path(__file__).with_name("tuned.toml").read_text(encoding="utf-8")


def test_studies_and_tunings_take_it_with_vehicle_and_reference(
    scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, main: Main
) -> None:
    monkeypatch.chdir(tmp_path)
    base = STUDY.format(fmu=scenario.controller.fmu)
    Path("study.toml").write_text(
        base + '[[axes]]\nname = "radius"\nsets = ["reference.radius"]\nvalues = [1.0, 2.0]\n'
    )
    swept = json.loads(main("sweep", "study.toml", "--json").stdout)
    assert swept["follows"] == ["circle, fed to Mine as position, velocity, acceleration"]
    assert main("report", "study.toml").stdout.endswith(".html\n")
    Path("tuning.toml").write_text(base + TUNED)
    assert "follows circle, fed to Mine" in main("tune", "tuning.toml", "--out", "gains").stderr
