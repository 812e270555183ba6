"""Whatever is killed or missing in a sweep, no row is lost and none is wrong."""

import dataclasses
import os
import shutil
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from orchestration.components.building import fmus
from orchestration.experiments.studies.store import open_for_reading, store_path
from orchestration.experiments.studies.study_file import load_study
from orchestration.quadrotor.scenarios.fmu_choice import FmuChoice
from orchestration.simulation.workers.pool import Pool
from orchestration.simulation.workers.provenance import versions
from quadcosim import QuadcosimError
from tests.commands import Main
from tests.extent import in_test_all, sample
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.experiments.studies.common import (
    NOISY,
    PERIODS,
    POLL,
    RUNS,
    STORE,
    axis,
    bits,
    is_running,
    kill,
    one_line,
    rows_in,
    short,
    start,
    study,
    sweep,
    wait_for_rows,
    wait_until,
    workers_of,
)
from tests.orchestration.experiments.studies.kills import disturbed
from tests.orchestration.simulation.workers.sick import ABORTS, KILLED, SPENT, WAIT, WAITS, sick_plant
from tests.patience import PATIENCE

# -- killed -----------------------------------------------------------------------------------------------


def test_a_killed_sweep_leaves_no_workers_runs_only_what_is_missing_and_ends_with_the_same_rows(
    folder: Path, reference: list[dict[str, Any]], main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    with start("sweep", "study.toml", "--engine", "compiled", "--workers", "2", cwd=folder) as coordinator:
        wait_for_rows(folder / STORE, 2)
        workers = workers_of(coordinator.pid)
        coordinator.kill()
    assert len(workers) == 2
    wait_until(lambda: not any(map(is_running, workers)))
    there = rows_in(folder / STORE)
    assert 2 <= there < RUNS
    with open_for_reading(folder / STORE) as store:
        before = {found["design_index"]: found["duration"] for found in store.rows()}
    monkeypatch.chdir(folder)
    done = main("sweep", "study.toml", "--engine", "compiled")
    assert done.stdout.splitlines()[1:] == [f"{STORE}: {RUNS} runs, {RUNS - there} of them new"]
    assert bits(folder / STORE) == reference
    with open_for_reading(folder / STORE) as store:
        after = {found["design_index"]: found["duration"] for found in store.rows()}
    assert {index: after[index] for index in before} == before, "expected no run flown twice"


@in_test_all
def test_the_death_of_a_worker_loses_nothing_though_the_fmu_is_moved_away_meanwhile(
    folder: Path, reference: list[dict[str, Any]]
) -> None:
    plant = folder / "plant.fmu"
    shutil.copy(fmus.locate("QuadrotorPlant"), plant)
    text = NOISY.replace("[base.timing]", '[base.plant]\nfmu = "plant.fmu"\n[base.timing]')
    (folder / "study.toml").write_text(text)
    with start("sweep", "study.toml", "--engine", "compiled", "--workers", "2", cwd=folder) as coordinator:
        wait_for_rows(folder / STORE, 1)
        plant.unlink()
        kill(workers_of(coordinator.pid)[0])
        assert rows_in(folder / STORE) < RUNS
        out, err = coordinator.communicate(timeout=PATIENCE)
    assert coordinator.returncode == 0, out + err
    assert bits(folder / STORE) == reference


def test_a_run_whose_worker_is_killed_from_outside_stops_the_sweep_and_has_no_row(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant = f"[base.plant]\nfmu = '{sick_plant(tmp_path).name}'\n"
    axis = f'[[axes]]\nname = "mass"\nsets = ["plant.mass"]\nvalues = [{WAITS}]\n'
    (tmp_path / "study.toml").write_text(f"[base]\nstop_time = 0.2\nmodel_mismatch = true\n{plant}{axis}")
    monkeypatch.setenv(WAIT, "until it is killed")
    with start("sweep", "study.toml", "--engine", "compiled", cwd=tmp_path) as coordinator:
        while coordinator.poll() is None:
            for process in workers_of(coordinator.pid):
                kill(process)
            time.sleep(POLL)
        _, err = coordinator.communicate()
    assert coordinator.returncode == 1
    assert [line.partition(":")[0] for line in err.splitlines()] == ["engine compiled", "quadcosim"], err
    assert rows_in(tmp_path / STORE) == 0
    monkeypatch.delenv(WAIT)
    monkeypatch.chdir(tmp_path)
    assert f"{STORE}: 1 runs, 1 of them new\n" in main("sweep", "study.toml", "--engine", "compiled").stdout


@in_test_all
@pytest.mark.parametrize(("workers", "kills"), [(1, 1), (2, 3)])
def test_whatever_is_killed_the_table_is_that_of_an_undisturbed_sweep(
    tmp_path: Path, reference: list[dict[str, Any]], workers: int, kills: int
) -> None:
    tally = disturbed(tmp_path, reference, workers=workers, kills=kills, seed=workers)
    assert tally.kills == kills


@in_test_all
@needs_compiler
def test_a_sweep_in_lanes_whose_coordinator_is_killed_has_the_same_bits(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(NOISY)
    whole = bits(sweep(load_study(path), out=tmp_path / "whole", engine="batch").path)
    tally = disturbed(tmp_path, whole, workers=1, kills=1, engine="batch", seed=141)
    assert (tally.coordinators, tally.workers) == (1, 0)


@pytest.mark.parametrize("whom", sample(["the coordinator", "a worker"], 1))
def test_an_interrupt_is_reported_in_one_line_with_the_progress(
    folder: Path, reference: list[dict[str, Any]], whom: str
) -> None:
    with start("sweep", "study.toml", "--engine", "compiled", cwd=folder) as coordinator:
        wait_for_rows(folder / STORE, 1)
        os.kill(coordinator.pid if whom == "the coordinator" else workers_of(coordinator.pid)[0], signal.SIGINT)
        out, err = coordinator.communicate(timeout=PATIENCE)
    assert (coordinator.returncode, out) == (130, "")
    _, told = err.splitlines()  # the first says that Python is slow
    assert told == f"quadcosim: interrupted with {rows_in(folder / STORE)} of {RUNS} runs done"
    assert all(row in reference for row in bits(folder / STORE))


@pytest.mark.parametrize("workers", sample([1, 2], 1))
def test_a_run_that_ends_its_process_fails_and_no_other_run_does(tmp_path: Path, workers: int) -> None:
    base = dataclasses.replace(short(), plant=FmuChoice(fmu=str(sick_plant(tmp_path))))
    masses = axis("plant.mass", 1.0, ABORTS, 1.01, SPENT, 1.02)
    told: list[str] = []
    summary = sweep(study(masses, base=base), out=tmp_path, workers=workers, announce=told.append)
    rows = bits(summary.path)
    assert [row["design_index"] for row in rows if row["status"] == "failed"] == [1]
    assert [row["message"].partition(",")[0] for row in rows if row["status"] == "failed"] == [
        "the process of the run ended by SIGABRT"
    ]  # fmt: skip
    assert (summary.failed, len(told)) == (1, 1)
    assert told[0].startswith(
        "run 1 (plant.mass = 1.11) failed: the process of the run ended by SIGABRT, in a call of plant ("
    )


def test_a_run_that_is_killed_repeatedly_stops_the_sweep_without_a_row(tmp_path: Path) -> None:
    base = dataclasses.replace(short(), plant=FmuChoice(fmu=str(sick_plant(tmp_path))))
    with pytest.raises(QuadcosimError, match=r"run 1 ended by SIGKILL 3 times: not caused by the run") as caught:
        sweep(study(axis("plant.mass", 1.0, KILLED), base=base), out=tmp_path)
    one_line(caught.value)
    assert rows_in(store_path("study", tmp_path)) == 1


# -- the place, not the run -------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["no space", "no file"])
def test_a_failure_of_the_environment_stops_the_sweep_without_a_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    genuine = Pool._unpack

    def unpack(pool: Pool, number: int, name: str) -> Path:
        path = genuine(pool, number, name)
        if what == "no file":
            path.unlink()
        else:
            path.write_bytes(path.read_bytes()[:-2000])  # as much as there was room for
        return path

    monkeypatch.setattr(Pool, "_unpack", unpack)
    with pytest.raises(QuadcosimError, match="not a failure of a run: ") as caught:
        sweep(study(PERIODS), out=tmp_path, workers=2)
    one_line(caught.value)
    monkeypatch.undo()
    assert rows_in(store_path("study", tmp_path)) == 0
    assert sweep(study(PERIODS), out=tmp_path).flown == 2


def test_other_software_in_a_worker_stops_the_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = {**versions(), "sources": "other"}
    monkeypatch.setattr("orchestration.simulation.workers.pool.versions", lambda: other)
    with pytest.raises(QuadcosimError, match="has another version of sources than the coordinator; expected the same"):
        sweep(study(PERIODS), out=tmp_path)
    assert rows_in(store_path("study", tmp_path)) == 0
