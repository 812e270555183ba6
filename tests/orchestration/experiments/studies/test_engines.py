"""The rows of a store have the bits of one engine, or every answer from it says that there are several."""

import os
import shutil
import signal
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.studies.drawing import study_figures
from orchestration.experiments.studies.store import note_on_engines
from orchestration.experiments.studies.study_file import load_study
from orchestration.experiments.studies.table import frame
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.simulation.engines.batch import shape
from orchestration.simulation.workers.pool import WorkerProcess
from orchestration.simulation.workers.task import RunTask, TaskBatch
from tests.commands import Main
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.experiments.studies.common import NOISY, RUNS, STORE, axis, bits, study, sweep

pytestmark = needs_compiler

BEGUN = """
[base]
stop_time = 0.1
[base.controller]
fmu = "native/UnifiedController"
[base.plant]
fmu = "native/QuadrotorPlant"
[base.timing]
plant_interval = 0.005
[[axes]]
name = "period"
sets = ["timing.period"]
values = [0.02, 0.01]
"""
CONTINUED = BEGUN.replace("0.01]", "0.01, 0.015]")
NOTE = "runs of several engines, whose metrics agree to 1e-12: 2 by batch, 1 by compiled"


def no_compiler() -> int:
    raise QuadcosimError("no compiler")


def test_status_alone_says_that_a_store_is_of_two_engines_as_their_rows_agree(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path("study.toml")
    path.write_text(BEGUN)
    assert main("sweep", path, "--engine", "batch", "-q").stderr == ""
    assert "several engines" not in main("status", path).stdout
    path.write_text(CONTINUED)
    assert main("sweep", path, "--engine", "compiled", "-q").stderr == ""
    assert NOTE in main("status", path, "-q").stdout.splitlines()
    assert '"engines": {\n    "batch": 2,\n    "compiled": 1\n  }' in main("status", path, "--json").stdout
    assert main("export", path, "-q").stderr == ""
    assert frame(STORE)["engine"].tolist() == ["batch", "batch", "compiled"]
    drawn, _ = study_figures(load_study(path), STORE, None)
    assert [figure.get_suptitle() for figure in drawn.values()] == [""]


def test_of_one_engine_nothing_is_said() -> None:
    assert note_on_engines({}) is None
    assert note_on_engines({"batch": 3}) is None


@pytest.mark.parametrize("quiet", [[], ["-q"]])
def test_a_failed_compile_does_not_continue_runs_in_lanes_by_another_engine(
    quiet: list[str], tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path("study.toml")
    path.write_text(BEGUN)
    main("sweep", path)
    before = bits(STORE)
    path.write_text(CONTINUED)
    with monkeypatch.context() as broken:
        broken.setattr(shape, "preferred_lanes", no_compiler)
        done = main("sweep", path, *quiet, code=1)
    assert done.stderr.splitlines()[-1] == (
        f"quadcosim: {STORE}: expected engine batch, as of the runs there (no compiler); another one needs another "
        "folder, --out"
    )
    assert bits(STORE) == before
    path.write_text(BEGUN)
    assert "2 of 2 runs" in main("status", path).stdout, "its design is as before, too"
    path.write_text(CONTINUED)
    main("sweep", path)
    after = bits(STORE)
    shutil.rmtree("results")
    main("sweep", path)
    assert bits(STORE) == after


def test_a_sweep_that_begins_with_a_failed_compile_says_so_also_where_it_is_quiet(
    tmp_path: Path, main: Main, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(shape, "preferred_lanes", no_compiler)
    path = Path("study.toml")
    path.write_text(BEGUN)
    said = "warning: engine compiled: native FMUs, one run at a time (no compiler)\n"
    assert main("sweep", path, "-q").stderr == said
    path.write_text(CONTINUED)
    assert main("sweep", path, "-q").stderr == said


def test_runs_that_were_begun_without_lanes_are_continued_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as broken:
        broken.setattr(shape, "preferred_lanes", no_compiler)
        sweep(study(axis("timing.period", 0.01, 0.02)), out=tmp_path, engine="auto")
    told: list[str] = []
    more = study(axis("timing.period", 0.01, 0.02, 0.03))
    found = sweep(more, out=tmp_path, engine="auto", announce=told.append)
    assert told == ["engine compiled: native FMUs, one run at a time (as the runs there)"]
    assert (found.engine, found.engines) == ("compiled", {"compiled": 3})


@pytest.mark.parametrize("with_signal", [signal.SIGKILL, signal.SIGABRT])
@pytest.mark.parametrize("at", [1, 2])
def test_a_sweep_in_lanes_has_the_same_bits_whichever_chunk_its_worker_dies_in(
    at: int, with_signal: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "study.toml").write_text(NOISY)
    chosen = load_study(tmp_path / "study.toml")
    whole = bits(sweep(chosen, out=tmp_path / "whole", engine="batch").path)
    request, requests = WorkerProcess.request, 0

    def killed(self: WorkerProcess, task: RunTask | TaskBatch) -> Any:
        nonlocal requests
        requests += 1
        if requests == at:
            os.kill(self._child.pid, with_signal)
        return request(self, task)

    monkeypatch.setattr(WorkerProcess, "request", killed)
    found = sweep(chosen, out=tmp_path / "killed", engine="batch")
    assert requests > at
    assert found.engines == {"batch": RUNS}
    assert bits(found.path) == whole
