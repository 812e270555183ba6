"""Bounds of theory: known ones, those that are reached, and that no job or frame of the scheduler exceeds its own.

The scheduler is that in C where there is a compiler, of which `test_compiled_scheduler.py` shows that it is that in
Python.
"""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from orchestration.systems.computers.bounds import Periodic, can, earliest_deadline, fixed_priority
from orchestration.systems.computers.compiled import scheduler
from orchestration.systems.computers.parts import EARLIEST_DEADLINE, FIXED_PRIORITY
from orchestration.systems.computers.timeline import Timeline
from tests.extent import tries
from tests.orchestration.systems.computers.described import Described

MS = 1_000_000


def ranked(*tasks: tuple[int, int]) -> list[Periodic]:
    """Of execution and period each, the first the most urgent."""
    return [Periodic(execution=c, period=t, priority=i) for i, (c, t) in enumerate(tasks)]


@pytest.mark.parametrize(
    ("tasks", "known"),
    [
        (((1, 4), (2, 6), (3, 13)), [1, 3, 10]),
        (((26, 70), (62, 100)), [26, 118]),  # Lehoczky 1990: the fifth job of a busy period is the latest
        (((52, 100), (52, 140)), [52, 156]),  # Tindell, Burns and Wellings 1994
        (((40, 100), (70, 100)), [40, None]),
        (((2, 4), (4, 8)), [2, 8]),
    ],
)
def test_responses_of_fixed_priorities_are_those_of_the_literature(tasks, known) -> None:
    assert fixed_priority(ranked(*tasks), preemptive=True, switch=0) == known


def test_responses_on_can_are_those_of_davis_and_others_and_not_the_refuted_ones() -> None:
    frames = ranked((MS, 2_500_000), (MS, 3_500_000), (MS, 3_500_000))
    assert can(frames, bit=8_000) == [2 * MS, 3 * MS, 3_500_000]
    assert fixed_priority(frames, preemptive=False, switch=0) == [2 * MS - 1, 3 * MS - 1, 3_500_000]


def test_a_job_costs_a_switch_and_another_for_each_preemption() -> None:
    assert fixed_priority(ranked((10, 100), (20, 200)), preemptive=True, switch=3) == [13, 16 + 23]
    assert fixed_priority(ranked((10, 100), (20, 200)), preemptive=False, switch=3) == [22 + 13, 13 + 23]


def test_there_is_no_bound_for_random_arrivals_nor_for_tasks_that_wait_for_them() -> None:
    tasks = ranked((1, 10), (1, 10), (1, 10))
    tasks[1] = replace(tasks[1], period=None)
    assert fixed_priority(tasks, preemptive=True, switch=0) == [1, None, None]
    assert can(tasks, bit=1) == [2, None, None]
    assert earliest_deadline(tasks, preemptive=True, switch=0) == [None] * 3


def test_a_period_that_is_no_whole_number_adds_a_nanosecond_of_jitter() -> None:
    thirds = [replace(task, period=Fraction(100, 3)) for task in ranked((10, 1), (10, 1))]
    assert fixed_priority(thirds, preemptive=True, switch=0) == [11, 21]


def test_the_bound_of_a_message_that_counts_from_queueing_excludes_its_lateness() -> None:
    first, second = ranked((10, 100), (20, 200))
    late = replace(second, jitter=50)
    assert can([first, late], bit=1) == [30, 80]
    assert can([first, replace(late, counts_when_queued=True)], bit=1) == [30, 30]


def test_all_deadlines_are_met_where_the_demand_test_holds() -> None:
    tasks = [Periodic(execution=c, period=t, deadline=d) for c, t, d in ((2, 4, 4), (3, 7, 5))]
    assert earliest_deadline(tasks, preemptive=True, switch=0) == [4, 5]
    assert earliest_deadline(tasks, preemptive=False, switch=0) == [4, 5]
    assert earliest_deadline(tasks, preemptive=True, switch=1) == [None, None]
    late = [replace(tasks[0], jitter=2), tasks[1]]
    assert earliest_deadline(late, preemptive=True, switch=0) == [None, None]
    fraction = [
        Periodic(execution=28, period=Fraction(115, 2), deadline=40),
        Periodic(execution=45, period=109, deadline=76),
    ]
    assert earliest_deadline(fraction, preemptive=True, switch=0) == [None, None]  # the job due at 97.5 ends at 101


# -- against the scheduler ---------------------------------------------------------------------------------------------


def task_set(random: np.random.Generator) -> list[Periodic]:
    """Up to 95 % of a processor, with deadlines below the period and beyond it, late releases, and equal priorities."""
    count = int(random.integers(2, 6))
    shares = random.dirichlet(np.ones(count)) * random.uniform(0.4, 0.95)
    periods = random.integers(10, 60, count)
    return [
        Periodic(
            execution=max(int(share * period), 1),
            period=int(period),
            jitter=int(random.integers(0, period)) if random.random() < 0.3 else 0,
            deadline=max(int(period * random.uniform(0.6, 1.6)), 1),
            priority=int(random.integers(0, count)),
        )
        for share, period in zip(shares, periods, strict=True)
    ]


