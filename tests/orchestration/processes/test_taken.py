"""The time of a process is what the wall's clock says, less what it had to wait; that of a processor is all it had."""

import itertools

import pytest

from orchestration.processes.family import Member
from orchestration.processes.taken import Taken

MACHINE = 4
"""Its processors"""


@pytest.fixture
def taken(monkeypatch: pytest.MonkeyPatch) -> Taken:
    monkeypatch.setattr("os.cpu_count", lambda: MACHINE)
    return Taken()


def member(processor: float, *waits: float, limited: bool = False) -> Member:
    return Member(limited=limited, processor=processor, waits=dict(enumerate(waits)), memory=0)


def test_a_thread_that_has_waited_and_ends_takes_nothing_back(taken: Taken) -> None:
    taken.count({1: member(0.0, 0.0, 0.0)}, {1: member(0.5, 0.0, 3.0)}, 4.0)
    taken.count({1: member(0.5, 0.0, 3.0)}, {1: member(1.0, 0.25)}, 1.0)
    assert taken.own == 1.0 + 0.75


def test_a_thread_that_waits_is_seen_beside_one_that_has_waited_for_longer(taken: Taken) -> None:
    taken.count({1: member(0.0, 9.0, 0.0)}, {1: member(0.25, 9.0, 0.75)}, 1.0)
    assert taken.own == 0.25


def test_processes_that_wait_at_once_wait_for_no_longer_than_the_longest(taken: Taken) -> None:
    before, now = member(0.0, 0.0), member(0.0, 0.75)
    taken.count(dict.fromkeys((1, 2, 3), before), dict.fromkeys((1, 2, 3), now), 1.0)
    assert taken.own == 0.25


def test_what_was_spent_is_not_taken_back_by_a_wait_that_is_told_late(taken: Taken) -> None:
    taken.count({1: member(0.0, 0.0)}, {1: member(0.0, 0.0)}, 1.0)
    taken.count({1: member(0.0, 0.0)}, {1: member(0.0, 1.5)}, 1.0)
    assert taken.own == 1.0


def test_a_wait_that_is_told_late_is_no_time_of_its_own_in_the_end(taken: Taken) -> None:
    waits = [0.0, 0.0, 0.0, 2.5, 2.5]
    for before, now in itertools.pairwise(waits):
        taken.count({1: member(0.0, before)}, {1: member(0.0, now)}, 1.0)
    assert taken.own == 2.0, "expected two seconds while nothing was told of the wait"
    taken.count({1: member(0.0, 2.5)}, {1: member(1.0, 2.5)}, 1.0)
    assert taken.own == 5.0 - 2.5


def test_threads_that_compute_at_once_take_the_time_of_the_wall_and_more_of_the_processors(taken: Taken) -> None:
    taken.count({1: member(0.0, 0.0)}, {1: member(4.0, 0.0)}, 1.0)
    assert (taken.own, taken.processor) == (1.0, 4.0)


def test_threads_that_wait_for_each_other_alone_take_their_time(taken: Taken) -> None:
    taken.count({1: member(0.0, *[0.0] * 8)}, {1: member(4.0, *[0.5] * 8)}, 1.0)
    assert taken.own == 1.0


def test_nothing_is_taken_while_a_process_with_a_limit_of_its_own_lives(taken: Taken) -> None:
    taken.count({}, {1: member(4.0), 2: member(1.0, limited=True)}, 1.0)
    assert (taken.own, taken.processor) == (0.0, 0.0)
