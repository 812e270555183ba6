"""The runner of a worker process: each FMU is instantiated once, and no run affects the next."""

from pathlib import Path
from typing import Any

import pytest

from orchestration.components.fmi.access import Access
from orchestration.components.fmi.fmi2 import Fmi2Instance
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.simulation.workers.row import Results
from orchestration.simulation.workers.task import Runner, RunTask, WorkerEnvironmentError
from orchestration.systems.system.files import with_files
from quadcosim import QuadcosimError
from tests.orchestration.experiments.studies.common import FAILS, files_in, short


def task(scenario: Scenario, index: int = 0) -> RunTask:
    system = with_files(scenario.as_system(), files_in(scenario).fmus)
    return RunTask(index=index, key="", system=system)


@pytest.fixture
def instantiated(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the created instances, in order."""
    names: list[str] = []

    class Counted(Fmi2Instance):
        def __init__(self, path: Path, instance_name: str, access: Access) -> None:
            names.append(instance_name)
            super().__init__(path, instance_name)

    monkeypatch.setattr("orchestration.components.fmi.reuse.open_instance", Counted)
    return names


def rmse(results: Results) -> str:
    metrics = results.metrics(0)
    assert metrics is not None, results.messages
    return str(metrics["position_rmse"].hex())


def test_each_fmu_is_instantiated_once_in_a_process(instantiated: list[str]) -> None:
    runner = Runner()
    for period in (0.01, 0.02, 0.03, 0.01):
        runner.run(task(short(period=period)))
    assert sorted(instantiated) == ["controller", "plant"]


def test_an_fmu_that_failed_is_replaced_and_the_next_run_is_unaffected(instantiated: list[str]) -> None:
    runner = Runner()
    before = rmse(runner.run(task(short())))
    assert runner.run(task(short().with_changes(parameters={"plant.mass": FAILS}))).metrics(0) is None
    assert rmse(runner.run(task(short()))) == before
    assert instantiated.count("plant") == 2


def test_no_run_affects_the_next() -> None:
    runner, plain = Runner(), short(period=0.02)
    odd = short(order="jacobi", hold="first", delay=0.03, noise={"position": 0.1}).with_changes(
        parameters={"plant.mass": 3.0, "controller.coupling": 5.0, "plant.initial.position.z": 1.0}
    )
    before = rmse(runner.run(task(plain)))
    assert rmse(runner.run(task(odd))) != before
    assert rmse(runner.run(task(plain))) == before


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), MemoryError(), QuadcosimError("does not load")]
)
def test_a_failure_not_caused_by_the_run_makes_no_row(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def load(path: Path, instance_name: str) -> Any:
        raise error

    runner = Runner()
    monkeypatch.setattr(runner._instances, "load", load)
    with pytest.raises(WorkerEnvironmentError):
        runner.run(task(short()))


def test_an_fmu_that_cannot_be_reset_is_replaced_for_the_next_run(instantiated: list[str]) -> None:
    runner = Runner()
    before = rmse(runner.run(task(short())))
    next(iter(runner._instances._kept.values())).failed = True  # it refuses the reset
    assert rmse(runner.run(task(short()))) == before
    assert len(instantiated) == 3
