"""A pool of worker processes leaves nothing behind, whatever ends its sweep."""

import threading
from contextlib import ExitStack
from pathlib import Path

import pytest

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.study import Study
from orchestration.simulation.workers import pool
from orchestration.simulation.workers.executors import _local_submit
from orchestration.simulation.workers.pool import Inputs, Pool
from orchestration.simulation.workers.provenance import Sources, sources, versions
from orchestration.simulation.workers.row import Results
from orchestration.simulation.workers.task import RunTask, TaskBatch
from orchestration.systems.system.component import Component
from orchestration.systems.system.model import System
from quadcosim import QuadcosimError, UsageError
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.experiments.studies.common import sweep

GAIN = "components.it.parameters.gain"


def inputs(**contents: bytes) -> Inputs:
    return Inputs(
        contents={f"{name}.fmu": content for name, content in contents.items()}, own_fmus=frozenset(), versions={}
    )


def task() -> RunTask:
    system = System(stop_time=1.0, components={"it": Component(fmu="a.fmu", step=0.1)})
    return RunTask(index=0, key="", system=system)


def study(
    folder: Path, *habits: str, objective: str = "max(it.y)", gains: tuple[float, ...] = (1.0, 2.0, 3.0)
) -> Study:
    system = System(
        stop_time=0.1,
        components={"it": Component(fmu=str(small(folder, *habits)), step=0.01)},
        objectives={"last": objective},
    )
    return Study(name="fails", base=system, axes=(Axis(name=GAIN, targets=(GAIN,), values=gains),))


@needs_compiler
def test_a_sweep_with_a_wrong_expression_leaves_nothing(temporary: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"there is no it\.z"):
        sweep(study(tmp_path, objective="max(it.z)"), out=tmp_path / "out", progress=None, announce=None)
    assert not list(temporary.iterdir())


@needs_compiler
def test_a_sweep_whose_fmu_does_not_start_leaves_nothing(temporary: Path, tmp_path: Path) -> None:
    wrong = study(tmp_path, "EXITS_AT_START", gains=(1.0, 2.0))
    assert sweep(wrong, out=tmp_path / "out", workers=2, progress=None, announce=None).failed == 2
    assert not list(temporary.iterdir())


@needs_compiler
def test_an_interrupted_sweep_leaves_nothing(temporary: Path, tmp_path: Path) -> None:
    def interrupt(done: int, total: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(study(tmp_path), out=tmp_path / "out", workers=2, progress=interrupt, announce=None)
    assert not list(temporary.iterdir())


def test_fmus_that_cannot_be_written_are_one_line_and_leave_nothing(temporary: Path) -> None:
    with pytest.raises(QuadcosimError, match=r"expected to be written, for the workers: .*too long") as caught:
        Pool(inputs(**{"a": b"first", "x" * 250: b"second"}))  # with a number before it too long for a file
    assert str(temporary) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert not list(temporary.iterdir())


def test_a_closed_pool_starts_no_process(temporary: Path) -> None:
    pool = Pool(inputs(a=b"content"))
    pool.close()
    with pytest.raises(QuadcosimError, match="the sweep has ended"):
        pool.run(task())
    pool.remove()
    assert not list(temporary.iterdir())


@pytest.mark.parametrize(("read_at", "expected"), [(None, "received"), ((0, 0, 0), versions()["sources"])])
def test_a_worker_reads_the_sources_only_if_one_was_edited_since_the_coordinator_did(
    read_at: tuple[int, int, int] | None, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    states = sources().states
    known = states if read_at is None else dict.fromkeys(states, read_at)
    monkeypatch.setattr(pool, "sources", lambda: Sources(hash="received", states=known))
    worker = pool.WorkerProcess(tmp_path)
    try:
        assert worker.wait_until_ready(frozenset()).versions == {**versions(), "sources": expected}
    finally:
        worker.close()


def test_temporary_files_are_removed_after_the_last_thread_that_could_leave_more(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started, closed = threading.Event(), threading.Event()

    class Slow(pool.Supervisor):
        def run(self, task: RunTask | TaskBatch) -> Results:
            started.set()
            closed.wait()
            (self._root / "late").mkdir(parents=True)
            raise QuadcosimError("the sweep has ended")

        def close(self) -> None:
            closed.set()

    monkeypatch.setattr(pool, "Supervisor", Slow)
    with ExitStack() as stack:
        future = _local_submit(stack, inputs(a=b"content"), 1)(task())
        started.wait()
    assert isinstance(future.exception(), QuadcosimError)
    assert not list(temporary.iterdir())
