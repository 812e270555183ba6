"""Sweeps of the real FMUs: the same bits whoever flies, whatever is killed, and nothing flown twice."""

import concurrent.futures
import dataclasses
import json
import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import orchestration
from orchestration import QuadcosimError, Timing, UsageError
from orchestration.fmpy_adapter import FmuSimulator
from orchestration.scenario import Scenario
from orchestration.studies import engine, worker
from orchestration.studies import sweep as sweeps
from orchestration.studies.store import open_for_reading
from orchestration.studies.study import Fmus, Study, locate_fmus
from orchestration.studies.study_file import load_study
from orchestration.studies.sweep import store_path, sweep
from orchestration.studies.worker import Hangar, Outcome, Task
from orchestration.wiring import POSITION_REFERENCE
from tests.studies.common import (
    GRID,
    NOISY,
    RUNS,
    SCRIPT,
    Cluster,
    axis,
    bits,
    is_running,
    kill,
    one_line,
    quadcosim,
    reference_store,
    rows_in,
    short,
    start,
    starts,
    study,
    swept,
    wait_for_rows,
    wait_until,
    workers_of,
)

STORE = Path("results") / "study" / "study.sqlite"
PERIODS = axis("timing.period", 0.01, 0.02)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """The rows of the noisy study, flown by one worker without interruption."""
    found = bits(reference_store(tmp_path_factory.mktemp("reference")))
    assert len(found) == RUNS
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the noisy study."""
    (tmp_path / "study.toml").write_text(NOISY)
    return tmp_path


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Callable[[int], Cluster]]:
    """Starts a dask scheduler with a number of workers."""
    made: list[Cluster] = []

    def make(workers: int) -> Cluster:
        made.append(Cluster(tmp_path, workers))
        return made[-1]

    yield make
    for each in made:
        each.close()


# -- the same bits ----------------------------------------------------------------------------------------


def test_the_runs_of_the_reference_differ_from_each_other(reference: list[dict[str, Any]]) -> None:
    assert len({found["position_rmse"] for found in reference}) == RUNS
    assert [found["seed"] for found in reference] == list(range(RUNS))
    assert {found["status"] for found in reference} == {"done"}


def test_two_workers_make_the_same_rows_as_one(folder: Path, reference: list[dict[str, Any]]) -> None:
    done = quadcosim("sweep", "study.toml", "--workers", "2", cwd=folder)
    assert done.stdout == f"{STORE}: {RUNS} runs, {RUNS} flown now\n"
    assert bits(folder / STORE) == reference


def test_the_order_of_runs_does_not_change_them(folder: Path, reference: list[dict[str, Any]]) -> None:
    chosen, hangar = load_study(folder / "study.toml"), Hangar()
    fmus = locate_fmus(chosen.base)
    for index in (15, 3, 8, 0):
        scenario = chosen.scenario(index, fmus.starts).with_fmus(plant=fmus.plant, controller=fmus.controller)
        metrics = hangar.fly(task(scenario)).row.metrics
        assert metrics is not None
        assert metrics["position_rmse"].hex() == reference[index]["position_rmse"]
        assert metrics["control_effort.torque"].hex() == reference[index]["control_effort.torque"]


def test_a_row_has_the_metrics_of_a_direct_run(folder: Path, reference: list[dict[str, Any]]) -> None:
    direct = orchestration.run(load_study(folder / "study.toml").scenario(9, starts())).metrics
    for name, value in direct.items():
        expected = value if value is None or isinstance(value, str) else float(value).hex()
        assert reference[9][name] == expected, name


def test_a_dask_cluster_makes_the_same_rows(
    folder: Path, reference: list[dict[str, Any]], cluster: Callable[[int], Cluster]
) -> None:
    quadcosim("sweep", "study.toml", "--dask", cluster(1).address, cwd=folder)
    assert bits(folder / STORE) == reference


def test_the_death_of_a_dask_worker_loses_nothing(
    folder: Path, reference: list[dict[str, Any]], cluster: Callable[[int], Cluster]
) -> None:
    made = cluster(2)
    with start("sweep", "study.toml", "--dask", made.address, cwd=folder) as coordinator:
        wait_for_rows(folder / STORE, 1)
        made.workers[0].kill()
        assert rows_in(folder / STORE) < RUNS
        out, err = coordinator.communicate(timeout=60)
    assert coordinator.returncode == 0, out + err
    assert bits(folder / STORE) == reference


# -- killed -----------------------------------------------------------------------------------------------


def test_a_killed_sweep_flies_only_what_is_missing_and_ends_with_the_same_rows(
    folder: Path, reference: list[dict[str, Any]]
) -> None:
    with start("sweep", "study.toml", cwd=folder) as coordinator:
        wait_for_rows(folder / STORE, 2)
        coordinator.kill()
    there = rows_in(folder / STORE)
    assert 2 <= there < RUNS
    with open_for_reading(folder / STORE) as store:
        before = {found["design_index"]: found["duration"] for found in store.rows()}
    done = quadcosim("sweep", "study.toml", "--workers", "2", cwd=folder)
    assert done.stdout == f"{STORE}: {RUNS} runs, {RUNS - there} flown now\n"
    assert bits(folder / STORE) == reference
    with open_for_reading(folder / STORE) as store:
        after = {found["design_index"]: found["duration"] for found in store.rows()}
    assert {index: after[index] for index in before} == before, "expected no run flown twice"


def test_workers_end_when_the_coordinator_is_killed(folder: Path) -> None:
    with start("sweep", "study.toml", "--workers", "2", cwd=folder) as coordinator:
        wait_for_rows(folder / STORE, 1)
        workers = workers_of(coordinator.pid)
        coordinator.kill()
    assert len(workers) == 2
    wait_until(lambda: not any(map(is_running, workers)), seconds=10.0)


def test_the_death_of_a_worker_loses_nothing(folder: Path, reference: list[dict[str, Any]]) -> None:
    with start("sweep", "study.toml", "--workers", "2", cwd=folder) as coordinator:
        wait_for_rows(folder / STORE, 1)
        kill(workers_of(coordinator.pid)[0])
        assert rows_in(folder / STORE) < RUNS
        out, err = coordinator.communicate(timeout=60)
    assert coordinator.returncode == 0, out + err
    assert bits(folder / STORE) == reference


def test_a_run_whose_worker_dies_three_times_is_a_failed_row_until_it_is_retried(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text('[base]\nstop_time = 2.0\n[[axes]]\nname = "seed"\nvalues = [1]\n')
    killed = set()
    with start("sweep", "study.toml", cwd=tmp_path) as coordinator:
        while coordinator.poll() is None:
            for process in set(workers_of(coordinator.pid)) - killed:
                kill(process)
                killed.add(process)
    assert coordinator.returncode == 0
    assert len(killed) >= engine.ATTEMPTS
    (row,) = bits(tmp_path / STORE)
    assert (row["status"], row["message"]) == ("failed", "its worker process died 3 times while it was under way")
    done = quadcosim("sweep", "study.toml", "--retry-failed", cwd=tmp_path)
    assert done.stdout == f"{STORE}: 1 runs, 1 flown now\n"


# -- what a store holds -----------------------------------------------------------------------------------


def test_a_finished_study_is_not_flown_again(tmp_path: Path) -> None:
    chosen = study(PERIODS)
    first, second = sweep(chosen, folder=tmp_path), sweep(chosen, folder=tmp_path)
    assert (first.total, first.flown, first.failed) == (2, 2, 0)
    assert (second.total, second.flown, second.failed) == (2, 0, 0)


def test_progress_counts_from_what_is_there_to_all(tmp_path: Path) -> None:
    heard: list[tuple[int, int]] = []
    sweep(study(PERIODS), folder=tmp_path, progress=lambda done, total: heard.append((done, total)))
    sweep(study(PERIODS), folder=tmp_path, progress=lambda done, total: heard.append((done, total)))
    assert heard == [(0, 2), (1, 2), (2, 2), (2, 2)]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a study that is done."""
    folder = tmp_path_factory.mktemp("finished")
    swept(study(PERIODS), folder)
    return folder


