"""Systems on computers and networks have the same bits with all engines, in windows, and beyond a pause."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import nanoseconds
from orchestration.foundation.recording.recording import KINDS
from orchestration.simulation.engines.batch.batches import Batches
from orchestration.simulation.engines.job_numbers import job_numbers
from orchestration.simulation.runs.pause import fly_until, resume
from orchestration.simulation.runs.run_directory import load_run
from orchestration.systems.schedule import instant_arrays
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.computers import Computer, Message, Network, Task
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import Criterion, System
from orchestration.systems.system.paths import changed
from tests.extent import tries
from tests.native import assert_the_same
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.engines.batch.lanes import assert_the_same_signals, in_lanes, shape_of
from tests.orchestration.simulation.engines.moving import moving
from tests.orchestration.simulation.engines.random_systems import TRACE
from tests.orchestration.simulation.engines.systems_on_computers import systems_on_computers
from tests.orchestration.simulation.engines.test_compiled import (
    ENGINES,
    Kept,
    both,
    expect_that_a_pause_changes_nothing,
    of,
    ran,
)

pytestmark = needs_compiler


@given(systems_on_computers(), st.sampled_from((1, 7, 2**13)))
def test_random_systems_on_computers_run_the_same_in_schedules_of_any_length(
    fmu: Path, kept: Kept, what: System, instants: int
) -> None:
    whole = ran(of(what, fmu), "python", load=kept.load)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(instant_arrays, "INSTANTS", instants)
        assert_the_same(both(of(what, fmu), load=kept.load), whole)


@settings(max_examples=tries(30, sampled=5), derandomize=True, deadline=None)
@given(
    systems_on_computers(),
    st.floats(0.0, 1.0),
    st.tuples(ENGINES, ENGINES),
    st.sampled_from((5, instant_arrays.INSTANTS)),
)
def test_systems_on_computers_go_on_from_a_pause_as_if_there_was_none(
    fmu: Path, kept: Kept, what: System, share: float, engines: tuple[Any, Any], size: int
) -> None:
    expect_that_a_pause_changes_nothing(of(what, fmu), share, engines, size, kept.load)


def loop(fmu: Path, controller: Component, **keys: Any) -> System:
    parts = {"plant": Component(fmu="stub", step=0.01), "controller": controller}
    wires = (
        Connection(name="measured", start=("plant.y",), end=("controller.u0y",), loss=0.1),
        Connection(name="commanded", start=("controller.y",), end=("plant.u1y",), **keys.pop("command", {})),
    )
    return of(System(stop_time=1.0, components=parts, connections=wires, **keys), fmu)


def on_a_computer(**keys: Any) -> dict[str, Computer]:
    return {"one": Computer(tasks={"control": Task(component="controller", **keys)}, clock_ratio=1.01)}


@pytest.mark.parametrize("command", [{}, {"delay": 0.03, "delay_jitter": 0.02, "loss": 0.2}])
def test_one_task_alone_that_takes_no_time_flies_the_bits_of_sampling(
    fmu: Path, kept: Kept, command: dict[str, Any]
) -> None:
    sampling = Sampling(period=0.02, offset=0.003, jitter=0.01, clock_ratio=1.01)
    by_sampling = loop(
        fmu, Component(fmu="stub", sampling=sampling), command=command, streams={"components.controller.jitter": 3}
    )
    by_task = loop(
        fmu, Component(fmu="stub"), command=command, streams={"computers.one.tasks.control.jitter": 3},
        computers=on_a_computer(period=0.02, offset=0.003, jitter=0.01),
    )  # fmt: skip
    found, expected = both(by_task, load=kept.load), both(by_sampling, load=kept.load)
    assert found.rows.tobytes() == expected.rows.tobytes()
    assert [event for event in found.events if event.what != "one.control"] == list(expected.events)


def test_a_constant_time_of_execution_flies_the_bits_of_a_delay(fmu: Path, kept: Kept) -> None:
    by_delay = loop(
        fmu, Component(fmu="stub", sampling=Sampling(period=0.02, clock_ratio=1.01)), command={"delay": 0.003}
    )
    by_task = loop(fmu, Component(fmu="stub"), computers=on_a_computer(period=0.02, execution=0.003))
    found, expected = both(by_task, load=kept.load), both(by_delay, load=kept.load)
    assert found.rows.tobytes() == expected.rows.tobytes()


def test_a_trace_of_execution_is_taken_row_by_row_and_anew_by_all_engines_and_beyond_a_pause(
    fmu: Path, kept: Kept
) -> None:
    """Row k is of release k, also where that makes no job."""
    taken = Distribution(file=TRACE, column="delay", order="as recorded")
    control = Task(component="controller", period=0.02, execution=taken, overrun="skip")
    what = loop(fmu, Component(fmu="stub"), computers={"one": Computer(tasks={"control": control})})
    rows, ends = [nanoseconds(each) for each in taken.table().tolist()], [0]
    for k in range(50):
        if (release := 20_000_000 * k) >= ends[-1]:
            ends.append(release + rows[k % len(rows)])
    assert 2 * len(rows) < len(ends) - 1 < 50
    assert [event.time for event in both(what, load=kept.load).events if event.kind == "arrived"] == [
        time for time in ends[1:] if time < 1_000_000_000
    ]
    alone, shape = ran(what, "compiled", load=kept.load), shape_of(what)
    assert_the_same_signals(shape, in_lanes(shape, [what]), 0, alone)
    expect_that_a_pause_changes_nothing(what, 0.43, ("python", "compiled"), 5, kept.load)


def test_what_objectives_say_of_jobs_is_the_same_in_lanes_and_of_each_run_its_own(fmu: Path, kept: Kept) -> None:
    what = loop(
        fmu, Component(fmu="stub"),
        computers=on_a_computer(period=0.02, deadline=0.01, execution=Distribution(uniform=(0.0, 0.02))),
        objectives={
            "worst": "max(response(one.control))", "late": "mean(missed(control)) + 0 * last(plant.y)",
            "share": "share(response(control) > 0.005) ** 2", "never": "max(missed(control)) - 1",
        },
        criterion=Criterion(good="worst < 1 and late < 2"),
    )  # fmt: skip
    crowd = [replace(what, seed=seed) for seed in range(3)]
    alone = [ran(each, "compiled", load=kept.load).metrics for each in crowd]
    assert len({each["worst"] for each in alone}) == 3
    for each, found in zip(alone, Batches().run(crowd)):
        assert found is not None
        assert found.metrics == each
    jobs = timeline_of(crowd[0]).jobs["one.control"]
    assert alone[0]["late"] == pytest.approx(jobs.missed.sum() / jobs.due.sum())


@pytest.mark.parametrize(
    ("objective", "complaint"),
    [
        ("response(control)", "response(control): has a value for each job; expected it inside max, mean, share or"),
        ("max(response(pilot))", "response(pilot): expected one of one.control"),
        ("max(response(control) * missed(control))", "expected jobs of one task in one way, not response(control) and"),
    ],
)
def test_what_cannot_be_said_of_jobs_is_refused(fmu: Path, objective: str, complaint: str) -> None:
    with pytest.raises(UsageError, match=re.escape(complaint)):
        ran(
            loop(fmu, Component(fmu="stub"), computers=on_a_computer(period=0.02), objectives={"x": objective}),
            "python",
        )


def test_a_name_of_two_tasks_is_refused_with_the_names_that_tell_them_apart(fmu: Path) -> None:
    computers = {**on_a_computer(period=0.02), "two": Computer(tasks={"control": Task(period=0.1)})}
    what = loop(fmu, Component(fmu="stub"), computers=computers, objectives={"x": "max(missed(control))"})
    with pytest.raises(
        UsageError,
        match=r"^objectives\.x: missed\(control\): task one\.control and task two\.control have that name; "
        r"expected missed\(one\.control\) or missed\(two\.control\)$",
    ):
        job_numbers(what)


def test_a_component_of_fixed_steps_beside_a_task_needs_to_move(tmp_path: Path, fmu: Path) -> None:
    fixed = moving(tmp_path, fixed_step=True)
    what = loop(fmu, Component(fmu="stub"), computers=on_a_computer(period=0.03, execution=0.004))
    for align in ("exact", "next"):
        plant = replace(what.components["plant"], fmu=str(fixed), align=align)
        with_it = replace(what, components={**what.components, "plant": plant})
        if align == "next":
            arrived = [each.time for each in both(with_it).events if each.kind == "arrived"]
            assert all(time % 10_000_000 == 0 for time in arrived)
        else:
            with pytest.raises(
                UsageError, match=r"^computers\.one\.tasks\.control: components\.plant takes steps of 0\.01"
            ):
                ran(with_it, "python")


CROWDED = {
    "one": Computer(tasks={
        "control": Task(component="controller", period=0.02, priority=2, execution=Distribution(uniform=(0.0, 0.02))),
        "load": Task(period=0.05, execution=0.01),
    }),
}  # fmt: skip
BUS = {
    "bus": Network(kind="can", bit_rate=1e4, error=0.2, messages={
        "command": Message(connection="commanded", bytes=2, identifier=1),
        "load": Message(period=0.1, bytes=1, identifier=0),
    }),
}  # fmt: skip


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_run_tells_what_becomes_of_tasks_and_frames_beside_messages_and_so_do_its_files_after_a_pause(
    fmu: Path, engine: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("orchestration.simulation.engines.backlog.ROWS", 30)  # before the pause chunks are handed over
    what = loop(fmu, Component(fmu="stub"), computers=CROWDED, networks=BUS)
    messages = [x.name for x in what.connections]
    assert fly_until(what, 0.6, tmp_path / "half", engine=engine, in_process=True) is None
    resume(tmp_path / "half", tmp_path / "whole", engine=engine, in_process=True)
    events = load_run(tmp_path / "whole").events
    assert events == ran(what, engine).events
    assert [event for event in events if event.what not in messages] == [*timeline_of(what).happenings()]
    assert {event.kind for event in events} == set(KINDS) - {"skipped", "aborted", "event"}
    assert [event.time for event in events] == sorted(event.time for event in events)
    at_once = [(event.kind, event.what) for event in events if event.time == 10_000_000]
    assert at_once == [("finished", "one.load"), ("started", "one.control"), ("sampled", "measured")]


def test_a_system_without_components_is_not_run() -> None:
    alone = System(stop_time=1.0, computers={"one": Computer(tasks={"load": Task(period=0.1)})})
    with pytest.raises(UsageError, match=r"^components = none: expected at least one to run"):
        ran(alone, "python")


@st.composite
def crowds(draw: st.DrawFn) -> list[System]:
    """Systems of one structure whose tasks take other times, with other seeds and priorities."""
    first = draw(systems_on_computers())
    crowd = [first]
    for place in range(draw(st.integers(1, 5))):
        paths: dict[str, Any] = {"seed": first.seed + draw(st.integers(0, 1)) * (place + 1)}
        for name, computer in first.computers.items():
            for task in computer.tasks:
                path = f"computers.{name}.tasks.{task}"
                paths |= {f"{path}.execution": draw(st.sampled_from((0.0, 0.002, 0.01)))}
                paths |= {f"{path}.priority": draw(st.integers(0, 3))}
        crowd.append(changed(first, paths))
    return crowd


@settings(max_examples=tries(30, sampled=5), derandomize=True, deadline=None)
@given(crowds())
def test_systems_on_computers_have_the_same_bits_in_lanes_beside_others(
    fmu: Path, kept: Kept, crowd: list[System]
) -> None:
    simulated = [of(what, fmu) for what in crowd]
    shape = shape_of(simulated[0])
    found = in_lanes(shape, simulated)
    for lane, what in enumerate(simulated):
        assert_the_same_signals(shape, found, lane, ran(what, "compiled", load=kept.load))
