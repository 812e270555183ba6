"""Partitions of an FMU of FMI 3.0 for scheduled execution: components that share an instance, each step a job."""

from pathlib import Path
from typing import Any

import pytest

import quadcosim
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.requests.request import request_of
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.systems.system.proposal import propose
from orchestration.systems.system.request import system_of
from orchestration.theory.stability.loop_at_rest import expect_whole_instances
from tests.orchestration.components.fmi.exchange import clock, exchange, partitions
from tests.orchestration.components.fmi.small import needs_compiler

pytestmark = needs_compiler


def ecu(folder: Path, **keys: Any) -> dict[str, Any]:
    """Three partitions as tasks: the second released by what is not lost, at 0, 1, 8 and 9, the third at 4."""
    (folder / "lost.csv").write_text("lost\n" + "\n".join("0011111100"))
    fmu = str(partitions(folder))
    tasks = {
        "first": {"component": "first", "period": 1.0, "priority": 1, "execution": 0.2},
        "second": {"component": "second", "on": "trigger", "deadline": 1.0, "priority": 2, "execution": 0.2},
        "third": {"component": "third", "period": 9.0, "offset": 4.0, "priority": 3, "execution": 0.5},
    }
    return {
        "stop_time": 10.0,
        "components": {
            "source": {"fmu": str(exchange(folder, "gain")), "sampling": {"period": 1.0}},
            **{name: {"fmu": fmu, "partition": f"inClock{i}"} for i, name in enumerate(tasks, 1)},
        },
        "connections": [
            {"name": "trigger", "from": ["source.y"], "to": ["second.u"],
             "loss": {"file": str(folder / "lost.csv"), "column": "lost", "order": "as recorded"}},
            {"name": "own", "from": ["third.y"], "to": ["first.u"]},
        ],
        "computers": {"cpu": {"tasks": tasks}},
        **keys,
    }  # fmt: skip


def test_jobs_of_partitions_are_those_of_the_standards_example(tmp_path: Path) -> None:
    system = ecu(tmp_path)
    one, other = (quadcosim.run(system, engine=engine, in_process=True) for engine in ("python", "compiled"))
    assert one.rows.tobytes() == other.rows.tobytes()
    for i, (name, count) in enumerate({"first": 10, "second": 4, "third": 1}.items(), 1):
        assert one.signals[f"{name}.jobs{i}"][-1] == count
    assert max(one.signals[f"{name}.total"][-1] for name in ("first", "second", "third")) == 15
    jobs = [event.time / 1e9 for event in one.events if (event.kind, event.what) == ("started", "cpu.second")]
    assert jobs == [0.2, 1.2, 8.2, 9.2]  # after the first, which is more urgent, and once for each
    assert one.signals["first.y"][-1] == 9.0 + 1000.0 * 14 + one.signals["third.y"][-1]


def test_a_paused_run_of_partitions_goes_on_with_the_same_bits(tmp_path: Path) -> None:
    system = ecu(tmp_path)
    whole = quadcosim.run(system, in_process=True)
    assert fly_until(system, 4.3, tmp_path / "paused", in_process=True) is None
    assert resume(tmp_path / "paused", in_process=True).rows.tobytes() == whole.rows.tobytes()


def sampled(folder: Path, **of: dict[str, Any]) -> dict[str, Any]:
    """Partitions without a computer, with other keys, by component."""
    fmu = str(partitions(folder))
    named = {name: {"fmu": fmu, "partition": f"inClock{i}"} for i, name in enumerate(("a", "b", "c")[: len(of)], 1)}
    return {"stop_time": 10.0, "components": {name: keys | of[name] for name, keys in named.items()}}


def test_partitions_without_a_computer_run_by_their_clocks(tmp_path: Path) -> None:
    result = quadcosim.run(sampled(tmp_path, a={}, b={}, c={"sampling": {"period": 4.0, "offset": 1.0, "jitter": 0.5}}))
    assert [result.signals[name][-1] for name in ("a.jobs1", "b.jobs2", "c.jobs3")] == [10, 4, 3]
    assert max(result.signals[f"{name}.total"][-1] for name in "abc") == 17
    assert result.warnings == ()