HEAVY = short().with_changes(parameters={"plant.mass": 1.1})
CHANGES: list[tuple[Study, str]] = [
    (study(PERIODS, base=short(delay=0.001)), r"timing.delay was 0.0, is 0.001"),
    (study(PERIODS, base=short(noise={"position": 0.1})), r"timing.noise was \{\}, is \{\"position\": 0.1\}"),
    (study(PERIODS, base=short(stop_time=0.2)), r"stop_time was 0.1, is 0.2"),
    (study(PERIODS, base=dataclasses.replace(short(), seed=3)), r"seed was 0, is 3"),
    (study(PERIODS, base=HEAVY), r"plant.mass was absent, is 1.1"),
    (study(PERIODS, vary_seed=True), r"design was .*false\], is .*true\]"),
    (study(axis("timing.period", 0.01)), r"axis timing.period was .*0.02.*, is "),
    (study(axis("seed", 1, 2)), r"axes was .*; axis seed was absent, is .*; axis timing.period was .*, is absent"),
]


@pytest.mark.parametrize(("changed", "said"), CHANGES, ids=[said.partition(" was")[0] for _, said in CHANGES])
def test_a_changed_study_is_refused_and_says_what_changed(finished: Path, changed: Study, said: str) -> None:
    before = bits(store_path("study", finished))
    with pytest.raises(UsageError, match=rf"holds another study \({said}") as caught:
        sweep(changed, folder=finished)
    assert "expected the same one: take another --out, or remove the store" in one_line(caught.value)
    assert bits(store_path("study", finished)) == before


