"""The scheduler in C notes what the one in Python does, to the bit."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.basics.times import nanoseconds
from orchestration.systems.computers import compiled
from orchestration.systems.computers.compiled import CompiledScheduler, scheduler
from orchestration.systems.computers.parts import LATER
from orchestration.systems.computers.scheduler import Scheduler
from orchestration.systems.schedule.resources import Resources
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.model import System
from tests.extent import tries
from tests.orchestration.components.fmi.small import needs_compiler
from tests.orchestration.simulation.engines.systems_on_computers import systems_on_computers
from tests.orchestration.systems.computers.described import Described


def parts_of(system):
    return Resources(system, nanoseconds(system.stop_time)).of_run(Streams(system.seed))


@needs_compiler
@settings(max_examples=tries(120, sampled=12), derandomize=True, deadline=None)
@given(systems_on_computers(), st.lists(st.integers(0, 400_000_000), max_size=5).map(sorted))
def test_random_computers_and_networks_have_the_same_notes_in_python_and_in_c(what: System, until: list[int]) -> None:
    ours, theirs = Scheduler(parts_of(what)), CompiledScheduler(parts_of(what))
    for time in (*until, LATER):
        ours.run(time)
        theirs.run(time)
        assert ours.next_instant == theirs.next_instant
        assert ours.take_notes().tolist() == theirs.take_notes().tolist()


def overloaded():
    what = Described(stop=10_000_000)
    what.processor(switch=1)
    what.task(900, 1000)
    what.task(300, 1000, priority=2)
    return what.parts()


@needs_compiler
def test_many_jobs_that_wait_and_many_notes_are_the_same() -> None:
    ours, theirs = Scheduler(overloaded()), CompiledScheduler(overloaded())
    ours.run(LATER)
    theirs.run(LATER)
    assert ours.take_notes().tobytes() == theirs.take_notes().tobytes()


@needs_compiler
def test_an_error_while_numbers_are_drawn_is_raised() -> None:
    what = Described(stop=10_000)
    what.processor()

    def drawn(count):
        raise ZeroDivisionError

    what.task(drawn, 1000)
    with pytest.raises(ZeroDivisionError):
        CompiledScheduler(what.parts()).run(LATER)


def test_without_a_compiler_the_scheduler_in_python_is_used(monkeypatch) -> None:
    def missing():
        raise QuadcosimError("no C compiler")

    monkeypatch.setattr(compiled, "_library", missing)
    assert isinstance(scheduler(overloaded()), Scheduler)
