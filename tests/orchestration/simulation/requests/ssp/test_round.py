"""A system written as an SSP with its timing has the same run when it is read again."""

import dataclasses
import shutil
import zipfile
from pathlib import Path

import pytest

from orchestration.simulation.requests.request import load_request
from orchestration.simulation.requests.ssp import document, writing
from orchestration.simulation.runs.result import Result
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.connection import Source
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import Criterion, System
from quadcosim import Scenario, UsageError
from tests.commands import Main
from tests.orchestration.experiments.studies.common import error_line, one_line
from tests.orchestration.simulation.interop.test_systems import CARRIED, carried
from tests.places import EXAMPLES


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document, "_cache", lambda: tmp_path / "cache")


def bits(result: Result) -> dict[str, bytes]:
    return {name: values.tobytes() for name, values in result.signals.items()}


@pytest.mark.parametrize("name", CARRIED)
def test_an_example_has_the_same_rows_in_the_same_order_as_before(name: str, tmp_path: Path) -> None:
    system = carried(name)
    ssp, timing = writing.write_with_timing(system, tmp_path / "out" / "loop.ssp")
    assert timing == tmp_path / "out" / "loop.timing.toml"
    read = load_request(ssp, timing)
    assert isinstance(read, System)
    assert load_request(timing) == load_request(ssp) == read
    expected, found = run(system), run(read)
    assert bits(found) == bits(expected)
    assert list(found.signals) == list(expected.signals)
    assert found.metrics == expected.metrics
    assert read.operating_point == system.operating_point


def test_computers_and_networks_are_in_the_annotation_and_tasks_are_stepped_by_them(tmp_path: Path) -> None:
    system = load_request(EXAMPLES / "three_servos" / "can.toml")
    assert isinstance(system, System)
    ssp, timing = writing.write_with_timing(system, tmp_path / "loop.ssp")
    read = load_request(ssp, timing)
    assert isinstance(read, System)
    assert load_request(ssp) == read
    assert (read.computers, read.networks) == (system.computers, system.networks)
    assert run(read).metrics == run(system).metrics


def test_a_component_without_connections_has_the_same_run(tmp_path: Path) -> None:
    system = carried("double_integrator")
    alone = dataclasses.replace(
        system,
        stop_time=1.0,
        components={"plant": system.components["plant"]},
        connections=(),
        objectives={"x": "last(plant.x)"},
        criterion=Criterion(),
        sources={"push": Source(constant=1.0, to=("plant.u",))},
    )
    assert run(load_request(*writing.write_with_timing(alone, tmp_path / "loop.ssp"))).metrics == run(alone).metrics


def test_without_a_file_the_timing_of_the_annotation_is_used_and_checked(
    tmp_path: Path,
) -> None:
    system = dataclasses.replace(carried("double_integrator"), seed=7)
    ssp, timing = writing.write_with_timing(system, tmp_path / "loop.ssp")
    changed = tmp_path / "changed.toml"
    changed.write_text(timing.read_text().replace("seed = 7", "seed = 8").replace('ssp = "loop.ssp"', ""), "utf-8")
    assert [load_request(ssp, each).seed for each in (None, timing, changed)] == [7, 7, 8]
    document = load_structure(ssp, tmp_path / "damaged")
    document.write_text(document.read_text("utf-8").replace("seed = 7", "seed = = 7"), "utf-8")
    with pytest.raises(UsageError, match=r"annotation quadcosim\.timing: expected TOML"):
        load_request(document)


def test_files_of_sources_and_traces_travel_in_the_ssp(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("here", "out", "elsewhere")]
    for folder in folders:
        folder.mkdir()
    here, out, elsewhere = folders
    (here / "push.csv").write_text("time,u\n0,1\n1,2\n", "utf-8")
    (here / "late.csv").write_text("value\n0.1\n0.2\n", "utf-8")
    system = carried("double_integrator")
    first, second = system.connections
    system = dataclasses.replace(
        system,
        stop_time=1.0,
        components={**system.components, "other": system.components["plant"]},
        connections=(first, dataclasses.replace(second, delay=Distribution(file=here / "late.csv", column="value"))),
        sources={"push": Source(file=here / "push.csv", to=("other.u",), columns=("u",))},
    )
    written = writing.write_with_timing(system, out / "loop.ssp")
    known = bits(run(system))
    moved = [Path(shutil.move(each, elsewhere)) for each in written]
    shutil.rmtree(here)
    assert [bits(run(load_request(moved[0], timing))) for timing in (moved[1], None)] == [known, known]


