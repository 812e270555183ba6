"""The scheduler against known answers, and against another one."""

import itertools

import numpy as np
import pytest

from orchestration.systems.computers.parts import (
    ABORT,
    EARLIEST_DEADLINE,
    FIRST_COME,
    FIXED_PRIORITY,
    LATER,
    NONE,
    SKIP,
)
from orchestration.systems.computers.timeline import ABORTED, DONE, SKIPPED, SWITCH, UNFINISHED
from tests.orchestration.systems.computers.described import MS, Described


def responses(what):
    return {name: jobs.responses.tolist() for name, jobs in what.timeline().jobs.items()}


def test_three_tasks_released_together_have_the_responses_of_the_textbook():
    what = Described(stop=156 * MS)
    what.processor()
    for priority, (execution, period) in enumerate([(1, 4), (2, 6), (3, 13)], 1):
        what.task(execution * MS, period * MS, priority=priority)
    assert [max(found) for found in responses(what).values()] == [1 * MS, 3 * MS, 10 * MS]


def test_three_frames_on_can_reach_the_bounds_of_the_revised_analysis():
    what = Described(stop=200 * MS)
    what.link()
    for rank, period in enumerate([2_500_000, 3_500_000, 3_500_000]):
        what.message(MS, period, rank=rank)
    most = [int(frames.responses.max()) for frames in what.timeline().frames.values()]
    assert most[2] == 3_500_000  # of the second one in the busy period, as the first takes 3 ms
    assert most[0] <= 2 * MS
    assert most[1] <= 3 * MS


def test_a_job_that_ends_at_its_deadline_is_done_and_one_that_does_not_is_aborted():
    what = Described(stop=20 * MS)
    what.processor()
    what.task(5 * MS, 10 * MS, deadline=5 * MS, overrun=ABORT)
    what.task(6 * MS, 10 * MS, deadline=9 * MS, overrun=ABORT, priority=2)
    first, second = what.timeline().jobs.values()
    assert first.outcome.tolist() == [DONE, DONE]
    assert second.outcome.tolist() == [ABORTED, ABORTED]
    assert second.missed.tolist() == [True, True]
    assert not first.missed.any()


def test_a_release_while_a_job_is_not_done_makes_none_where_overruns_are_skipped():
    what = Described(stop=40 * MS)
    what.processor()
    times = itertools.cycle([15, 1, 1])
    what.task(lambda count: np.array([next(times) * MS for _ in range(count)]), 10 * MS, overrun=SKIP)
    (jobs,) = what.timeline().jobs.values()
    assert jobs.outcome.tolist() == [DONE, SKIPPED, DONE, UNFINISHED]
    assert (jobs.ended - jobs.started)[[0, 2]].tolist() == [15 * MS, 1 * MS]  # what it draws is used up
    assert jobs.missed.tolist() == [True, True, False, True]


def test_every_start_and_every_resume_costs_a_switch_and_an_interrupted_one_is_repeated():
    what = Described(stop=100)
    what.processor(switch=10)
    what.task(5, 1000, offset=15)
    what.task(20, 1000, offset=1, priority=2)
    what.task(5, 1000, offset=33, priority=1)
    timeline = what.timeline()
    pieces = timeline.processors["0"]
    table = np.column_stack([pieces.owner, pieces.kind == SWITCH, pieces.begin, pieces.end]).tolist()
    assert table == [
        [1, 1, 1, 11], [1, 0, 11, 15],  # 4 of its 20
        [0, 1, 15, 25], [0, 0, 25, 30],
        [1, 1, 30, 33],  # interrupted
        [2, 1, 33, 43], [2, 0, 43, 48],
        [1, 1, 48, 58], [1, 0, 58, 74],
    ]  # fmt: skip
    assert timeline.jobs["1"].started.tolist() == [11]
    assert timeline.jobs["1"].preemptions.tolist() == [1]
    events = [(each.time, each.kind) for each in timeline.happenings() if each.what == "1"]
    assert events == [(1, "released"), (11, "started"), (15, "preempted"), (58, "resumed"), (74, "finished")]


def test_jobs_of_one_task_start_a_nanosecond_apart():
    what = Described(stop=100)
    what.processor()
    what.task(10, 1000)
    what.task(0, 2, offset=1, priority=2)
    started = what.timeline().jobs["1"].started
    assert started[:7].tolist() == [10, 11, 12, 13, 14, 15, 16]


@pytest.mark.parametrize("preemptive", [True, False])
def test_a_processor_chooses_after_all_releases_of_an_instant(preemptive):
    what = Described(stop=100)
    what.processor(preemptive=preemptive)
    what.task(7, 10, priority=2)
    what.task(2, 10, priority=1, offset=0)
    assert what.timeline().jobs["0"].started.tolist()[:2] == [2, 12]


def test_first_come_runs_to_its_end_and_earlier_deadlines_precede_later_ones():
    for policy, ends in ((FIRST_COME, [10, 13]), (EARLIEST_DEADLINE, [13, 4]), (FIXED_PRIORITY, [10, 13])):
        what = Described(stop=50)
        what.processor(policy)
        what.task(10, 1000, deadline=30)
        what.task(3, 1000, deadline=20, offset=1, priority=2)
        assert [jobs.ended[0] for jobs in what.timeline().jobs.values()] == ends


def test_what_is_under_way_at_the_end_is_unfinished_and_nothing_is_released_there():
    what = Described(stop=20)
    what.processor()
    what.task(4, 10, offset=0)
    what.task(7, 10, priority=2)
    jobs = what.timeline().jobs
    assert jobs["0"].outcome.tolist() == [DONE, DONE]
    assert jobs["1"].outcome.tolist() == [DONE, UNFINISHED]
    assert len(jobs["0"]) == 2


def test_a_corrupted_frame_takes_its_time_and_more_and_is_queued_again():
    what = Described(stop=100)
    what.link()
    attempts = iter([1, 0, 0])
    what.message(10, 1000, rank=1, corrupted=lambda count: np.array([next(attempts, 0) for _ in range(count)]), more=3)
    what.message(10, 1000, rank=0, offset=5)
    frames = what.timeline().frames
    assert frames["0"].ended.tolist() == [33]
    assert frames["1"].ended.tolist() == [23]
    assert frames["0"].attempts.tolist() == [2]


def test_two_halves_of_a_run_are_the_whole():
    from orchestration.systems.computers.scheduler import Scheduler

    def described():
        what = Described(stop=1000)
        what.processor(switch=1)
        what.task(3, 10)
        what.task(4, 13, priority=2)
        what.link()
        what.message(7, 20)
        return what.parts()

    whole, halves = Scheduler(described()), Scheduler(described())
    whole.run(LATER)
    found = []
    for until in (1, 2, 77, 500, 501, 1000, 1001, LATER):
        halves.run(until)
        found.append(halves.take_notes())
        assert not len(found[-1]) or found[-1][-1, 0] < until
    assert np.concatenate(found).tolist() == whole.take_notes().tolist()
    assert NONE == -1
