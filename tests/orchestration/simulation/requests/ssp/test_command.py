"""The command `quadcosim ssp`: the path of the file, and the scenarios that are rejected."""

import shutil
import zipfile
from pathlib import Path
from typing import Any

import pytest
from fmpy.ssp.ssd import read_ssd

from orchestration.components.building import fmus
from orchestration.simulation.requests.ssp import writing
from quadcosim import Scenario, Timing, UsageError
from tests.commands import Main
from tests.fmus.making import PAIR
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.experiments.studies.common import error_line, one_line, quadcosim
from tests.orchestration.simulation.interop.common import OTHER


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, built: dict[str, Path]) -> Path:
    """A folder to start from, and `fmus/` in it instead of the project's."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fmus").mkdir()
    for path in built.values():
        shutil.copyfile(path, tmp_path / "fmus" / path.name)
    monkeypatch.setattr(fmus, "default_folder", lambda: tmp_path / "fmus")
    return tmp_path


# -- the command ------------------------------------------------------------------------------------------


def test_the_default_is_the_paper_s_flight_in_the_folder_of_the_fmus(here: Path, main: Main) -> None:
    done = main("ssp")
    assert done.stdout == f"{here / 'fmus' / 'QuadrotorLoop.ssp'}\n"
    assert done.stderr == f"{here / 'fmus' / 'QuadrotorLoop.timing.toml'} has its timing, for quadcosim run\n"
    assert (here / "fmus" / "QuadrotorLoop.ssp").read_bytes() == written(Scenario(), here)


def test_flags_and_out_are_those_of_a_flight(here: Path, main: Main) -> None:
    settings = [text for name, value in OTHER.items() for text in ("--set", f"{name}={value}")]
    times = ("--period", "0.02", "--offset", "0.01", "--plant-interval", "0.005", "--stop-time", "2")
    done = main("ssp", *times, *settings, "--out", Path("new") / "loop.ssp")
    assert done.stdout == f"{Path('new') / 'loop.ssp'}\n"
    scenario = Scenario(stop_time=2.0, timing=Timing(period=0.02, offset=0.01, plant_interval=0.005))
    assert (here / "new" / "loop.ssp").read_bytes() == written(scenario.with_changes(parameters=OTHER), here)
    assert not (here / "fmus" / "QuadrotorLoop.ssp").exists()


def test_features_that_an_ssp_lacks_are_warned_of_even_quietly(here: Path, main: Main) -> None:
    message = "timing.delay = 0.005: an SSP cannot express that; only its file with timing does"
    assert main("ssp", "-q", "--delay", "0.005", "--out", "loop.ssp").stderr == f"warning: {message}\n"


def test_a_scenario_file_may_name_fmus_beside_it(here: Path, main: Main) -> None:
    folder = here / "my flights"
    folder.mkdir()
    shutil.copyfile(here / "fmus" / "QuadrotorPlant.fmu", folder / "Größeres Modell.fmu")
    (folder / "flight.toml").write_text(
        'stop_time = 2\n[plant]\nfmu = "Größeres Modell.fmu"\nmass = 1.2\n[record]\nplant = ["tilt"]\n',
        encoding="utf-8",
    )
    main("ssp", folder / "flight.toml", "--set", "plant.gravity=9.8", "--out", "loop.ssp")
    structure = read_ssd(str(here / "loop.ssp"), validate=True)
    sources = {component.name: component.source for component in structure.system.elements}
    assert sources == {"controller": "resources/UnifiedController.fmu", "plant": "resources/Größeres Modell.fmu"}
    with zipfile.ZipFile(here / "loop.ssp") as archive:
        assert archive.read(sources["plant"]) == (here / "fmus" / "QuadrotorPlant.fmu").read_bytes()
        values = archive.read("resources/scenario.ssv").decode()
    assert '<ssv:Parameter name="plant.mass">\n      <ssv:Real value="1.2" unit="kg" />' in values
    assert '<ssv:Parameter name="plant.gravity">\n      <ssv:Real value="9.8" unit="m/s2" />' in values


def test_the_installed_command_writes_it(tmp_path: Path) -> None:
    done = quadcosim("ssp", "--out", "loop.ssp", cwd=tmp_path)
    assert done.stdout == "loop.ssp\n"
    assert read_ssd(str(tmp_path / "loop.ssp"), validate=True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--set", "plant.mas=1"), "plant.mas: QuadrotorPlant has no such variable; did you mean mass?"),
        (("--set", "plant.parameters.mass=1"), "plant.parameters.mass: expected plant.mass, without a table"),
        (("--set", "plant.mass=true"), "plant.mass = True: expected a number"),
        (("--set", "controller.sample_period=0.1"), "controller.sample_period: expected --period and --clock instead"),
        (("nowhere.toml",), "nowhere.toml: expected a readable system or scenario file"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_code_2(
    here: Path, main: Main, arguments: tuple[str, ...], message: str
) -> None:
    assert error_line(main("ssp", *arguments, "--out", "loop.ssp", code=2)).startswith(message)
    assert not (here / "loop.ssp").exists()


def test_a_place_that_cannot_be_written_is_a_failure_in_one_line(here: Path, main: Main) -> None:
    assert "fmus" in error_line(main("ssp", "--out", "fmus", code=1))


def written(scenario: Scenario, folder: Path) -> bytes:
    return writing.write(scenario, folder / "expected.ssp").read_bytes()


# -- rejections -------------------------------------------------------------------------------------------


UNSAYABLE: dict[str, Any] = {
    "hold": "first",
    "delay": 0.005,
    "delay_jitter": 0.001,
    "jitter": 0.002,
    "measurement_loss": 0.1,
    "command_loss": 0.1,
    "clock_ratio": 1.001,
    "noise": {"position": 0.01},
    "quantisation": {"position": 0.01},
}
"""The keys of a timing that an SSP lacks."""


@pytest.mark.parametrize("key", UNSAYABLE)
def test_timing_that_an_ssp_lacks_is_reported_as_in_its_file_only(key: str, short: Scenario, tmp_path: Path) -> None:
    value = UNSAYABLE[key]
    given = "" if isinstance(value, dict) else f" = {value}"
    assert warnings_of(short.with_changes(timing={key: value}), tmp_path) == [
        f"timing.{key}{given}: an SSP cannot express that; only its file with timing does"
    ]


def test_a_scenario_that_an_ssp_carries_has_no_warnings(short: Scenario, tmp_path: Path) -> None:
    assert warnings_of(short, tmp_path) == []


def test_an_enumeration_that_other_masters_reject_is_warned_of(short: Scenario, tmp_path: Path) -> None:
    given = short.with_changes(parameters={"controller.discretisation": "match"})
    assert warnings_of(given, tmp_path) == [
        "controller.discretisation = match: of type Enumeration; libcosim crashes, ecos and fmpy refuse the SSP; "
        "all take discretisation_index = 5"
    ]
    assert warnings_of(short.with_changes(parameters={"controller.discretisation_index": 5}), tmp_path) == []


MIXED = """\
stop_time = 0.1
[components.a]
fmu = "a.fmu"
step = 0.01
parameters = { mode = 2, label = "text" }
[components.b]
fmu = "b.fmu"
step = 0.01
[[connections]]
from = ["a.y", "a.high", "a.count"]
to = ["b.u", "b.on", "b.mode"]
[[connections]]
from = ["b.high"]
to = ["a.u"]
"""


@needs_compiler
def test_types_that_other_masters_reject_are_reported_by_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, main: Main
) -> None:
    monkeypatch.chdir(tmp_path)
    small(tmp_path / "a").rename("a.fmu")
    small(tmp_path / "b", mode_is_input=True).rename("b.fmu")
    Path("mixed.toml").write_text(MIXED, encoding="utf-8")
    assert main("ssp", "-q", "mixed.toml").stderr.splitlines() == [
        "warning: components.a.parameters.mode = 2: of type Enumeration; libcosim and ecos leave it as it starts",
        "warning: components.a.parameters.label = text: of type String; fmpy refuses the SSP",
        "warning: b.high to a.u: from Boolean to Real; libcosim and ecos refuse the SSP",
    ]


def warnings_of(scenario: Scenario, folder: Path) -> list[str]:
    """The warnings while an SSP is written."""
    lines: list[str] = []
    writing.write(scenario, folder / "loop.ssp", warn=lines.append)
    return lines


UNCONNECTED = "expected a parameter, an input that nothing is connected to"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("plant.mas", 1.0, "QuadrotorPlant has no such variable; did you mean mass?"),
        (
            "controller.gain",
            1.0,
            "UnifiedController has no such variable; did you mean gain.eta or gain.theta or gain.surface?",
        ),
        ("plant.thrust", 1.0, f"is connected; {UNCONNECTED}"),
        ("controller.position.x", 1.0, f"is connected; {UNCONNECTED}"),
        ("plant.position.x", 1.0, f"is an output; {UNCONNECTED}"),
        ("plant.tilt", 1.0, f"is a continuous local variable; {UNCONNECTED}"),
    ],
)
def test_a_name_that_is_neither_parameter_nor_open_input_is_rejected(
    name: str, value: float, message: str, short: Scenario, tmp_path: Path
) -> None:
    assert refusal(short.with_changes(parameters={name: value}), tmp_path).startswith(f"{name}: {message}")


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("plant.mass", True, "a number"),
        ("plant.mass", float("inf"), "a finite number"),
        ("plant.mass", float("nan"), "a finite number"),
        ("controller.use_reference_inputs", 1.0, "true or false"),
    ],
)
def test_a_value_of_another_type_is_rejected(
    name: str, value: float | bool, expected: str, short: Scenario, tmp_path: Path
) -> None:
    chosen = short.with_changes(parameters={name: value})
    assert refusal(chosen, tmp_path) == f"{name} = {value}: expected {expected}"


def test_two_fmus_of_one_file_name_are_rejected(short: Scenario, built: dict[str, Path], tmp_path: Path) -> None:
    copies = []
    for model in PAIR:
        copies.append(tmp_path / model / "model.fmu")
        copies[-1].parent.mkdir()
        shutil.copyfile(built[model], copies[-1])
    controller, plant = copies
    chosen = short.with_fmus(plant=plant, controller=controller)
    assert refusal(chosen, tmp_path) == f"{controller} and {plant}: expected FMUs of different file names"


def test_fmus_that_do_not_fit_are_rejected(short: Scenario, built: dict[str, Path], tmp_path: Path) -> None:
    swapped = short.with_fmus(plant=built["UnifiedController"], controller=built["QuadrotorPlant"])
    assert refusal(swapped, tmp_path).startswith("plant.fmu: UnifiedController has no output position.x, ")


def refusal(scenario: Scenario, folder: Path) -> str:
    """The error with which a scenario is rejected; no file is left behind."""
    with pytest.raises(UsageError) as refused:
        writing.write(scenario, folder / "loop.ssp")
    assert not (folder / "loop.ssp").exists()
    return one_line(refused.value)
