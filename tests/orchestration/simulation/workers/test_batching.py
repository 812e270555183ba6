"""A sweep in SIMD lanes writes the rows that the FMUs of its runs would have written, and reports their agreement."""

import dataclasses
import random
from pathlib import Path
from typing import Any

import pytest

from orchestration.experiments.studies.missing_runs import AGREEMENT
from orchestration.experiments.studies.store import open_for_reading
from orchestration.experiments.studies.study import Study
from orchestration.experiments.studies.study_file import load_study
from orchestration.foundation.basics.errors import QuadcosimError, UsageError
from orchestration.foundation.basics.interrupt import Interrupted
from orchestration.foundation.processes.child import Died, Ending
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.simulation.workers.batching import SAMPLE, LaneAgreement, Sample, batched, chunks
from orchestration.simulation.workers.pool import Inputs, Supervisor
from orchestration.simulation.workers.row import Outcome, Results, Rows
from orchestration.simulation.workers.task import RunTask, TaskBatch
from orchestration.systems.system.files import with_files
from tests.commands import Main
from tests.orchestration.components.fmi.small import needs_compiler, nothing_known, small
from tests.orchestration.experiments.studies.common import NOISY, RUNS, STORE, axis, bits, short, study, sweep, swept

pytestmark = needs_compiler
OWN = ("duration", "machine", "engine")


def noisy(folder: Path) -> Study:
    (folder / "study.toml").write_text(NOISY, encoding="utf-8")
    return load_study(folder / "study.toml")


def assert_alike(lanes: list[dict[str, Any]], alone: list[dict[str, Any]]) -> None:
    """The same rows, numbers to 1e-12, without what is of the machine."""
    assert len(lanes) == len(alone)
    for one, other in zip(lanes, alone):
        assert one.keys() == other.keys()
        for name in one.keys() - {*OWN}:
            if _is_hex(one[name]) and _is_hex(other[name]):
                number = float.fromhex(other[name])
                assert float.fromhex(one[name]) == pytest.approx(number, rel=1e-12, abs=0.0), name
            else:
                assert (name, one[name]) == (name, other[name])


def _is_hex(value: Any) -> bool:
    return isinstance(value, str) and value.lstrip("-").startswith("0x")


def test_rows_are_those_of_the_fmus_and_the_command_reports_their_agreement(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, main: Main
) -> None:
    chosen = noisy(tmp_path)
    alone = bits(swept(dataclasses.replace(chosen, native=True), tmp_path / "alone"))
    nothing_known(tmp_path / "cache", monkeypatch)
    monkeypatch.chdir(tmp_path)
    done = main("sweep", "study.toml", "--engine", "batch")
    assert "8 runs repeated with FMUs: largest relative difference" in done.stdout
    assert done.stdout.splitlines()[-1] in main("status", "study.toml").stdout
    lanes = bits(tmp_path / STORE)
    assert [row["engine"] for row in lanes] == ["batch"] * RUNS
    assert_alike(lanes, alone)
    with open_for_reading(tmp_path / STORE) as opened:
        agreement = LaneAgreement.from_text(opened.about()[AGREEMENT])
    assert agreement.runs == SAMPLE
    assert agreement.difference < 1e-12
    assert agreement.python is not None
    assert agreement.python.runs == SAMPLE
    assert agreement.python.difference < 1e-9


def test_a_sweep_continues_and_repeats_no_run(tmp_path: Path) -> None:
    few = study(axis("timing.period", 0.01, 0.02))
    more = study(axis("timing.period", 0.01, 0.02, 0.03))
    assert sweep(few, out=tmp_path, engine="batch").flown == 2
    summary = sweep(more, out=tmp_path, engine="batch")
    assert (summary.flown, summary.total) == (1, 3)
    assert sweep(more, out=tmp_path, engine="batch").agreement is None


def test_runs_that_are_not_known_to_agree_are_compared_by_the_next_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    some, repeated = study(axis("timing.period", 0.01, 0.02)), list[int]()
    more = study(axis("timing.period", 0.01, 0.02, 0.03))
    differs, agrees = LaneAgreement.of([(0, {"x": 1.0}, {"x": 2.0})]), LaneAgreement.of([])
    found = iter([None, differs, agrees])

    def compared(sample: Sample, *_: object, **__: object) -> LaneAgreement:
        repeated.append(len(sample.runs))
        assert all("good" in one.metrics and one.run in range(3) for one in sample.runs.values())
        if (one := next(found)) is None:
            raise KeyboardInterrupt
        return one

    monkeypatch.setattr("orchestration.experiments.studies.missing_runs.lane_agreement", compared)
    with pytest.raises(Interrupted):
        sweep(some, out=tmp_path, engine="batch")
    with pytest.raises(QuadcosimError, match="in lanes differs"):
        sweep(more, out=tmp_path, engine="batch")
    summary = sweep(more, out=tmp_path, engine="batch")
    assert (summary.flown, summary.agreement) == (0, agrees)
    assert sweep(more, out=tmp_path, engine="batch").agreement is None
    assert repeated == [2, 3, 3]