def test_other_fmus_are_a_changed_study(finished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def other(base: Scenario) -> Fmus:
        fmus = locate_fmus(base)
        fmus.__dict__["guids"] = {**fmus.guids, "plant": "{other}"}
        return fmus

    monkeypatch.setattr(sweeps, "locate_fmus", other)
    with pytest.raises(UsageError, match=r"FMU of the plant was .*, is \"\{other\}\""):
        sweep(study(PERIODS), folder=finished)


def test_the_name_of_a_study_and_the_signals_that_it_keeps_may_change(finished: Path) -> None:
    renamed = dataclasses.replace(study(PERIODS, keep_signals=(1,)), name="renamed")
    assert sweep(renamed, folder=finished).total == 2


def test_axes_of_seeds_fly_those_seeds(tmp_path: Path) -> None:
    noisy = short(noise={"position": 0.01})
    rows = bits(swept(study(axis("seed", 4, 9, 4), base=noisy), tmp_path))
    assert [row["seed"] for row in rows] == [4, 9, 4]
    assert rows[0]["position_rmse"] == rows[2]["position_rmse"] != rows[1]["position_rmse"]
    assert rows[0]["key"] == rows[2]["key"] != rows[1]["key"]


# -- runs that fail and runs that diverge -----------------------------------------------------------------


def test_a_run_that_fails_is_a_row_with_its_message_and_is_flown_again_on_request_only(tmp_path: Path) -> None:
    chosen = study(axis("plant.mass", 1.0, -1.0, 2.0))
    path = swept(chosen, tmp_path)
    rows = bits(path)
    assert [row["status"] for row in rows] == ["done", "failed", "done"]
    assert rows[1]["message"].endswith("mass = -1.0: expected a finite value > 0")
    assert sweep(chosen, folder=tmp_path).flown == 0
    again = sweep(chosen, folder=tmp_path, retry_failed=True)
    assert (again.flown, again.failed) == (1, 1)
    assert bits(path) == rows


def test_a_parameter_that_does_not_exist_is_told_in_the_row(tmp_path: Path) -> None:
    (row,) = bits(swept(study(axis("plant.weight", 1.0)), tmp_path))
    assert row["status"] == "failed"
    assert row["message"].startswith("plant.weight: QuadrotorPlant has no such variable; ")
    assert "mass, gravity" in row["message"]


def test_a_run_that_diverges_is_done(tmp_path: Path) -> None:
    wild = short(stop_time=20.0, plant_interval=0.1, period=0.2)
    (row,) = bits(swept(study(axis("seed", 1), base=wild), tmp_path))
    assert row["status"] == "done"
    assert row["diverged"] == (1.0).hex()
    assert 0.0 < float.fromhex(row["divergence_time"]) < 20.0
    assert row["message"] is not None


# -- signals ----------------------------------------------------------------------------------------------


def test_signals_of_the_chosen_runs_are_kept_and_are_those_of_a_direct_run(tmp_path: Path) -> None:
    chosen = study(axis("timing.period", 0.01, 0.02, 0.03), base=short(noise={"velocity": 0.1}), keep_signals=(1, 2))
    swept(chosen, tmp_path)
    kept = sorted((tmp_path / "signals").iterdir())
    assert [path.name for path in kept] == ["000001.parquet", "000002.parquet"]
    for index, path in zip((1, 2), kept, strict=True):
        table = pq.read_table(path)
        direct = orchestration.run(chosen.scenario(index, starts()))
        assert tuple(table.column_names) == (*direct.columns, *POSITION_REFERENCE)
        kept_rows = np.column_stack([table[name].to_numpy() for name in table.column_names])
        assert np.array_equal(kept_rows, np.hstack([direct.rows, direct.desired]))


def test_no_signals_are_kept_unless_told(tmp_path: Path) -> None:
    swept(study(axis("timing.period", 0.01)), tmp_path)
    assert not (tmp_path / "signals").exists()


def test_signals_that_are_asked_for_later_are_flown_for(tmp_path: Path) -> None:
    chosen = study(axis("timing.period", 0.01, 0.02))
    swept(chosen, tmp_path)
    summary = sweep(dataclasses.replace(chosen, keep_signals=(1,)), folder=tmp_path)
    assert summary.flown == 1
    assert [path.name for path in (tmp_path / "signals").iterdir()] == ["000001.parquet"]


def test_a_point_that_cannot_be_is_a_row_that_says_why(tmp_path: Path) -> None:
    path = swept(study(axis("timing.jitter", 0.001, 0.02), base=short(period=0.01)), tmp_path)
    with open_for_reading(path) as opened:
        rows = list(opened.rows())
    assert [row["status"] for row in rows] == ["done", "failed"]
    assert "timing.jitter = 0.02" in rows[1]["message"]


def test_axes_in_another_order_are_another_study(tmp_path: Path) -> None:
    a, b = axis("timing.period", 0.01, 0.02), axis("timing.delay", 0.0, 0.001)
    swept(study(a, b), tmp_path)
    with pytest.raises(UsageError, match="axes was"):
        swept(study(b, a), tmp_path)


def test_workers_leave_no_files_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    file = tmp_path / "study.toml"
    file.write_text(GRID)
    environment = {**os.environ, "TMPDIR": str(temporary)}
    subprocess.run(
        [str(SCRIPT), "sweep", file, "--workers", "2", "--out", tmp_path / "out"], env=environment, check=True
    )
    assert [path.name for path in temporary.iterdir() if path.name.startswith(("tmp", "quadcosim"))] == []


# -- dask -------------------------------------------------------------------------------------------------


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A client that waits less than ten seconds for what is not there."""
    import distributed

    class Impatient(distributed.Client):  # type: ignore[misc]
        def __init__(self, address: str, **options: Any) -> None:
            super().__init__(address, **{**options, "timeout": 0.5})

        def wait_for_workers(self, n_workers: int, timeout: float | None = None) -> None:
            super().wait_for_workers(n_workers, timeout=0.5)

    monkeypatch.setattr(distributed, "Client", Impatient)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://127.0.0.1:1"])
def test_a_scheduler_that_is_not_there_is_one_line(tmp_path: Path, address: str) -> None:
    with pytest.raises(QuadcosimError, match=rf"--dask {address}: expected a dask scheduler with workers") as caught:
        sweep(study(PERIODS), folder=tmp_path, dask=address)
    one_line(caught.value)
    assert sweep(study(PERIODS), folder=tmp_path).flown == 2, "expected the store to be of use still"


@pytest.mark.usefixtures("impatient")
def test_a_scheduler_without_workers_is_one_line(tmp_path: Path, cluster: Callable[[int], Cluster]) -> None:
    with pytest.raises(QuadcosimError, match="expected a dask scheduler with workers there") as caught:
        sweep(study(PERIODS), folder=tmp_path / "out", dask=cluster(0).address)
    one_line(caught.value)


# -- FMUs in a process ------------------------------------------------------------------------------------


def task(scenario: Scenario, index: int = 0) -> Task:
    fmus = locate_fmus(scenario)
    located = scenario.with_fmus(plant=fmus.plant, controller=fmus.controller)
    return Task(index=index, key="", settings={}, scenario=located, keep_signals=False)


@pytest.fixture
def instantiated(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the instances that are made, in order."""
    names: list[str] = []

    class Counted(FmuSimulator):
        def __init__(self, path: Path, instance_name: str) -> None:
            names.append(instance_name)
            super().__init__(path, instance_name)

    monkeypatch.setattr("orchestration.fleet.FmuSimulator", Counted)
    return names


def rmse(outcome: Outcome) -> str:
    assert outcome.row.metrics is not None, outcome.row.message
    return str(outcome.row.metrics["position_rmse"].hex())


def test_each_fmu_is_instantiated_once_in_a_process(instantiated: list[str]) -> None:
    hangar = Hangar()
    for period in (0.01, 0.02, 0.03, 0.01):
        hangar.fly(task(short(period=period)))
    assert sorted(instantiated) == ["controller", "plant"]


def test_an_fmu_that_failed_is_made_anew_and_the_next_run_is_as_if_nothing_had_been(instantiated: list[str]) -> None:
    hangar = Hangar()
    before = rmse(hangar.fly(task(short())))
    assert hangar.fly(task(short().with_changes(parameters={"plant.mass": -1.0}))).row.metrics is None
    assert rmse(hangar.fly(task(short()))) == before
    assert instantiated.count("plant") == 2


def test_nothing_of_a_run_is_left_in_the_next() -> None:
    hangar, plain = Hangar(), short(period=0.02)
    odd = short(order="jacobi", hold="first", delay=0.03, noise={"position": 0.1}).with_changes(
        parameters={"plant.mass": 3.0, "controller.coupling": 5.0, "plant.initial.position.z": 1.0}
    )
    before = rmse(hangar.fly(task(plain)))
    assert rmse(hangar.fly(task(odd))) != before
    assert rmse(hangar.fly(task(plain))) == before


def test_threads_of_one_process_fly_one_at_a_time_to_the_same_bits(instantiated: list[str]) -> None:
    hangar = Hangar()
    tasks = [task(short(period=period), index=i) for i, period in enumerate((0.01, 0.02, 0.03, 0.04))]
    expected = [rmse(hangar.fly(each)) for each in tasks]
    with concurrent.futures.ThreadPoolExecutor(4) as threads:
        assert [rmse(found) for found in threads.map(hangar.fly, tasks)] == expected
    assert sorted(instantiated) == ["controller", "plant"]


def test_fmus_are_unpacked_once_by_content() -> None:
    hangar = Hangar()
    one, same, other = hangar.unpack(b"one"), hangar.unpack(b"one"), hangar.unpack(b"other")
    assert one == same != other
    assert (one.read_bytes(), other.read_bytes()) == (b"one", b"other")
    assert hangar._folder is not None
    hangar._folder.cleanup()


def test_a_chunk_is_flown_with_the_fmus_that_come_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    hangar, fmus = Hangar(), locate_fmus(short())
    monkeypatch.setattr(worker, "HANGAR", hangar)
    tasks = [dataclasses.replace(task(short()), scenario=short(period=period)) for period in (0.01, 0.02)]
    found = worker.fly_chunk(tasks, fmus.plant.read_bytes(), fmus.controller.read_bytes())
    assert [rmse(each) for each in found] == [rmse(Hangar().fly(task(each.scenario))) for each in tasks]
    assert hangar._folder is not None
    hangar._folder.cleanup()


# -- a few runs at a time ---------------------------------------------------------------------------------


def test_a_pool_flies_in_order_up_to_the_first_that_stops_it() -> None:
    periods = (0.01, 0.02, 0.03)
    scenarios = [short(period=period) for period in periods]
    with engine.Pool(locate_fmus(short()), 1) as pool:
        everything = pool.fly(scenarios, stop=lambda metrics: False)
        first = pool.fly(scenarios, stop=lambda metrics: True)
    assert [metrics["position_rmse"] for metrics in everything] == [
        orchestration.run(scenario).metrics["position_rmse"] for scenario in scenarios
    ]
    assert [metrics["position_rmse"] for metrics in first] == [everything[0]["position_rmse"]]


def test_a_pool_of_two_workers_has_the_same_results_in_some_order() -> None:
    scenarios = [short(period=period) for period in (0.01, 0.02, 0.03)]
    found = []
    for workers in (1, 2):
        with engine.Pool(locate_fmus(short()), workers) as pool:
            found.append(sorted(m["position_rmse"] for m in pool.fly(scenarios, stop=lambda metrics: False)))
    assert found[0] == found[1]


def test_a_pool_raises_what_a_run_failed_with() -> None:
    bad = short().with_changes(parameters={"plant.mass": -1.0})
    with engine.Pool(locate_fmus(bad), 1) as pool, pytest.raises(QuadcosimError, match=r"mass = -1.0: expected"):
        pool.fly([bad], stop=lambda metrics: False)


# -- usage ------------------------------------------------------------------------------------------------


def test_without_a_worker_nothing_is_flown(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--workers 0: expected at least 1"):
        sweep(study(PERIODS), folder=tmp_path, workers=0)


def test_the_store_says_what_it_is_about(finished: Path) -> None:
    fmus = locate_fmus(Scenario())
    with open_for_reading(store_path("study", finished)) as store:
        about = store.about()
    assert about["total"] == "2"
    assert json.loads(about["axes"]) == ["timing.period"]
    assert json.loads(about["grid"]) == {"timing.period": [0.01, 0.02]}
    assert json.loads(about["guids"]) == fmus.guids
    assert {"quadcosim", "numpy", "fmpy"} <= json.loads(about["versions"]).keys()


def test_chunks_are_of_about_a_second_and_enough_for_all_workers() -> None:
    def sizes(stop_time: float, number: int, workers: int) -> list[int]:
        chosen = Task(index=0, key="", settings={}, scenario=Scenario(stop_time=stop_time, timing=Timing()),
                      keep_signals=False)  # fmt: skip
        return [len(chunk) for chunk in engine._chunks([chosen] * number, workers)]

    assert sizes(30.0, 100, 1) == [1] * 100
    assert sum(sizes(0.1, 1000, 2)) == 1000
    assert max(sizes(0.1, 1000, 2)) > 10
    assert len(sizes(0.1, 1000, 2)) >= 16
    assert sizes(0.1, 0, 2) == []