def period_of(task: Periodic) -> int:
    """In whole nanoseconds."""
    assert isinstance(task.period, int)
    return task.period


def late(task: Periodic, random: np.random.Generator):
    """Latenesses of releases, the largest more often than uniform."""
    drawn = np.random.default_rng(random.integers(2**32))
    return lambda count: np.where(drawn.random(count) < 0.5, drawn.integers(0, task.jitter + 1, count), task.jitter)


def taking(shortest: int, longest: int, random: np.random.Generator):
    """Executions."""
    drawn = np.random.default_rng(random.integers(2**32))
    return lambda count: drawn.integers(shortest, longest + 1, count)


def simulated(tasks, policy, random, *, preemptive: bool, switch: int) -> Timeline:
    """One run of a task set, with offsets that are 0 in half of them, and executions up to the longest."""
    what, together = Described(stop=1_500), random.random() < 0.5
    what.processor(policy, preemptive=preemptive, switch=switch)
    for task in tasks:
        offset = 0 if together else int(random.integers(0, period_of(task)))
        shortest = task.execution if random.random() < 0.7 else 0
        what.task(
            taking(shortest, task.execution, random), period_of(task), offset=offset,
            priority=task.priority, deadline=task.deadline, late=late(task, random),
        )  # fmt: skip
    return what.timeline(scheduler)


@pytest.mark.parametrize("switch", [0, 1])
@pytest.mark.parametrize("preemptive", [True, False])
@pytest.mark.parametrize("policy", [FIXED_PRIORITY, EARLIEST_DEADLINE])
def test_no_response_exceeds_its_bound(policy, preemptive: bool, switch: int) -> None:
    random, bounded, reached = np.random.default_rng(7), 0, 0
    bounds = fixed_priority if policy == FIXED_PRIORITY else earliest_deadline
    for _ in range(many := tries(300, sampled=100)):
        tasks = task_set(random)
        found = simulated(tasks, policy, random, preemptive=preemptive, switch=switch)
        for name, bound in enumerate(bounds(tasks, preemptive=preemptive, switch=switch)):
            jobs = found.jobs[str(name)]
            if bound is not None and jobs.done.any():
                assert jobs.responses.max() <= bound, (tasks, name)
                bounded, reached = bounded + 1, reached + (jobs.responses.max() == bound)
    assert bounded > many / 3
    assert policy == EARLIEST_DEADLINE or reached > bounded / 20


def test_a_bound_is_reached_where_all_are_released_together_and_take_the_longest() -> None:
    random = np.random.default_rng(11)
    for _ in range(tries(200, sampled=50)):
        tasks = [replace(task, jitter=0, priority=i) for i, task in enumerate(task_set(random))]
        what = Described(stop=4_000)
        what.processor()
        for task in tasks:
            what.task(task.execution, period_of(task), priority=task.priority)
        bounds = fixed_priority(tasks, preemptive=True, switch=0)
        assert [int(jobs.responses.max()) for jobs in what.timeline(scheduler).jobs.values()] == bounds


def test_no_frame_on_can_exceeds_its_bound() -> None:
    random, reached = np.random.default_rng(13), 0
    for _ in range(buses := tries(1_000, sampled=250)):
        count = int(random.integers(2, 7))
        lengths = random.integers(50, 136, count)
        load = random.uniform(0.3, 0.95)
        periods = np.maximum((lengths / (random.dirichlet(np.ones(count)) * load)).astype(int), 60)
        frames = [
            Periodic(execution=int(c), period=int(t), priority=i) for i, (c, t) in enumerate(zip(lengths, periods))
        ]
        what = Described(stop=int(min(periods.max() * 3, 20_000)))
        what.link()
        for frame in frames:
            what.message(frame.execution, period_of(frame), rank=frame.priority, offset=int(random.integers(0, 100)))
        found = what.timeline(scheduler).frames
        for name, bound in enumerate(can(frames, bit=1)):
            responses = found[str(name)].responses
            if bound is not None and len(responses):
                assert responses.max() <= bound, frames
                reached += responses.max() >= bound - 1
    assert reached > 0.03 * buses


def test_the_latest_frame_is_not_the_first_of_a_busy_period() -> None:
    what = Described(stop=40 * MS)
    what.link()
    for rank, period in enumerate((2_500_000, 3_500_000, 3_500_000)):
        what.message(MS, period, rank=rank)
    assert math.isclose(what.timeline().frames["2"].responses.max(), 3.5 * MS)