def test_other_instances_have_jobs_of_their_own(tmp_path: Path) -> None:
    system = sampled(tmp_path, a={}, b={"instance": "other", "partition": "inClock1"})
    result = quadcosim.run(system, in_process=True)
    assert [result.signals[f"{name}.total"][-1] for name in "ab"] == [10, 10]
    assert [warning.partition(": ")[2] for warning in result.warnings] == [
        "no component is its partition inClock2, inClock3"
    ] * 2


def test_a_sweep_goes_over_the_periods_of_partitions(tmp_path: Path) -> None:
    system = sampled(tmp_path, a={}, b={}) | {"objectives": {"jobs": "max(a.total)"}}
    runs = quadcosim.fly(system, {"components.b.sampling.period": [1.9, 4.9]})
    assert runs["jobs"].tolist() == [15, 12]


REFUSED = [
    ({"a": {"partition": "inClock4"}}, "partition = inClock4: .*expected one of inClock1, inClock2, inClock3"),
    ({"a": {"sampling": {"period": 2.0}}}, "sampling.period = 2: expected 1, that of the constant inClock1"),
    ({"a": {}, "b": {"partition": "inClock1"}}, "partition = inClock1: expected another one than a has"),
    ({"a": {}, "b": {"sampling": {"clock_ratio": 1.1}}}, "clock_ratio = 1.1: expected 1.0, that of a"),
    ({"a": {"parameters": {"p": 1.0}}, "b": {"parameters": {"p": 2.0}}}, "parameters.p = 2.0: expected 1.0, as of a"),
    ({"a": {}, "b": {}, "c": {}}, "components.c.step = none: expected step"),
    ({"a": {"step": 1.0}}, "step = 1.0: expected none beside partition"),
    ({"a": {"interface": "event-mode"}}, "interface = event-mode: expected scheduled-execution beside partition"),
    ({"a": {"record": ["jobs2"]}}, "jobs2"),
]


@pytest.mark.parametrize(("of", "expected"), REFUSED, ids=range(len(REFUSED)))
def test_what_is_no_partition_is_refused(of: dict[str, Any], expected: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=expected):
        quadcosim.run(sampled(tmp_path, **of), in_process=True)


def test_a_task_that_is_no_partition_is_refused_by_the_key_that_names_it(tmp_path: Path) -> None:
    system = ecu(tmp_path)
    system["components"]["first"]["partition"] = "inClock4"
    with pytest.raises(UsageError, match=r"components.first.partition = inClock4: .*expected one of its clocks$"):
        quadcosim.run(system, in_process=True)


@pytest.mark.parametrize("kind", ["triggered", "countdown", "changing"])
def test_clocks_with_instants_of_their_own_are_refused_by_name(kind: str, tmp_path: Path) -> None:
    fmu = partitions(tmp_path, clock("other", kind, "", 33))
    with pytest.raises(UsageError, match=f"other is a clock of causality input and interval {kind}, whose ticks would"):
        quadcosim.run({"stop_time": 1.0, "components": {"a": {"fmu": str(fmu), "partition": "inClock1"}}})


def test_an_fmu_for_scheduled_execution_alone_says_what_it_needs(tmp_path: Path) -> None:
    fmu = partitions(tmp_path)
    with pytest.raises(
        UsageError, match="partition: expected one of inClock1, inClock2, inClock3: Clocks is for sched"
    ):
        quadcosim.run({"stop_time": 1.0, "components": {"a": {"fmu": str(fmu), "step": 0.1}}})
    proposed = propose([(str(fmu), read_model(fmu))], tmp_path).text
    assert proposed.count('partition = "inClock') == 3
    (tmp_path / "system.toml").write_text(proposed)
    assert quadcosim.run(tmp_path / "system.toml", in_process=True).warnings == ()


def test_linear_theory_says_what_takes_partitions_instead(tmp_path: Path) -> None:
    instead = r"one component without partition, whose tasks run when they are due; limit takes partitions, by runs$"
    with pytest.raises(UsageError, match=rf"^a is a partition, .*: expected the code as {instead}"):
        expect_whole_instances(system_of(request_of(sampled(tmp_path, a={}))))
