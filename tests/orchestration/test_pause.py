"""A run that is stopped and goes on later has the bits of one that never stopped."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import orchestration
from orchestration import Scenario, Timing, UsageError
from orchestration.pause import fly_until, resume
from orchestration.result import Result

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
LAGGING = {"plant.actuator_time_constant": 0.02}


def equal(a: Result, b: Result) -> bool:
    return np.array_equal(a.rows, b.rows) and a.events == b.events


@pytest.mark.parametrize(
    "timing",
    [Timing(), EVERYTHING, Timing(clock="fmu", plant_interval=0.002), Timing(hold="first", order="jacobi")],
    ids=["plain", "everything on", "fmu clock", "first-order hold"],
)
@pytest.mark.parametrize("at", [0.0, 0.1234, 0.2])
def test_a_resumed_run_has_the_bits_of_an_uninterrupted_one(timing: Timing, at: float, tmp_path: Path) -> None:
    scenario = Scenario(stop_time=0.4, timing=timing, seed=3).with_changes(parameters=LAGGING)
    assert fly_until(scenario, at, tmp_path / "paused") is None
    resumed = resume(tmp_path / "paused")
    whole = orchestration.run(scenario)
    assert equal(resumed, whole)
    assert resumed.metrics == whole.metrics


def test_it_goes_on_in_another_process(tmp_path: Path) -> None:
    scenario = Scenario(stop_time=0.3, timing=EVERYTHING)
    fly_until(scenario, 0.15, tmp_path / "paused")
    code = "import sys, orchestration as q; q.save_run(q.resume(sys.argv[1]), sys.argv[2], figures=False)"
    subprocess.run([sys.executable, "-c", code, tmp_path / "paused", tmp_path / "done"], check=True)
    assert equal(orchestration.load_run(tmp_path / "done"), orchestration.run(scenario))


def test_a_run_that_diverges_before_the_pause_is_over(tmp_path: Path) -> None:
    result = fly_until(Scenario(stop_time=5.0, timing=Timing(period=0.3)), 4.0, tmp_path / "paused")
    assert result is not None
    assert result.metrics["diverged"] is True
    assert not (tmp_path / "paused").exists()


def test_other_fmus_than_those_of_the_pause_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fly_until(Scenario(stop_time=0.1), 0.05, tmp_path / "paused")
    other = {"fmus": {"plant": {"guid": "another"}, "controller": {"guid": "another"}}}
    monkeypatch.setattr("orchestration.pause.provenance", lambda plant, controller: other)
    with pytest.raises(UsageError, match="plant: FMU with GUID another, expected"):
        resume(tmp_path / "paused")


@pytest.mark.parametrize("at", [-0.1, 0.1, 1.0])
def test_a_pause_outside_the_run_is_refused(at: float, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="pause at"):
        fly_until(Scenario(stop_time=0.1), at, tmp_path / "paused")


def test_a_folder_without_a_pause_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="directory of a paused run"):
        resume(tmp_path)
