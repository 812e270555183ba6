"""Responses against those of simso, a third-party scheduler."""

import numpy as np
import pytest

from orchestration.systems.computers.parts import EARLIEST_DEADLINE, FIXED_PRIORITY
from tests.extent import tries
from tests.orchestration.systems.computers.described import Described

simso = pytest.importorskip("simso.core")
from simso.configuration import Configuration  # noqa: E402

NAMES = {FIXED_PRIORITY: "simso.schedulers.FP", EARLIEST_DEADLINE: "simso.schedulers.EDF_mono"}
STOP = 600


def task_set(random):
    """Whole numbers: execution, period and offset of some tasks, half as much again as a processor can do at most."""
    count = int(random.integers(2, 7))
    shares = random.dirichlet(np.ones(count)) * random.uniform(0.4, 1.5)
    periods = random.integers(4, 60, count)
    executions = np.clip((shares * periods).astype(int), 1, periods)
    return [(int(c), int(t), int(random.integers(0, t))) for c, t in zip(executions, periods)]


def theirs(tasks, policy):
    made = Configuration()
    made.cycles_per_ms, made.duration = 1, STOP
    for i, (execution, period, offset) in enumerate(tasks):
        made.add_task(
            name=str(i), identifier=i, period=period, activation_date=offset, wcet=execution, deadline=period,
            abort_on_miss=False, data={"priority": len(tasks) - i},
        )  # fmt: skip
    made.add_processor(name="one", identifier=1)
    made.scheduler_info.clas = NAMES[policy]
    model = simso.Model(made)
    model.run_model()
    found: dict[int, list[int]] = {}
    for task in model.results.tasks.values():
        found[int(task.name)] = [job.end_date - job.activation_date for job in task.jobs if job.end_date is not None]
    return found


def ours(tasks, policy):
    what = Described(stop=STOP)
    what.processor(policy)
    for i, (execution, period, offset) in enumerate(tasks):
        what.task(execution, period, offset=offset, priority=i if policy == FIXED_PRIORITY else 1)
    return {int(name): jobs.responses.tolist() for name, jobs in what.timeline().jobs.items()}


@pytest.mark.parametrize("policy", [FIXED_PRIORITY, EARLIEST_DEADLINE])
def test_responses_of_random_task_sets_are_those_of_simso(policy):
    random, jobs = np.random.default_rng(26), 0
    for _ in range(tries(40, sampled=5)):
        tasks = task_set(random)
        expected, found = theirs(tasks, policy), ours(tasks, policy)
        for i, responses in expected.items():
            count = min(len(responses), len(found[i]))  # at the very end both may know one more
            assert abs(len(responses) - len(found[i])) <= 1
            assert found[i][:count] == responses[:count], tasks
            jobs += count
    assert jobs > tries(2_000, sampled=250)
