"""A study runs on a GPU, emulated by the CPU, as in lanes; without a GPU what is missing is reported."""

from pathlib import Path

import pytest

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.simulation.engines.cuda import compiler, driver, fleet
from orchestration.simulation.engines.cuda.driver import Gpu
from orchestration.simulation.workers.choice import choose_execution
from orchestration.simulation.workers.pool import Supervisor
from orchestration.simulation.workers.task import Runner, RunTask, TaskBatch, TaskOutcome
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.experiments.studies.common import axis, short, study, sweep
from tests.orchestration.simulation.workers.test_choice import first

pytestmark = needs_compiler


def test_a_sweep_on_a_gpu_agrees_with_the_fmus(gpu: Gpu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runner, on_gpu = Runner(), list[int]()

    def run_chunk(self: Supervisor, chunk: TaskBatch) -> list[TaskOutcome]:
        on_gpu.extend([len(chunk.tasks)] * chunk.on_gpu)
        return runner.run_chunk(chunk)

    def run(self: Supervisor, task: RunTask) -> TaskOutcome:
        return runner.run(task)

    monkeypatch.setattr(Supervisor, "run_chunk", run_chunk)  # in this process, which emulates the GPU
    monkeypatch.setattr(Supervisor, "run", run)
    monkeypatch.setattr(fleet, "expect_compiler", lambda: None)
    some = study(axis("timing.period", 0.01, 0.02), axis("plant.mass", 0.9, 1.0, 1.1), base=short())
    summary = sweep(some, folder=tmp_path, engine="cuda")
    assert (summary.engine, summary.flown, summary.failed, on_gpu) == ("cuda", 6, 0, [6])
    assert summary.agreement is not None
    assert summary.agreement.runs == 6
    assert summary.agreement.difference < 1e-12


def test_without_a_driver_what_is_missing_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "expect_compiler", lambda: None)
    monkeypatch.setattr(driver, "LIBRARY", "libno_gpu.so.1")
    with pytest.raises(QuadcosimError, match=r"cuda: no driver of an NVIDIA GPU: expected libno_gpu\.so\.1$"):
        choose_execution("cuda", False, first)


def test_an_error_of_the_driver_is_reported(gpu: Gpu) -> None:
    with pytest.raises(QuadcosimError, match=r"^cuModuleLoadData: not found \(500\)$"):
        gpu.kernel(b"no image", "fly")


def test_without_a_compiler_what_to_install_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    compiler._library.cache_clear()
    try:
        with pytest.raises(
            QuadcosimError, match=r"^NVRTC is not installed; this needs: pip install 'quadcosim\[cuda\]'$"
        ):
            compiler.expect_compiler()
    finally:
        compiler._library.cache_clear()