def test_a_run_that_its_fmus_refuse_has_the_same_row_as_outside_of_lanes(tmp_path: Path) -> None:
    chosen = study(axis("plant.inertia.xy", 0.0, 1.0), axis("plant.mass", 0.9, 1.1))
    alone = bits(swept(dataclasses.replace(chosen, native=True), tmp_path / "alone"))
    assert {row["status"] for row in alone} == {"done", "failed"}
    assert_alike(bits(swept(chosen, tmp_path / "lanes", engine="batch")), alone)


def test_a_system_without_lanes_is_refused_before_any_run(tmp_path: Path) -> None:
    path = small(tmp_path)
    text = f"""
    axes = [{{ name = "x", sets = ["components.one.parameters.gain"], values = [1.0, 2.0] }}]
    [base]
    stop_time = 0.1
    [base.components.one]
    fmu = "{path}"
    step = 0.01
    """
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    with pytest.raises(UsageError, match=r"components.one: small.fmu: expected a native FMU"):
        sweep(load_study(tmp_path / "study.toml"), out=tmp_path / "out", engine="batch")
    assert not (tmp_path / "out" / "study.sqlite").exists()


def test_a_difference_names_run_and_metric() -> None:
    agreement = LaneAgreement.of(
        [(3, {"a": 1.0, "b": None}, {"a": 1.0, "b": None}), (7, {"a": 2.0}, {"a": 2.0 + 1e-6})]
    )
    assert (agreement.runs, agreement.metric, agreement.index) == (2, "a", 7)
    with pytest.raises(QuadcosimError, match=r"run 7: a in lanes differs by 5e-07"):
        agreement.expect()
    with pytest.raises(QuadcosimError, match="run 1: outcome"):
        LaneAgreement.of([(1, {"outcome": "good"}, {"outcome": "bad"})]).expect()
    LaneAgreement.of([(3, {"a": 1.0}, {"a": 1.0 + 1e-12})]).expect()


def test_a_sample_is_chosen_by_content_alone() -> None:
    keys = [f"{i:064x}" for i in range(100)]
    one, other = Sample(), Sample()
    one.add(in_lanes(*keys))
    for key in reversed(keys):
        other.add(in_lanes(key))
        other.add(in_lanes(f"no {key}", engine=None))
    assert one.runs == other.runs
    assert len(one.runs) == SAMPLE
    assert {*one.runs} != {*keys[:SAMPLE]}


def in_lanes(*keys: str, engine: str | None = "batch") -> Rows:
    results = Results.of([Outcome(metrics={"steps": 1}, message=None, engine=engine)] * len(keys))
    return Rows(index=[0] * len(keys), key=keys, seed=[0] * len(keys), results=results)


def tasks(count: int) -> list[RunTask]:
    chosen = study(axis("timing.period", 0.01, 0.02), base=short())
    return [RunTask(index=i, key=str(i), system=chosen.system(i % 2, {})) for i in range(count)]


def test_chunks_group_similar_runs() -> None:
    lanes = [each.index for each in chunks(batched(tasks(64)), 64, 1)]
    assert sorted(index for each in lanes for index in each) == [*range(64)]
    assert [len({index % 2 for index in each}) for each in lanes].count(2) <= 1


@pytest.mark.parametrize(
    ("code", "repeated"), [(-9, [[0, 1, 2], [0, 1, 2]]), (-6, [[0, 1, 2], [0], [1], [2]])], ids=["killed", "crashed"]
)
def test_runs_whose_process_ends_are_repeated_in_lanes(
    code: int, repeated: list[list[int]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[list[int]] = []

    class DiesOnce:
        def request(self, what: Any) -> Any:
            asked.append([*what.index])
            if len(asked) == 1:
                raise Died(Ending(code=code))
            return Results.of([Outcome(metrics={"steps": index}, message=None) for index in asked[-1]])

    monkeypatch.setattr(Supervisor, "_ready_worker", lambda self: DiesOnce())
    found = Supervisor(tmp_path, Inputs(contents={}, own_fmus=frozenset(), versions={})).run(TaskBatch.of(tasks(3)))
    assert asked == repeated
    assert found.numbers["steps"].tolist() == [0, 1, 2]


def test_a_run_that_ends_its_process_in_lanes_fails_and_is_not_run_by_another_engine(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Dying:
        def request(self, what: Any) -> Any:
            assert isinstance(what, TaskBatch)
            raise Died(Ending(code=-6))

    monkeypatch.setattr(Supervisor, "_ready_worker", lambda self: Dying())
    found = Supervisor(tmp_path, Inputs(contents={}, own_fmus=frozenset(), versions={})).run(TaskBatch.of(tasks(2)))
    assert (found.failed.tolist(), found.engines) == ([True, True], [None, None])
    assert str(found.messages[0]).startswith("its worker process ended by SIGABRT, 3 times")


def test_the_bits_of_a_run_in_lanes_do_not_depend_on_the_runs_beside_it(tmp_path: Path) -> None:
    chosen = dataclasses.replace(noisy(tmp_path), native=True)
    files = chosen.files()
    starts = files.start_values
    systems = [with_files(chosen.system(i, starts), files.fmus) for i in range(RUNS)]
    batches, order = Batches(), random.Random(1).sample(range(RUNS), RUNS)
    together = batches.run(systems)
    assert None not in together
    for size in (1, 3, 5):
        for group in (order[first : first + size] for first in range(0, RUNS, size)):
            assert batches.run([systems[i] for i in group]) == [together[i] for i in group]
