"""An FMU that ends the run: it is an outcome, with the rows that there are, in each engine and each process."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.components.fmi import opening
from orchestration.components.fmi.isolated_instance import IsolatedInstance
from orchestration.components.fmi.opening import Repeatability
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.runs.prepared import prepared
from orchestration.simulation.runs.result import Result
from orchestration.simulation.runs.run_directory import load_run, save_run
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import Criterion, System
from tests.commands import Main
from tests.native import assert_the_same
from tests.orchestration.components.fmi.small import needs_compiler, small
from tests.orchestration.components.fmi.test_foreign_fmus import alone, ran

pytestmark = needs_compiler
ENGINES: tuple[Engine, ...] = ("python", "compiled")


def judged(system: System) -> System:
    """With an objective, and a criterion that every row fulfils."""
    return replace(system, objectives={"peak": "max(it.count)"}, criterion=Criterion(good="peak >= 0"))


def each(system: System) -> Result:
    """The result of both engines, which is the same."""
    one, other = (ran(system, engine=engine, load=opening.open_here) for engine in ENGINES)
    assert_the_same(other, one)
    assert (one.termination, one.divergence) == (other.termination, None)
    return one


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_run_that_an_fmu_ends_with_a_whole_step_has_the_row_of_its_end(fmi: int, tmp_path: Path) -> None:
    result = each(judged(alone(small(tmp_path, "ENDS_AT=0.05", fmi=fmi), array=fmi == 3)))
    assert result.termination == f"it (Small): fmi{fmi}DoStep: ends the run at 0.05 s"
    assert result.signals["time"].tolist() == pytest.approx(np.linspace(0.0, 0.05, 6))
    assert result.signals["it.count"].tolist() == [0, 1, 2, 3, 4, 5]
    expected = {"outcome": "terminated", "good": False, "horizon": 0.05, "peak": 5.0, "diverged": False, "steps": 5}
    assert expected.items() <= result.metrics.items()
    assert result.metrics["divergence_time"] is None


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_step_that_was_not_whole_leaves_the_rows_before_it(fmi: int, tmp_path: Path) -> None:
    result = each(alone(small(tmp_path, "ENDS_AT=0.055", fmi=fmi), array=fmi == 3))
    assert result.termination == f"it (Small): fmi{fmi}DoStep: ends the run at 0.055 s"
    assert result.signals["time"].tolist() == pytest.approx(np.linspace(0.0, 0.05, 6))
    assert (result.metrics["outcome"], result.metrics["good"]) == ("terminated", None)


def test_a_run_that_ends_at_once_has_its_first_row(tmp_path: Path) -> None:
    result = each(judged(alone(small(tmp_path, "ENDS_AT=0.005"))))
    assert len(result.rows) == 1
    assert result.metrics["outcome"] == "terminated"


def test_a_discarded_step_ends_the_run_if_it_is_the_last_one(tmp_path: Path) -> None:
    path = small(tmp_path, "DISCARDS_FROM=0.095")
    result = each(alone(path, stop=0.1))
    assert result.termination == "it (Small): fmi2DoStep: discards the step to 0.1 s"
    assert result.metrics["outcome"] == "terminated"
    assert result.signals["time"][-1] == 0.09
    for engine in ENGINES:
        with pytest.raises(SimulatorError, match=r"^it \(Small\): fmi2DoStep: discards the step to 0.1 s$"):
            ran(alone(path, stop=0.11), engine=engine, load=opening.open_here)


def test_the_instant_at_which_a_run_ends_is_gone_through_by_all(tmp_path: Path) -> None:
    ends, goes_on = small(tmp_path / "a", "ENDS_AT=0.05"), small(tmp_path / "b")
    system = System(
        stop_time=0.1,
        components={
            "it": Component(fmu=str(ends), step=0.01),
            "task": Component(fmu=str(goes_on), sampling=Sampling(period=0.01)),
            "other": Component(fmu=str(goes_on), step=0.01),
        },
        connections=(
            Connection(name="read", start=("it.count",), end=("task.u",)),
            Connection(name="sent", start=("task.y",), end=("other.u",), order="jacobi"),
        ),
    )
    result = each(system)
    assert result.signals["other.count"].tolist() == [0, 1, 2, 3, 4, 5]
    assert result.signals["task.count"].tolist() == [1, 2, 3, 4, 5, 6]
    assert [event.time for event in result.events if event.kind == "sampled"][-1] == 50_000_000
    assert max(event.time for event in result.events) == 50_000_000


@pytest.mark.parametrize(("end", "last"), [("0.06", 0.04), ("0.05", 0.02)])
def test_a_task_that_ends_the_run_has_its_sample_if_the_step_was_whole(end: str, last: float, tmp_path: Path) -> None:
    path = small(tmp_path, f"ENDS_AT={end}")
    result = each(System(stop_time=0.1, components={"it": Component(fmu=str(path), sampling=Sampling(period=0.02))}))
    assert result.signals["time"][-1] == last
    assert result.metrics["outcome"] == "terminated"


def test_isolated_or_not_a_run_ends_the_same(tmp_path: Path) -> None:
    system = judged(alone(small(tmp_path, "ENDS_AT=0.05")))
    here, there = ran(system, load=opening.open_here), ran(system, load=IsolatedInstance)
    assert here.rows.tobytes() == there.rows.tobytes()
    assert here.termination == there.termination
    assert here.metrics == there.metrics


@pytest.mark.parametrize("load", [opening.open_here, IsolatedInstance])
def test_an_instance_that_has_ended_a_run_is_for_no_other(
    load: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "orchestration.components.fmi.opening.repeatability_of", lambda path, access: Repeatability(reset=True)
    )
    monkeypatch.setattr("orchestration.components.fmi.reuse.open_instance", load)
    kept = Instances()
    used = []
    for stop in (0.04, 0.04, 0.1, 0.04):
        with prepared(alone(small(tmp_path, "ENDS_AT=0.05"), stop=stop), load=kept.load) as simulation:
            used.append(simulation.instances["it"])
            simulation.master.initialise()
            simulation.master.run()
    assert used[0] is used[1] is used[2] is not used[3]
    kept.close()


def test_a_termination_is_kept_and_told(tmp_path: Path, main: Main) -> None:
    result = ran(judged(alone(small(tmp_path, "ENDS_AT=0.05"))))
    again = load_run(save_run(result, tmp_path / "kept", figures=False))
    assert again.termination == result.termination
    assert again.metrics == json.loads((tmp_path / "kept" / "metrics.json").read_text()) == result.metrics
    assert "terminated: it (Small)" in repr(result._repr_html_())
    (tmp_path / "system.toml").write_text(result.request.to_toml(), encoding="utf-8")
    assert (
        "terminated at 50 ms: it (Small): fmi2DoStep: ends the run at 0.05 s"
        in main("run", tmp_path / "system.toml").stdout
    )


def test_no_outcome_of_a_criterion_is_called_so() -> None:
    with pytest.raises(
        UsageError, match="outcomes = 'good, terminated': expected two names, and neither is diverged or"
    ):
        Criterion(outcomes=("good", "terminated"))
