"""Agreement of runs in SIMD lanes with native FMUs, and of their beginning with FMUs in Python."""

import math
from collections.abc import Callable, Generator, Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from orchestration.components.building.fmus import python_twin
from orchestration.experiments.studies import lane_agreement as kept
from orchestration.experiments.studies.lane_agreement import lane_agreement, with_python_twins
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.simulation.workers.batching import SAMPLE, LaneAgreement, Sample
from orchestration.simulation.workers.row import Outcome, Results, Rows
from orchestration.simulation.workers.task import RunTask, TaskBatch
from orchestration.systems.system.computers import Message, Network
from orchestration.systems.system.model import System
from quadcosim import Scenario
from tests.orchestration.components.fmi.small import needs_compiler, nothing_known
from tests.orchestration.experiments.studies.common import axis, short, study

pytestmark = needs_compiler
LENGTH = 5.0
Error = Callable[[RunTask, bool], float]
"""The error in the metric of a task, in a chunk or alone"""


@pytest.fixture
def chosen() -> Study:
    base = replace(short(), stop_time=LENGTH).with_changes(parameters={"plant.mass": 1.1})
    return replace(study(axis("timing.period", 0.01, 0.02), base=base), native=True)


def agreement(chosen: Study, error: Error, count: int = 2, *, here: bool = False) -> LaneAgreement | None:
    """The agreement of runs if each kind of run has this error."""
    files = with_python_twins(chosen.files())

    def rows(task: RunTask, chunk: bool) -> Rows:
        metrics = {"x": 1.0 + error(task, chunk)}
        return task.rows(Results.of([Outcome(metrics=metrics, message=None, engine="batch" if chunk else "compiled")]))

    def task(index: int, key: str) -> RunTask:
        return RunTask(index=index, key=key, system=chosen.system(index, {}))

    def run(tasks: Iterable[RunTask | TaskBatch]) -> Generator[Rows, None, None]:
        for each in tasks:
            for one in map(each.alone, range(len(each))) if isinstance(each, TaskBatch) else (each,):
                assert files.fmus.keys() >= {*one.system.fmus.values()}
                yield rows(one, isinstance(each, TaskBatch))

    sample = Sample()
    for i in range(count):
        sample.add(rows(task(i, str(i)), True))
    return lane_agreement(sample, files, task, run, here=here)


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


@pytest.fixture
def unknown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chosen: Study) -> Path:
    """The folder of agreements in a cache that has none."""
    chosen.files()
    return nothing_known(tmp_path / "cache", monkeypatch) / "quadcosim" / "agreement"


@pytest.fixture
def several(chosen: Study) -> Study:
    return replace(chosen, axes=(axis("timing.period", *(0.01 + 0.001 * i for i in range(SAMPLE))),))


def exact(task: RunTask, chunk: bool) -> float:
    return 0.0


def runs(found: LaneAgreement | None) -> tuple[int, int]:
    assert found is not None
    return found.runs, found.python.runs if found.python else 0


def test_where_a_whole_sample_has_agreed_one_run_is_enough(unknown: Path, several: Study) -> None:
    assert runs(agreement(several, exact, SAMPLE, here=True)) == (SAMPLE, SAMPLE)
    found = agreement(several, exact, SAMPLE, here=True)
    assert runs(found) == (1, 1)
    assert "1 run repeated with FMUs" in str(found)
    assert runs(agreement(several, exact, SAMPLE)) == (SAMPLE, SAMPLE)  # on other machines than this


def test_fewer_runs_than_a_sample_vouch_for_nothing(unknown: Path, chosen: Study) -> None:
    for _ in range(2):
        assert runs(agreement(chosen, exact, here=True)) == (2, 2)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"runs": 1, "difference": 0.0, "metric": null, "index": null}'])
def test_an_agreement_that_cannot_be_read_or_is_not_of_a_whole_sample_does_not_count(
    unknown: Path, several: Study, content: str
) -> None:
    agreement(several, exact, SAMPLE, here=True)
    (kept,) = unknown.iterdir()
    kept.write_text(content, encoding="utf-8")
    assert runs(agreement(several, exact, SAMPLE, here=True)) == (SAMPLE, SAMPLE)


def test_one_run_that_disagrees_has_the_whole_sample_repeated_and_ends_what_was_kept(
    unknown: Path, several: Study
) -> None:
    agreement(several, exact, SAMPLE, here=True)
    found = agreement(several, lambda task, chunk: 1e-6 * in_python(task), SAMPLE, here=True)
    assert runs(found) == (SAMPLE, SAMPLE)
    assert found is not None
    with pytest.raises(QuadcosimError, match="FMUs in Python"):
        found.expect()
    assert runs(agreement(several, exact, SAMPLE, here=True)) == (SAMPLE, SAMPLE)


def test_a_chaotic_run_does_not_stand_for_its_sample(unknown: Path, several: Study) -> None:
    agreement(several, exact, SAMPLE, here=True)
    first = "nudged begun 0"
    found = agreement(several, lambda task, chunk: 1e-6 * (task.key == first), SAMPLE, here=True)
    assert runs(found) == (SAMPLE, SAMPLE - 1)


def test_other_code_is_compared_anew(unknown: Path, several: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    def place(study: Study) -> Path:
        return kept.place_of([study.system(0, {})], files)

    files = with_python_twins(several.files())
    base = several.base
    assert isinstance(base, Scenario)
    before = place(several)
    assert place(replace(several, base=base.with_changes(parameters={"plant.mass": 1.2}))) == before
    assert place(replace(several, base=base.with_changes(parameters={"controller.coupling": False}))) != before
    assert place(replace(several, base=replace(base, timing=replace(base.timing, delay=0.003)))) != before
    for name in ("versions", "machine", "compiler", "processor"):
        with monkeypatch.context() as changed:
            changed.setattr(kept, name, lambda: ["other"])
            assert place(several) != before, name
    files.hashes[python_twin(several.system(0, {}).components["plant"].fmu)] = "other"
    assert place(several) != before


def test_a_network_may_have_load_beside_the_messages_of_connections(several: Study) -> None:
    load = Message(period=0.01, bytes=8, identifier=1)
    command = Message(connection="command", bytes=8, identifier=2)
    bus = Network(kind="can", bit_rate=500e3, messages={"load": load, "command": command})
    system, files = several.system(0, {}), several.files()
    with_both, with_one = (
        replace(system, networks={"bus": replace(bus, messages=some)}) for some in (bus.messages, {"command": command})
    )
    assert kept.place_of([with_both], files) == kept.place_of([with_one], files) != kept.place_of([system], files)
