"""A run that is stopped and goes on later has the bits of one that never stopped."""

import json
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import quadcosim
from orchestration.components.building import fmus
from orchestration.quadrotor.scenarios.wiring import REFERENCE
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.simulation.runs.result import Result
from quadcosim import ReferenceChoice, Timing, UsageError
from tests.native import native

EVERYTHING = Timing(
    period=0.01,
    plant_interval=0.003,
    delay=0.014,
    delay_jitter=0.004,
    jitter=0.003,
    measurement_loss=0.2,
    command_loss=0.2,
    burst_length=2.0,
    noise={"position": 0.001},
)
SIDES = {"plant": "QuadrotorPlant", "controller": "UnifiedController"}
LAGGING = {"plant.actuator_time_constant": 0.02}


def own(folder: Path) -> dict[str, Path]:
    """Copies of both FMUs in `folder`, by side."""
    return {side: Path(shutil.copy(fmus.locate(f"native/{model}"), folder)) for side, model in SIDES.items()}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def equal(a: Result, b: Result) -> bool:
    return np.array_equal(a.rows, b.rows) and a.events == b.events


@pytest.mark.parametrize(
    "timing",
    [Timing(), EVERYTHING, Timing(clock="fmu", plant_interval=0.002), Timing(hold="first", order="jacobi")],
    ids=["plain", "everything on", "fmu clock", "first-order hold"],
)
@pytest.mark.parametrize("at", [0.0, 0.1234, 0.2])
def test_a_resumed_run_has_the_bits_of_an_uninterrupted_one(timing: Timing, at: float, tmp_path: Path) -> None:
    scenario = native(stop_time=0.4, timing=timing, seed=3).with_changes(parameters=LAGGING)
    assert fly_until(scenario, at, tmp_path / "paused") is None
    resumed = resume(tmp_path / "paused")
    whole = quadcosim.run(scenario)
    assert equal(resumed, whole)
    assert resumed.metrics == whole.metrics


def test_a_paused_run_goes_on_in_another_process(tmp_path: Path) -> None:
    scenario = native(stop_time=0.3, timing=EVERYTHING)
    fly_until(scenario, 0.15, tmp_path / "paused")
    code = "import sys, orchestration as q; q.save_run(q.resume(sys.argv[1]), sys.argv[2], figures=False)"
    subprocess.run([sys.executable, "-c", code, tmp_path / "paused", tmp_path / "done"], check=True)
    assert equal(quadcosim.load_run(tmp_path / "done"), quadcosim.run(scenario))


def test_a_run_that_diverges_before_the_pause_is_over(tmp_path: Path) -> None:
    diverging = native(stop_time=5.0, timing=Timing(period=0.3))
    result = fly_until(diverging, 4.0, tmp_path / "paused", figures=False)
    assert result is not None
    assert result.metrics["diverged"] is True
    assert quadcosim.load_run(tmp_path / "paused").rows.tobytes() == result.rows.tobytes()


def test_other_fmus_than_those_of_the_pause_are_refused(tmp_path: Path) -> None:
    fly_until(native(stop_time=0.1).with_fmus(**own(tmp_path)), 0.05, tmp_path / "paused")
    with zipfile.ZipFile(tmp_path / "UnifiedController.fmu", "a") as fmu:
        fmu.writestr("resources/more.txt", "more")  # its GUID stays
    with pytest.raises(UsageError, match=r"the FMU of controller has changed since the run was paused"):
        resume(tmp_path / "paused")


@pytest.mark.parametrize("edit", [("period = 0.01", "period = 0.02"), ("seed = 0", "seed = 1")], ids=str)
def test_another_scenario_than_that_of_the_pause_is_refused(edit: tuple[str, str], tmp_path: Path) -> None:
    fly_until(native(stop_time=0.1), 0.05, tmp_path / "paused")
    file = tmp_path / "paused" / "scenario.toml"
    assert edit[0] in file.read_text()
    file.write_text(file.read_text().replace(*edit))
    with pytest.raises(UsageError, match=r"scenario.toml has changed since the run was paused"):
        resume(tmp_path / "paused", tmp_path / "done")
    assert [path.name for path in tmp_path.iterdir()] == ["paused"]


def test_another_reference_than_that_of_the_pause_is_refused(tmp_path: Path) -> None:
    table = tmp_path / "reference.csv"
    table.write_text("\n".join([",".join(("time", *REFERENCE)), "0" + ",0" * 15, "1" + ",0" * 15]))
    scenario = native(stop_time=0.1, reference=ReferenceChoice(file=table))
    fly_until(scenario, 0.05, tmp_path / "paused")
    table.write_text(table.read_text() + "\n2" + ",0" * 15)
    with pytest.raises(UsageError, match="the file of reference has changed since the run was paused"):
        resume(tmp_path / "paused")


@pytest.mark.parametrize("paused", [True, False], ids=["a paused run", "a run"])
def test_a_pause_replaces_nothing(paused: bool, tmp_path: Path) -> None:
    scenario = native(stop_time=0.1)
    if paused:
        fly_until(scenario, 0.05, tmp_path / "there")
    else:
        quadcosim.save_run(quadcosim.run(scenario), tmp_path / "there", figures=False)
    before = contents(tmp_path / "there")
    with pytest.raises(UsageError, match=r"there: expected a new or empty directory$"):
        fly_until(scenario, 0.05, tmp_path / "there")
    assert contents(tmp_path / "there") == before


def test_a_paused_run_is_replaced_by_its_own_end_only(tmp_path: Path) -> None:
    fly_until(native(stop_time=0.1), 0.05, tmp_path / "paused")
    before = contents(tmp_path / "paused")
    with pytest.raises(UsageError, match="expected a new or empty directory, or that of an earlier run"):
        quadcosim.save_run(quadcosim.run(native(stop_time=0.1)), tmp_path / "paused")
    assert contents(tmp_path / "paused") == before
    resumed = resume(tmp_path / "paused", tmp_path / "paused", figures=False)
    assert equal(quadcosim.load_run(tmp_path / "paused"), resumed)


@pytest.mark.parametrize("at", [-0.1, 0.1, 1.0])
def test_a_pause_outside_the_run_is_refused(at: float, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="pause at"):
        fly_until(native(stop_time=0.1), at, tmp_path / "paused")


def test_a_folder_without_a_pause_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="directory of a paused run"):
        resume(tmp_path)


@pytest.mark.parametrize("part", ["instants", "of", "row", "events", "plant"])
def test_a_state_that_has_been_edited_is_refused_in_one_line(part: str, tmp_path: Path) -> None:
    fly_until(native(stop_time=0.1), 0.05, tmp_path / "paused")
    path = tmp_path / "paused" / "paused.npz"
    with np.load(path) as archive:
        arrays = dict(archive)
    state = json.loads(str(arrays["json"]))
    if part in state:
        arrays["json"] = np.array(json.dumps({**state, part: [7]}))
    else:
        arrays[part][0] ^= 1
    for edited in (arrays, {name: array for name, array in arrays.items() if name != part and name != "json"}):
        np.savez(path, **edited)
        with pytest.raises(UsageError, match="expected the state of a paused run, as it was written") as refused:
            resume(tmp_path / "paused")
        assert str(refused.value).isprintable()
