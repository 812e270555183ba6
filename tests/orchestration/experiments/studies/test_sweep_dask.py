"""Sweeps on a dask cluster."""

import os
import signal
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.studies import sweep as sweeping
from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.store import open_for_reading, store_path
from orchestration.experiments.studies.study import Study
from orchestration.simulation.workers import executors
from orchestration.simulation.workers.executors import SILENCE, TOLD_AFTER, Heartbeat, RunEvaluator
from orchestration.systems.system.component import Component
from orchestration.systems.system.files import files_of
from orchestration.systems.system.model import System
from quadcosim import QuadcosimError
from tests.commands import Main
from tests.extent import WHOLE, in_test_all
from tests.orchestration.components.fmi.small import known, needs_compiler, small
from tests.orchestration.experiments.studies.common import (
    PERIODS,
    RUNS,
    STORE,
    Cluster,
    axis,
    bits,
    one_line,
    rows_in,
    short,
    start,
    study,
    sweep,
    wait_for_rows,
    wait_until,
)
from tests.orchestration.experiments.studies.test_sweep_hostile import expect_its_own_runs_to_fail, hostile
from tests.patience import PATIENCE


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A dask scheduler with a worker, or two where one will be killed."""
    made = Cluster(tmp_path_factory.mktemp("cluster"), workers=2 if WHOLE else 1)
    yield made
    made.close()


def test_a_dask_cluster_makes_the_same_rows(
    folder: Path, reference: list[dict[str, Any]], cluster: Cluster, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    main("sweep", "study.toml", "--engine", "compiled", "--dask", cluster.address)
    assert bits(folder / STORE) == reference


def test_without_workers_the_design_of_a_store_does_not_grow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unreachable(inputs: Any, address: str) -> Any:
        raise QuadcosimError(f"--dask {address}: expected a dask scheduler with workers there")

    sweep(study(axis("timing.period", 0.01), base=short()), out=tmp_path, progress=None, announce=None)
    monkeypatch.setattr(sweeping, "cluster", unreachable)
    monkeypatch.setattr(sweeping, "expect_scheduler", lambda address: None)
    more = study(axis("timing.period", 0.01, 0.02), base=short())
    with pytest.raises(QuadcosimError, match="expected a dask scheduler with workers there"):
        sweep(more, out=tmp_path, dask="tcp://nowhere:8786", progress=None, announce=None)
    with open_for_reading(store_path("study", tmp_path)) as store:
        assert store.about()["total"] == "1"


@in_test_all
@needs_compiler
def test_a_run_that_hangs_in_a_dask_worker_is_a_failed_row_with_the_reason(tmp_path: Path, cluster: Cluster) -> None:
    fmu = known(small(tmp_path, "ENDS=if (m->s.gain == 3.0) for (;;) usleep(1000)"))
    gain = "components.it.parameters.gain"
    system = System(stop_time=0.1, components={"it": Component(fmu=str(fmu), step=0.01)})
    hangs = Study(name="hangs", base=system, axes=(Axis(name=gain, targets=(gain,), values=(1.0, 3.0)),))
    out = tmp_path / "out"
    found = sweep(hangs, out=out, dask=cluster.address, time_limit=2.0, progress=None, announce=None)
    assert (found.total, found.failed) == (2, 1)
    with open_for_reading(found.path) as store:
        rows = {row["design_index"]: row["message"] for row in store.rows()}
    assert rows == {0: None, 1: "it was ended: it takes more than the time limit of 2 s"}


@needs_compiler
def test_fmus_run_in_children_of_dask_workers_and_send_no_pickle(tmp_path: Path, cluster: Cluster) -> None:
    tells = f'{{ char name[999]; snprintf(name, 999, "{tmp_path}/pid%d", (int)getpid()); FILE *p = fopen(name, "w");'
    chosen = hostile(tmp_path, more=f"{tells} if (p) fclose(p); }}")
    found = sweep(chosen, out=tmp_path / "out", dask=cluster.address, progress=None, announce=None)
    expect_its_own_runs_to_fail(found.path, tmp_path)
    told = {int(file.name.removeprefix("pid")) for file in tmp_path.glob("pid*")}
    assert told
    assert not told & {os.getpid(), cluster.scheduler.pid, *(worker.pid for worker in cluster.workers)}


def test_searches_evaluate_their_runs_on_a_cluster_too(cluster: Cluster) -> None:
    """As `tune` and a `cell` of `compare` do."""
    systems = [short(period=period).as_system() for period in (0.01, 0.02)]
    files = files_of(systems[0])
    found = []
    for dask in (None, cluster.address):
        with RunEvaluator(files, 1, dask=dask) as pool:
            found.append(pool.run_all(systems))
    assert found[0] == found[1]


@pytest.mark.parametrize("others", [0, 1])
def test_the_inputs_outlive_the_worker_that_holds_them(others: int) -> None:
    """With another worker, or with one that joins later."""
    import distributed

    systems = [short().as_system()]
    one: dict[str, Any] = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "protocol": "tcp"}
    with (
        distributed.LocalCluster(host="127.0.0.1", dashboard_address="127.0.0.1:0", **one) as local,
        RunEvaluator(files_of(systems[0]), 1, dask=local.scheduler_address) as pool,
    ):
        before = pool.run_all(systems)
        (holder,) = local.scheduler.workers
        local.scale(1 + others)
        wait_until(lambda: len(local.scheduler.workers) == 1 + others)
        local.sync(local.scheduler.remove_worker, holder, stimulus_id="killed")
        local.scale(2)
        assert pool.run_all(systems) == before


@in_test_all
def test_the_death_of_a_dask_worker_loses_nothing(
    folder: Path, reference: list[dict[str, Any]], cluster: Cluster
) -> None:
    """The last test on this cluster: one worker is left."""
    with start("sweep", "study.toml", "--engine", "compiled", "--dask", cluster.address, cwd=folder) as coordinator:
        wait_for_rows(folder / STORE, 1)
        cluster.workers[0].kill()
        assert rows_in(folder / STORE) < RUNS
        out, err = coordinator.communicate(timeout=PATIENCE)
    assert coordinator.returncode == 0, out + err
    assert bits(folder / STORE) == reference


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A client that waits less than ten seconds for a missing scheduler."""
    import distributed

    class Impatient(distributed.Client):  # type: ignore[misc]
        def __init__(self, address: str, **options: Any) -> None:
            super().__init__(address, **{**options, "timeout": 0.5})

        def wait_for_workers(self, n_workers: int, timeout: float | None = None) -> Any:
            return super().wait_for_workers(n_workers, timeout=0.5)

    monkeypatch.setattr(distributed, "Client", Impatient)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(
    ("address", "said"),
    [("tcp://127.0.0.1:1", "expected a dask scheduler with workers there: .*refused"),
     *((wrong, r"expected the address of a scheduler, as in tcp://host:8786")
       for wrong in ("nonsense://127.0.0.1:1", "nonsense", "tcp://host", "host:99999", ""))],
)  # fmt: skip
def test_a_missing_scheduler_is_reported_in_one_line(tmp_path: Path, address: str, said: str) -> None:
    with pytest.raises(QuadcosimError, match=rf"dask = {address}: {said}") as caught:
        sweep(study(PERIODS), out=tmp_path, dask=address)
    one_line(caught.value)


