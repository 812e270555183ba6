"""Sweeps on a dask cluster."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.store import open_for_reading
from orchestration.experiments.studies.study import Study
from orchestration.systems.system.component import Component
from orchestration.systems.system.model import System
from quadcosim import QuadcosimError
from tests.commands import Main
from tests.orchestration.components.fmi.small import known, needs_compiler, small
from tests.orchestration.experiments.studies.common import (
    PERIODS,
    RUNS,
    STORE,
    Cluster,
    bits,
    one_line,
    rows_in,
    start,
    study,
    sweep,
    wait_for_rows,
)
from tests.patience import PATIENCE


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A dask scheduler with two workers."""
    made = Cluster(tmp_path_factory.mktemp("cluster"), workers=2)
    yield made
    made.close()


def test_a_dask_cluster_makes_the_same_rows(
    folder: Path, reference: list[dict[str, Any]], cluster: Cluster, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    main("sweep", "study.toml", "--engine", "compiled", "--dask", cluster.address)
    assert bits(folder / STORE) == reference


@needs_compiler
def test_a_run_that_hangs_in_a_dask_worker_is_a_failed_row_with_the_reason(tmp_path: Path, cluster: Cluster) -> None:
    fmu = known(small(tmp_path, "ENDS=if (m->s.gain == 3.0) for (;;) usleep(1000)"))
    gain = "components.it.parameters.gain"
    system = System(stop_time=0.1, components={"it": Component(fmu=str(fmu), step=0.01)})
    hangs = Study(name="hangs", base=system, axes=(Axis(name=gain, targets=(gain,), values=(1.0, 3.0)),))
    out = tmp_path / "out"
    found = sweep(hangs, folder=out, dask=cluster.address, time_limit=2.0, progress=None, announce=None)
    assert (found.total, found.failed) == (2, 1)
    with open_for_reading(found.path) as store:
        rows = {row["design_index"]: row["message"] for row in store.rows()}
    assert rows == {0: None, 1: "it was ended: it takes more than the time limit of 2 s"}


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

        def wait_for_workers(self, n_workers: int, timeout: float | None = None) -> None:
            super().wait_for_workers(n_workers, timeout=0.5)

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
        sweep(study(PERIODS), folder=tmp_path, dask=address)
    one_line(caught.value)


def test_the_store_can_be_used_after_a_missing_scheduler(tmp_path: Path) -> None:
    with pytest.raises(QuadcosimError, match="dask = nonsense: "):
        sweep(study(PERIODS), folder=tmp_path, dask="nonsense")
    assert sweep(study(PERIODS), folder=tmp_path).flown == 2


@pytest.mark.usefixtures("impatient")
def test_a_scheduler_without_workers_is_reported_in_one_line(tmp_path: Path) -> None:
    said = "expected a dask scheduler with workers there"
    with closing(Cluster(tmp_path, workers=0)) as deserted, pytest.raises(QuadcosimError, match=said) as caught:
        sweep(study(PERIODS), folder=tmp_path / "out", dask=deserted.address)
    one_line(caught.value)