def load_structure(ssp: Path, folder: Path) -> Path:
    """Unpacked, its document."""
    with zipfile.ZipFile(ssp) as opened:
        opened.extractall(folder)
    return folder / document.STRUCTURE


def test_additional_timing_is_used(tmp_path: Path) -> None:
    ssp, timing = writing.write_with_timing(carried("double_integrator"), tmp_path / "loop.ssp")
    timing.write_text(timing.read_text().replace('name = "command"', 'name = "command"\ndelay = 0.1'))
    read = load_request(ssp, timing)
    assert isinstance(read, System)
    assert [x.delay for x in read.connections] == [0.0, 0.1]


def test_a_system_of_two_rates_with_delay_and_loss_has_the_same_run(tmp_path: Path) -> None:
    system = load_request(EXAMPLES / "dc_servo" / "system.toml")
    assert isinstance(system, System)
    system = dataclasses.replace(system, stop_time=0.5)
    assert any(x.loss for x in system.connections)
    read = load_request(*writing.write_with_timing(system, tmp_path / "loop.ssp"))
    assert bits(run(read)) == bits(run(system))


def test_the_quadrotor_has_the_same_run_to_the_bit(tmp_path: Path) -> None:
    scenario = Scenario(stop_time=0.1).with_changes(timing={"period": 0.02, "offset": 0.01, "plant_interval": 0.005})
    read = load_request(*writing.write_with_timing(scenario, tmp_path / "loop.ssp"))
    assert isinstance(read, System)
    result = run(scenario)
    assert bits(run(read)) == bits(result)
    assert read.criterion == scenario.as_system().criterion


def test_the_command_writes_both_files_and_run_takes_them(tmp_path: Path, main: Main) -> None:
    system = dataclasses.replace(carried("water_tank"), stop_time=1.0)
    named = tmp_path / "50% #1?.fmu"
    named.write_bytes(Path(system.components["tank"].fmu).read_bytes())
    components = {**system.components, "tank": dataclasses.replace(system.components["tank"], fmu=str(named))}
    system = dataclasses.replace(system, components=components)
    (tmp_path / "tank.toml").write_text(system.to_toml())
    done = main("ssp", tmp_path / "tank.toml", "--out", tmp_path / "tank.ssp")
    assert done.stdout == f"{tmp_path / 'tank.ssp'}\n"
    assert done.stderr.splitlines() == [
        "warning: controller.valve to tank.valve_control: from Boolean to Real; libcosim and ecos refuse the SSP",
        f"{tmp_path / 'tank.timing.toml'} has its timing, for quadcosim run",
    ]
    result = [main("run", *of, "--out", tmp_path / f"run{i}", "--no-figures") for i, of in enumerate(
        [(tmp_path / "tank.toml",), (tmp_path / "tank.ssp", tmp_path / "tank.timing.toml")]
    )]  # fmt: skip
    assert len({done.stdout.count("peak") for done in result}) == 1
    assert (tmp_path / "run0" / "signals.parquet").read_bytes() == (tmp_path / "run1" / "signals.parquet").read_bytes()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("components = 3", "components = 3: expected a table"),
        ("[components]\nplant = 3", "components.plant = 3: expected a table"),
        ("[components.plant]\nparameters = 3", "components.plant.parameters = 3: expected a table"),
        ("sources = [1]", "sources = [1]: expected a table"),
        ("connections = { a = 1 }", "connections = {'a': 1}: expected a list"),
        ("connections = [1]", "connections.0 = 1: expected a table"),
        ("[[connections]]\nfrom = [[1]]\nto = [2]", "connections.0.from = [1]: expected a text"),
        ('[[connections]]\nfrom = 1\nto = "a"', "connections.0.from = 1: expected a list"),
    ],
)
def test_timing_of_the_wrong_shape_is_rejected_in_one_line(text: str, message: str, tmp_path: Path, main: Main) -> None:
    ssp, timing = writing.write_with_timing(carried("double_integrator"), tmp_path / "loop.ssp")
    timing.write_text(text)
    with pytest.raises(UsageError) as refused:
        load_request(ssp, timing)
    assert one_line(refused.value) == f"{timing}: {message}"
    assert error_line(main("limit", ssp, timing, "--of", "connections.command.delay", code=2)) == f"{timing}: {message}"
