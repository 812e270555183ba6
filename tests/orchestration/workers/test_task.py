"""What flies the runs of a sweep in a process: each FMU instantiated once, nothing of a run left in the next."""

from pathlib import Path
from typing import Any

import pytest

from orchestration.building.inputs import with_files
from orchestration.fmi.fmi2 import Fmi2Instance
from orchestration.quadrotor.scenario import Scenario
from orchestration.workers.task import Outcome, Runner, RunTask, WorkerEnvironmentError
from quadcosim import QuadcosimError
from tests.orchestration.studies.common import FAILS, files_in, short


def task(scenario: Scenario, index: int = 0) -> RunTask:
    system = with_files(scenario.as_system(), files_in(scenario).fmus)
    return RunTask(index=index, key="", settings={}, system=system, keep_signals=False)


@pytest.fixture
def instantiated(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the instances that are made, in order."""
    names: list[str] = []

    class Counted(Fmi2Instance):
        def __init__(self, path: Path, instance_name: str) -> None:
            names.append(instance_name)
            super().__init__(path, instance_name)

    monkeypatch.setattr("orchestration.fmi.reuse.open_instance", Counted)
    return names


def rmse(outcome: Outcome) -> str:
    assert outcome.row.metrics is not None, outcome.row.message
    return str(outcome.row.metrics["position_rmse"].hex())


def test_each_fmu_is_instantiated_once_in_a_process(instantiated: list[str]) -> None:
    runner = Runner()
    for period in (0.01, 0.02, 0.03, 0.01):
        runner.fly(task(short(period=period)))
    assert sorted(instantiated) == ["controller", "plant"]


def test_an_fmu_that_failed_is_made_anew_and_the_next_run_is_as_if_nothing_had_been(instantiated: list[str]) -> None:
    runner = Runner()
    before = rmse(runner.fly(task(short())))
    assert runner.fly(task(short().with_changes(parameters={"plant.mass": FAILS}))).row.metrics is None
    assert rmse(runner.fly(task(short()))) == before
    assert instantiated.count("plant") == 2


def test_nothing_of_a_run_is_left_in_the_next() -> None:
    runner, plain = Runner(), short(period=0.02)
    odd = short(order="jacobi", hold="first", delay=0.03, noise={"position": 0.1}).with_changes(
        parameters={"plant.mass": 3.0, "controller.coupling": 5.0, "plant.initial.position.z": 1.0}
    )
    before = rmse(runner.fly(task(plain)))
    assert rmse(runner.fly(task(odd))) != before
    assert rmse(runner.fly(task(plain))) == before


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device"), MemoryError(), QuadcosimError("does not load")]
)
def test_what_is_not_the_runs_own_failure_is_no_row(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def load(path: Path, instance_name: str) -> Any:
        raise error

    runner = Runner()
    monkeypatch.setattr(runner._instances, "load", load)
    with pytest.raises(WorkerEnvironmentError):
        runner.fly(task(short()))


def test_an_fmu_that_cannot_be_reset_is_made_anew_for_the_next_run(instantiated: list[str]) -> None:
    runner = Runner()
    before = rmse(runner.fly(task(short())))
    next(iter(runner._instances._kept.values())).failed = True  # it refuses the reset
    assert rmse(runner.fly(task(short()))) == before
    assert len(instantiated) == 3