def test_the_store_can_be_used_after_a_missing_scheduler(tmp_path: Path) -> None:
    with pytest.raises(QuadcosimError, match="dask = nonsense: "):
        sweep(study(PERIODS), out=tmp_path, dask="nonsense")
    assert sweep(study(PERIODS), out=tmp_path).flown == 2


@in_test_all
@pytest.mark.usefixtures("impatient")
def test_a_scheduler_without_workers_is_reported_in_one_line(tmp_path: Path) -> None:
    said = "expected a dask scheduler with workers there"
    with closing(Cluster(tmp_path, workers=0)) as deserted, pytest.raises(QuadcosimError, match=said) as caught:
        sweep(study(PERIODS), out=tmp_path / "out", dask=deserted.address)
    one_line(caught.value)


# -- a scheduler that does not answer ---------------------------------------------------------------------


class Scheduler:
    """A scheduler that is asked, and a clock."""

    def __init__(self) -> None:
        self.time, self.questions = 0.0, list[Future[Any]]()
        self.heartbeat = Heartbeat("tcp://host:1", self.ask, lambda: self.time)

    def ask(self) -> "Future[Any]":
        self.questions.append(Future())
        return self.questions[-1]

    def at(self, time: float) -> None:
        self.time = time
        self.heartbeat.check()


def said(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return capsys.readouterr().err.splitlines()


def test_of_a_scheduler_that_answers_nothing_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    scheduler = Scheduler()
    for time in range(500):
        scheduler.questions[-1].set_result({"worker": 2})
        scheduler.at(float(time))
    assert said(capsys) == []


@pytest.mark.parametrize("answer", ["none", "no workers", "a lost connection"])
def test_that_a_scheduler_does_not_answer_is_said_once_and_ends_the_sweep(
    answer: str, capsys: pytest.CaptureFixture[str]
) -> None:
    scheduler = Scheduler()
    times = [TOLD_AFTER / 2, TOLD_AFTER, TOLD_AFTER + 1.0, TOLD_AFTER + 2.0, SILENCE]
    for time, lines in zip(times, (0, 0, 1, 0, 0)):
        if answer == "no workers":
            scheduler.questions[-1].set_result({})
        elif answer == "a lost connection":
            scheduler.questions[-1].set_exception(OSError())
        scheduler.at(time)
        assert len(said(capsys)) == lines
    with pytest.raises(QuadcosimError, match="has not answered for 120 s, or has no workers; finished runs are kept"):
        scheduler.at(SILENCE + 1.0)


def test_a_scheduler_that_answers_again_is_waited_for_anew(capsys: pytest.CaptureFixture[str]) -> None:
    scheduler = Scheduler()
    scheduler.at(SILENCE - 1.0)
    assert len(said(capsys)) == 1
    scheduler.questions[-1].set_result({"worker": 2})
    scheduler.at(SILENCE)
    scheduler.at(2.0 * SILENCE - 1.0)
    assert len(said(capsys)) == 1


@in_test_all
@pytest.mark.parametrize("end", [signal.SIGSTOP, signal.SIGKILL])
def test_a_scheduler_that_is_stopped_ends_the_sweep_in_one_line_and_it_can_be_resumed(
    end: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    chosen = study(axis("timing.period", 0.01, 0.02, 0.03, 0.04))
    whole = bits(sweep(chosen, out=tmp_path / "whole").path)

    def stop(done: int, total: int) -> None:
        if done and own.scheduler.poll() is None:
            monkeypatch.setattr(executors, "SILENCE", 0.0)
            os.kill(own.scheduler.pid, end)
            if end == signal.SIGKILL:
                own.scheduler.wait()

    with closing(Cluster(tmp_path, workers=1)) as own:
        with pytest.raises(QuadcosimError, match=r"finished runs are kept, start the sweep again$") as caught:
            sweep(chosen, out=tmp_path / "out", dask=own.address, progress=stop)
        one_line(caught.value)
    assert capfd.readouterr().err == ""
    assert 0 < rows_in(tmp_path / "out" / "study.sqlite") < 4
    found = sweep(chosen, out=tmp_path / "out")
    assert found.flown < 4
    assert bits(found.path) == whole
