"""Sweeps on a dask cluster."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from orchestration.studies.sweep import sweep
from quadcosim import QuadcosimError
from tests.orchestration.studies.common import (
    PERIODS,
    RUNS,
    STORE,
    Cluster,
    bits,
    one_line,
    quadcosim,
    rows_in,
    start,
    study,
    wait_for_rows,
)
from tests.patience import PATIENCE


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
        out, err = coordinator.communicate(timeout=PATIENCE)
    assert coordinator.returncode == 0, out + err
    assert bits(folder / STORE) == reference


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
@pytest.mark.parametrize(
    ("address", "said"),
    [("tcp://127.0.0.1:1", "expected a dask scheduler with workers there: .*refused"),
     *((wrong, r"expected the address of a scheduler, as in tcp://host:8786")
       for wrong in ("nonsense://127.0.0.1:1", "nonsense", "tcp://host", "host:99999", ""))],
)  # fmt: skip
def test_a_scheduler_that_is_not_there_is_one_line(tmp_path: Path, address: str, said: str) -> None:
    with pytest.raises(QuadcosimError, match=rf"--dask {address}: {said}") as caught:
        sweep(study(PERIODS), folder=tmp_path, dask=address)
    one_line(caught.value)
    assert sweep(study(PERIODS), folder=tmp_path).flown == 2, "expected the store to be of use still"


@pytest.mark.usefixtures("impatient")
def test_a_scheduler_without_workers_is_one_line(tmp_path: Path, cluster: Callable[[int], Cluster]) -> None:
    with pytest.raises(QuadcosimError, match="expected a dask scheduler with workers there") as caught:
        sweep(study(PERIODS), folder=tmp_path / "out", dask=cluster(0).address)
    one_line(caught.value)
