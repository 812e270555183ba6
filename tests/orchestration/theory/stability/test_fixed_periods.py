"""Loops whose controller is a task: as matrices they are those of its phase and latency, or of its schedule."""

import math
from dataclasses import replace
from typing import Any

import pytest

from orchestration.systems.system.computers import Arrivals, Computer, Message, Network, Task
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.paths import changed
from orchestration.theory.stability.fixed_periods import in_repeated_periods
from quadcosim import UsageError, bode, expect, linearise, locus
from tests.examples.common import native_example as example
from tests.orchestration.theory.exact.test_periodic_schedule import DELAY, on_a_computer

FILTER = Task(period=0.003, execution=0.0004, offset=0.0001, priority=0)
CAN = Network(kind="can", bit_rate=500e3, messages={"command": Message(connection="command", bytes=8, identifier=2)})
BESIDE = Computer(switch=20e-6, tasks={"filter": FILTER})
JOB: dict[str, Any] = {"period": 0.006, "offset": 0.0002, "execution": 0.003}


def test_the_loop_of_a_task_that_is_always_as_late_is_that_behind_the_delay_that_it_makes() -> None:
    """Between its start, 0.34 ms after its release, and its end it is interrupted for 0.42 ms, and resumes in 20 µs."""
    by_delay, by_task = example("dc_servo", {DELAY: 0.00344}), on_a_computer("dc_servo", BESIDE, **JOB)
    (found,), (known,) = bode(by_task).loops, bode(by_delay).loops
    assert found == known
    assert locus(by_task, DELAY, first=0.0, last=0.02, count=5).crossings[0].value == pytest.approx(
        locus(by_delay, DELAY, first=0.0, last=0.025, count=5).crossings[0].value - 0.00344, abs=1e-8
    )


def test_over_a_network_it_grows_as_the_exact_expectation_by_the_timetable_says() -> None:
    by_frame = on_a_computer("distributed_servo", BESIDE, CAN, **JOB)
    assert linearise(by_frame).radius == pytest.approx(math.sqrt(expect(by_frame).mean_square_radius), rel=1e-9)
    (command,) = (x for x in in_repeated_periods(by_frame).connections if x.name == "command")
    assert command.delay == pytest.approx(0.00344 + 135 / 500e3, abs=1e-12)


@pytest.mark.parametrize(
    ("load", "job"),
    [({"period": 0.004}, {}), ({"period": 0.012, "offset": 0.001}, {"offset": 0.0})],
    ids=["phase", "latency"],
)
def test_a_phase_or_a_latency_that_varies_is_in_the_loop_as_it_repeats(
    load: dict[str, Any], job: dict[str, Any]
) -> None:
    """The exact expectation is at the end of stability with the delay, and with the factors, of the margins."""
    beside = replace(BESIDE, tasks={"filter": replace(FILTER, **load)})
    whole = on_a_computer("distributed_servo", beside, CAN, **{**JOB, **job})
    assert in_repeated_periods(whole).uses_scheduler
    assert linearise(whole).radius == pytest.approx(math.sqrt(expect(whole).mean_square_radius), rel=1e-9)
    (loop,) = bode(whole).loops
    assert loop.delay_margin is not None
    wanted: list[dict[str, Any]] = [{DELAY: loop.delay_margin}]
    wanted += [{"connections.command.scale": one.factor} for one in loop.gain_margins]
    assert len(wanted) == 2
    for one in wanted:
        assert expect(changed(whole, one)).mean_square_radius == pytest.approx(1.0, abs=1e-5)


def test_what_a_network_samples_in_continuous_time_is_in_the_loop_as_what_a_component_samples_and_sends() -> None:
    """The measurement of the servo, sent every 6 ms."""
    whole = on_a_computer("distributed_servo", BESIDE, **JOB)
    (measured,) = (x.name for x in whole.connections if x.receiver == "controller")
    message = Message(connection=measured, bytes=8, identifier=2, period=0.003)
    by_bus = replace(whole, networks={"bus": replace(CAN, messages={"measured": message})})
    assert linearise(by_bus).radius == pytest.approx(math.sqrt(expect(by_bus).mean_square_radius), rel=1e-9)


def test_a_schedule_that_repeats_late_is_refused_with_a_period_by_which_it_repeats_soon() -> None:
    beside = replace(BESIDE, tasks={"filter": replace(FILTER, period=0.0037)})
    whole = on_a_computer("distributed_servo", beside, CAN, **JOB)
    with pytest.raises(UsageError, match=r"after 222 ms, .* as computers\.node\.tasks\.filter\.period = 0\.00375$"):
        linearise(whole)
    assert linearise(changed(whole, {"computers.node.tasks.filter.period": 0.00375})).samples == 5


@pytest.mark.parametrize(
    ("load", "job", "named"),
    [
        ({}, {"execution": Distribution(uniform=(0.001, 0.002))}, r"control\.execution: random from job to job"),
        ({"period": None, "arrivals": Arrivals(poisson=20.0)}, {}, r"filter\.arrivals: random"),
        ({"execution": 0.0018}, {}, r"^computers\.node: overloaded, .* of control wait, .* of \d+ jobs in .* start"),
    ],
    ids=["execution", "arrivals", "overload"],
)  # fmt: skip
def test_chance_and_jobs_that_do_not_start_are_refused_by_name(
    load: dict[str, Any], job: dict[str, Any], named: str
) -> None:
    beside = replace(BESIDE, tasks={"filter": replace(FILTER, **load)})
    with pytest.raises(UsageError, match=named):
        in_repeated_periods(on_a_computer("dc_servo", beside, **{**JOB, **job}))


def test_without_execution_time_a_task_alone_is_a_sampled_component() -> None:
    by_task = in_repeated_periods(on_a_computer("dc_servo", period=0.006))
    by_itself = in_repeated_periods(changed(example("dc_servo"), {DELAY: 0.0}))
    assert (by_task.components, by_task.connections) == (by_itself.components, by_itself.connections)
