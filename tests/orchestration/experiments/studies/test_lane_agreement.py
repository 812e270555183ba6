"""Agreement of runs in SIMD lanes with native FMUs, and of their beginning with FMUs in Python."""

import math
from collections.abc import Callable, Generator, Iterable
from dataclasses import replace

import pytest

from orchestration.experiments.studies.lane_agreement import lane_agreement, with_python_twins
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.simulation.workers.batching import LaneAgreement
from orchestration.simulation.workers.row import Row
from orchestration.simulation.workers.task import RunTask, TaskBatch, TaskOutcome
from orchestration.systems.system.model import System
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.experiments.studies.common import axis, short, study

pytestmark = needs_compiler
LENGTH = 5.0
Error = Callable[[RunTask, bool], float]
"""The error in the metric of a task, in a chunk or alone"""


@pytest.fixture
def chosen() -> Study:
    base = replace(short(), stop_time=LENGTH).with_changes(parameters={"plant.mass": 1.1})
    return replace(study(axis("timing.period", 0.01, 0.02), base=base), native=True)


def agreement(chosen: Study, error: Error) -> LaneAgreement | None:
    """The agreement of two runs if each kind of run has this error."""
    files = with_python_twins(chosen.files())

    def row(task: RunTask, chunk: bool) -> Row:
        metrics = {"x": 1.0 + error(task, chunk)}
        return Row(index=task.index, key=task.key, settings={}, seed=0, metrics=metrics, message=None, duration=0.0)

    def task(index: int, key: str) -> RunTask:
        return RunTask(index=index, key=key, settings={}, system=chosen.system(index, {}), keep_signals=False)

    def run(tasks: Iterable[RunTask | TaskBatch]) -> Generator[list[TaskOutcome], None, None]:
        for each in tasks:
            for one in each.tasks if isinstance(each, TaskBatch) else (each,):
                assert files.fmus.keys() >= {*one.system.fmus.values()}
                yield [TaskOutcome(row=row(one, isinstance(each, TaskBatch)))]

    return lane_agreement({str(i): row(task(i, str(i)), True) for i in range(2)}, files, task, run)


def in_python(task: RunTask) -> bool:
    return not any(fmu.startswith("native/") for fmu in task.system.fmus.values())


def test_whole_runs_are_compared_with_native_fmus_and_their_beginning_with_python(chosen: Study) -> None:
    seen: list[tuple[bool, bool, float]] = []

    def error(task: RunTask, chunk: bool) -> float:
        seen.append((in_python(task), chunk, task.system.stop_time))
        return 0.0

    found = agreement(chosen, error)
    assert found is not None
    assert found.python is not None
    assert (found.runs, found.python.runs) == (2, 2)
    assert {*seen} == {(False, True, LENGTH), (False, False, LENGTH), (False, True, 1.0), (True, False, 1.0)}
    assert "2 runs repeated with FMUs" in str(found)
    assert "the beginning of 2 with FMUs in Python" in str(found)
    assert LaneAgreement.from_text(found.as_text()) == found


def test_an_error_of_compilation_disagrees_with_python(chosen: Study) -> None:
    found = agreement(chosen, lambda task, chunk: 1e-6 * in_python(task))
    assert found is not None
    assert found.difference == 0.0
    with pytest.raises(QuadcosimError, match="differs by 1e-06 from that by its FMUs in Python, at the beginning"):
        found.expect()


def test_a_chaotic_run_that_its_last_bits_change_is_not_compared_with_python(chosen: Study) -> None:
    def error(task: RunTask, chunk: bool) -> float:
        nudged = task.key.startswith("nudged ")
        return 1e-6 * (in_python(task) + 2.0 * nudged) * (task.index == 0)

    found = agreement(chosen, error)
    assert found is not None
    assert found.python is not None
    assert found.python.runs == 1
    found.expect()


def test_a_nudged_run_has_each_real_parameter_changed_in_its_last_bit_except_zeros(chosen: Study) -> None:
    given = {"plant.mass": 1, "controller.coupling": True, "plant.drag.x": 0.0}
    base = chosen.base.with_changes(parameters=given)  # type: ignore[attr-defined]
    seen: dict[str, System] = {}

    def error(task: RunTask, chunk: bool) -> float:
        seen[task.key] = task.system
        return 0.0

    study = replace(chosen, base=base)
    agreement(study, error)
    begun, nudged = seen["begun 0"], seen["nudged begun 0"]
    models = study.files().models_of(begun)
    for name, model in models.items():
        before, after = (system.components[name].parameters for system in (begun, nudged))
        for v in model.variables.values():
            if v.causality == "parameter" and v.start is not None:
                value = before.get(v.name, v.start)
                moves = v.kind == "Real" and float(value) != 0.0
                assert (float(after[v.name]) != float(value)) if moves else (after.get(v.name, value) == value), v.name
                assert not moves or v.maximum is None or float(after[v.name]) <= v.maximum
    assert nudged.components["plant"].parameters["mass"] == math.nextafter(1.0, math.inf)
