"""The timetable in C: the same windows as in Python, to the bit."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from orchestration.foundation.basics.times import Grid, exact_nanoseconds
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.systems.schedule import compiled_timetable
from orchestration.systems.schedule.common_timetable import CommonTimetable, Span
from orchestration.systems.schedule.compiled_timetable import FILES, CompiledTimetable, reason_unavailable, timetable
from orchestration.systems.schedule.instant_arrays import Schedule
from orchestration.systems.schedule.plan import FixedStep
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.computers import Computer, Task
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.quadrotor.scenarios.strategies import Case, cases
from tests.orchestration.simulation.engines.random_systems import systems

pytestmark = needs_compiler
TAIL = 2
"""A seed with a number that lies so far out"""
TOO_FINE = "its instants are no fractions of a nanosecond that fit into 62 bits"
TABLES = ("posted", "measured", "arrivals", "samples", "sampled", "exchanged")
SIZES = st.sampled_from((1, 7, 2**15))


def expect_same(one: Span, other: Span) -> None:
    assert one.end == other.end
    for name in TABLES:
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert np.array_equal(one.own.times, other.own.times)
    assert np.array_equal(one.own.stepped, other.own.stepped)


def same(what: System, size: int = 2**15) -> list[Span]:
    """The windows of about so many instants, the same in Python and in C."""
    common, streams = CommonTimetable(what, {}), Streams(what.seed, what.streams)
    if (reason_unavailable(common) or "").endswith(TOO_FINE):
        reject()
    in_python = Timetable(what, streams, common=common)
    in_c = timetable(what, streams, common=common)
    assert isinstance(in_c, CompiledTimetable)
    assert in_c.first_samples == in_python.first_samples
    ours, theirs = list(in_c.spans(size)), list(in_python.spans(size))
    assert len(ours) == len(theirs)
    for one, other in zip(ours, theirs):
        expect_same(one, other)
    return theirs


def same_schedules(what: System, size: int) -> None:
    """The schedules of windows of about so many instants are the same in Python and in C."""
    common, streams = CommonTimetable(what, {}), Streams(what.seed, what.streams)
    in_c, in_python = (kind(what, streams, common=common) for kind in (CompiledTimetable, Timetable))
    while (other := in_python.next_schedule(size)) is not None:
        one = in_c.next_schedule(size)
        assert one is not None
        for field in fields(Schedule):
            assert np.array_equal(getattr(one, field.name), getattr(other, field.name)), field.name
    assert in_c.next_schedule(size) is None


@given(systems(), st.integers(0, 2**40) | st.just(2**63 - 1), SIZES)
def test_windows_and_their_schedules_are_the_same_over_random_systems(what: System, seed: int, size: int) -> None:
    same(replace(what, seed=seed), size)
    same_schedules(replace(what, seed=seed), size)


@given(cases(), SIZES)
def test_windows_are_the_same_over_random_timings_of_the_quadrotor_whose_streams_have_numbers(
    case: Case, size: int
) -> None:
    what = Scenario(timing=case.timing, stop_time=case.stop_time, seed=case.seed).as_system()
    assert what.streams
    same(what, size)


def loop(**keys: object) -> System:
    """A task that is jittered, and all of whose messages are delayed and lost."""
    keys = {"delay": 0.004, "delay_jitter": 0.003, "loss": 0.3, **keys}
    links = [
        Connection(name=f"c{i}", start=(f"{start}.y",), end=(f"{end}.u",), **keys)  # type: ignore[arg-type]
        for i, (start, end) in enumerate((("plant", "task"), ("task", "plant")))
    ]
    parts = {
        "plant": Component(fmu="stub", step=0.0007),
        "task": Component(fmu="stub", sampling=Sampling(period=0.01, jitter=0.006)),
    }
    return System(stop_time=1.0, seed=2**40 + 5, components=parts, connections=tuple(links))


def test_the_farthest_tail_of_a_normal_distribution_is_the_same() -> None:
    what = loop(delay=Distribution(normal=(0.0, 1e-5), range=(4.75e-5, 1.0)), delay_jitter=0.0, loss=0.0)
    what = replace(what, connections=what.connections[1:])
    parts = {**what.components, "task": Component(fmu="stub", sampling=Sampling(period=5e-6))}
    (span, *_) = same(replace(what, components=parts, seed=TAIL), 2**19)
    late = span.exchanged[:, 3] - span.exchanged[:, 2]
    assert late.max() > 1e9 * 6.9e-5


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("0x4385df649fccf645u", "0x4385df649fccf647u"),
        ("if (arrival <= times[i]) continue;", "if (arrival < times[i]) continue;"),
        ("times[i] > last ? times", "times[i] < last ? times"),
    ],
)
def test_a_slip_in_the_text_of_c_is_seen(right: str, wrong: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sources = {path.name: path.read_bytes() for path in FILES}
    text = sources["timetable.h"].decode()
    assert text.count(right) >= 1
    sources["timetable.h"] = text.replace(right, wrong).encode()
    mutant = compiled_timetable.loaded(sources)
    both_loops_are_the_same()
    monkeypatch.setattr(compiled_timetable, "library", lambda: mutant)
    with pytest.raises(AssertionError):
        both_loops_are_the_same()


def both_loops_are_the_same() -> None:
    same(loop())
    same(loop(delay=0.0, delay_jitter=0.0))


def test_what_c_does_not_know_is_drawn_in_python() -> None:
    what = loop()
    grid = Grid(exact_nanoseconds(0.0), exact_nanoseconds(0.0007))
    fixed = CommonTimetable(replace(what, stop_time=0.7), {"plant": FixedStep(name="plant", grid=grid, moves=True)})
    assert reason_unavailable(fixed) == "components.plant takes steps of one length only"
    ratio = Sampling(period=0.01, offset=1e-40)
    fine = replace(what, components={**what.components, "task": Component(fmu="stub", sampling=ratio)})
    reason = reason_unavailable(CommonTimetable(fine, {}))
    assert reason == f"components.task: {TOO_FINE}"
    assert type(timetable(fine, Streams(0))) is Timetable
    placed = replace(
        what,
        components={**what.components, "task": Component(fmu="stub")},
        computers={"cpu": Computer(tasks={"task": Task(component="task", period=0.01, execution=0.001)})},
    )
    reason = reason_unavailable(CommonTimetable(placed, {}))
    assert reason == "the scheduler computes instants of computers and networks"
