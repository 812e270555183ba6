"""The time used by a process: wall-clock time without waiting for a processor, and processor time."""

import itertools

import pytest

from orchestration.foundation.processes.family import Member
from orchestration.foundation.processes.limit_enforcement import UsedTime

PROCESSORS = 4
"""of the machine"""


@pytest.fixture
def used(monkeypatch: pytest.MonkeyPatch) -> UsedTime:
    monkeypatch.setattr("os.cpu_count", lambda: PROCESSORS)
    return UsedTime()


def member(processor: float, *waits: float, limited: bool = False) -> Member:
    return Member(limited=limited, processor=processor, waits=dict(enumerate(waits)), memory=0)


def test_the_end_of_a_thread_that_has_waited_does_not_reduce_the_time(used: UsedTime) -> None:
    used.count({1: member(0.0, 0.0, 0.0)}, {1: member(0.5, 0.0, 3.0)}, 4.0)
    used.count({1: member(0.5, 0.0, 3.0)}, {1: member(1.0, 0.25)}, 1.0)
    assert used.own == 1.0 + 0.75


def test_a_thread_that_waits_is_seen_beside_one_that_has_waited_for_longer(used: UsedTime) -> None:
    used.count({1: member(0.0, 9.0, 0.0)}, {1: member(0.25, 9.0, 0.75)}, 1.0)
    assert used.own == 0.25


def test_processes_that_wait_at_once_wait_for_no_longer_than_the_longest(used: UsedTime) -> None:
    before, now = member(0.0, 0.0), member(0.0, 0.75)
    used.count(dict.fromkeys((1, 2, 3), before), dict.fromkeys((1, 2, 3), now), 1.0)
    assert used.own == 0.25


def test_a_wait_that_is_reported_late_does_not_reduce_the_time(used: UsedTime) -> None:
    used.count({1: member(0.0, 0.0)}, {1: member(0.0, 0.0)}, 1.0)
    used.count({1: member(0.0, 0.0)}, {1: member(0.0, 1.5)}, 1.0)
    assert used.own == 1.0


def test_a_wait_that_is_reported_late_does_not_count_in_the_end(used: UsedTime) -> None:
    waits = [0.0, 0.0, 0.0, 2.5, 2.5]
    for before, now in itertools.pairwise(waits):
        used.count({1: member(0.0, before)}, {1: member(0.0, now)}, 1.0)
    assert used.own == 2.0, "expected two seconds while the wait was not reported"
    used.count({1: member(0.0, 2.5)}, {1: member(1.0, 2.5)}, 1.0)
    assert used.own == 5.0 - 2.5


def test_threads_that_compute_at_once_use_wall_clock_time_once_and_processor_time_each(used: UsedTime) -> None:
    used.count({1: member(0.0, 0.0)}, {1: member(4.0, 0.0)}, 1.0)
    assert (used.own, used.processor) == (1.0, 4.0)


def test_threads_that_wait_for_each_other_alone_use_their_time(used: UsedTime) -> None:
    used.count({1: member(0.0, *[0.0] * 8)}, {1: member(4.0, *[0.5] * 8)}, 1.0)
    assert used.own == 1.0


def test_no_time_counts_while_a_process_with_its_own_limit_lives(used: UsedTime) -> None:
    used.count({}, {1: member(4.0), 2: member(1.0, limited=True)}, 1.0)
    assert (used.own, used.processor) == (0.0, 0.0)
