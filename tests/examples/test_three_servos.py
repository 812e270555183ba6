"""Three servos on one processor, which comes with TrueTime: what is done, and who is lost."""

import pytest

from orchestration.simulation.runs.simulation import run
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.system.file import load_system
from orchestration.systems.system.paths import changed
from tests.places import EXAMPLES

SYSTEM = load_system(EXAMPLES / "three_servos" / "system.toml")
DONE = {"fixed-priority": [50, 200, 250], "earliest-deadline-first": [135, 162, 203]}


@pytest.mark.parametrize("scheduling", DONE)
def test_by_rates_the_slowest_servo_is_lost_and_by_deadlines_all_come_to_rest(scheduling: str) -> None:
    system = changed(SYSTEM, {"computers.node.scheduling": scheduling})
    jobs = timeline_of(system).jobs.values()
    assert [len(each) for each in jobs] == [167, 200, 250]
    assert [int(each.done.sum()) for each in jobs] == DONE[scheduling]
    metrics = run(system).metrics
    assert metrics["good"] == (scheduling != "fixed-priority")
    assert (metrics["late_slow"] > 1e6) == (scheduling == "fixed-priority")
    assert metrics["late_middle"] < 1e-6
    assert metrics["late_fast"] < 1e-6


def test_what_objectives_say_of_jobs_is_what_became_of_them() -> None:
    (slow, _, fast) = timeline_of(SYSTEM).jobs.values()
    metrics = run(SYSTEM).metrics
    assert metrics["worst_response"] == slow.responses.max() / 1e9
    assert metrics["missed"] == slow.missed.sum() / slow.due.sum() == 1.0
    assert fast.responses.max() == 2_000_000
