"""Statistics of tasks and messages of a system, none of which exceeds its bound."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.runs.scheduling import Scheduled, schedule
from orchestration.systems.computers.bounds import bounds_of
from orchestration.systems.system.file import system_from_tables

MS = 1e-3


def tasks(*listed: tuple[float, float], **more: Any) -> dict[str, Any]:
    """Tasks of execution and period [ms], the first the most urgent."""
    return {
        f"t{i}": {"execution": c / 1e3, "period": t / 1e3, "priority": i + 1, **more} for i, (c, t) in enumerate(listed)
    }


def of(until: float, computer: dict[str, Any] | None = None, network: dict[str, Any] | None = None) -> Scheduled:
    tables = {"computers": {"cpu": computer} if computer else {}, "networks": {"bus": network} if network else {}}
    return schedule(tables, until)


THREE = ((1, 4), (2, 6), (3, 13))


def test_responses_bounds_and_shares_of_three_tasks_are_the_known_ones() -> None:
    found = of(0.156, {"tasks": tasks(*THREE)})
    assert list(found.tasks) == ["cpu.t0", "cpu.t1", "cpu.t2"]
    for each, bound, (c, t) in zip(found.tasks.values(), (1, 3, 10), THREE, strict=True):
        assert each.response is not None
        assert (each.response.max, each.bound) == (bound / 1e3, bound / 1e3)
        assert (each.jobs, each.unfinished, each.missed) == (156 // t, 0, 0.0)
        assert math.isclose(each.utilisation, c / t)
    third = found.tasks["cpu.t2"].response
    assert third is not None
    assert (third.min, third.p99) == (3 * MS, 10 * MS)
    assert 3 * MS < third.mean < 10 * MS
    assert math.isclose(found.busy["cpu"], 1 / 4 + 2 / 6 + 3 / 13)


@pytest.mark.parametrize(
    ("scheduling", "done"), [("fixed-priority", (50, 200, 250)), ("earliest-deadline-first", (135, 162, 203))]
)
def test_of_three_servos_on_one_processor_one_starves_by_rates_and_none_by_deadlines(
    scheduling: str, done: tuple[int, ...]
) -> None:
    servos = {f"t{t}": {"execution": 0.002, "period": t * MS, "priority": t} for t in (6, 5, 4)}
    found = of(1.0, {"scheduling": scheduling, "tasks": servos})
    assert math.isclose(sum(each.utilisation for each in found.tasks.values()), 2 / 6 + 2 / 5 + 2 / 4)
    assert [each.jobs for each in found.tasks.values()] == [167, 200, 250]
    assert all(abs(each.jobs - each.unfinished - n) <= 1 for each, n in zip(found.tasks.values(), done, strict=True))
    assert found.tasks["cpu.t6"].bound is None
    assert (found.tasks["cpu.t6"].missed or 0.0) > 0.6


def test_frames_of_a_millisecond_have_the_bounds_of_davis_and_others() -> None:
    messages = {f"m{i}": {"bytes": 8, "identifier": i, "period": t * MS} for i, t in enumerate((2.5, 3.5, 3.5))}
    found = of(1.0, None, {"kind": "can", "bit_rate": 111e3, "stuffing": "none", "messages": messages})
    assert [each.bound for each in found.messages.values()] == [2 * MS, 3 * MS, 3.5 * MS]
    assert found.messages["bus.m2"].response is not None
    assert found.messages["bus.m2"].response.max == 3.5 * MS


def test_skipped_and_aborted_jobs_are_missed_and_have_no_response() -> None:
    for overrun, skipped, aborted in (("skip", 3, 0), ("abort", 0, 6), ("queue", 0, 0)):
        found = of(0.06, {"tasks": tasks((15, 10), overrun=overrun)}).tasks["cpu.t0"]
        assert (found.skipped, found.aborted) == (skipped, aborted)
        assert found.missed == 1.0
        assert (found.response is None) == (overrun == "abort")


def test_there_is_no_bound_for_random_arrivals_nor_where_theory_has_none() -> None:
    by_chance = {"t9": {"execution": 0.001, "arrivals": {"poisson": 10}, "priority": 2}}
    found = of(1.0, {"tasks": {**tasks((1, 10)), **by_chance}}, {"kind": "first-come-first-served", "bit_rate": 1e6,
        "messages": {"m": {"bytes": 8, "period": 0.01}}})  # fmt: skip
    assert [each.bound for each in (*found.tasks.values(), *found.messages.values())] == [0.001, None, None]
    assert math.isclose(found.tasks["cpu.t9"].utilisation, 0.01)


def test_a_system_without_computers_is_rejected() -> None:
    with pytest.raises(UsageError, match="computers: none, and no networks: expected at least one of them"):
        schedule({"components": {"a": {"fmu": "a.fmu", "step": 0.1}}}, 1.0)


def test_a_given_end_overrides_that_of_the_file() -> None:
    tables = {"stop_time": 5.0, "computers": {"cpu": {"tasks": tasks((1, 10))}}}
    assert schedule(tables).until == 5.0
    assert schedule(tables, 0.1).until == 0.1


def system(random: np.random.Generator) -> dict[str, Any]:
    """Components as tasks of a computer whose messages share a CAN bus with those of one that samples, and load."""
    count = int(random.integers(2, 5))
    periods = random.integers(4, 40, count)
    shares = random.dirichlet(np.ones(count)) * random.uniform(0.3, 0.9)
    names = [f"c{i}" for i in range(count)]
    components: dict[str, Any] = {name: {"fmu": "a.fmu"} for name in names}
    components["alone"] = {"fmu": "a.fmu", "sampling": {"period": 0.011, "jitter": 0.002}}
    components["end"] = {"fmu": "a.fmu", "step": 0.01}
    on_cpu = {
        name: {
            "component": name,
            "period": float(t) * MS,
            "execution": {"uniform": [0.2 * float(t * share) * MS, float(t * share) * MS]},
            "priority": int(random.integers(1, count + 1)),
            "write": str(random.choice(["end", "deadline"])),
            "deadline": float(t) * MS * 1.5,
        }
        for name, t, share in zip(names, periods, shares, strict=True)
    }
    senders = [*names, "alone"]
    order = random.permutation(len(senders) + 1)
    messages: dict[str, Any] = {
        name: {"connection": name, "bytes": int(random.integers(1, 9)), "identifier": int(order[i])}
        for i, name in enumerate(senders)
    }
    messages["load"] = {"bytes": 8, "identifier": int(order[-1]), "period": 0.003, "jitter": 0.001}
    policy = str(random.choice(["fixed-priority", "earliest-deadline-first"]))
    return {
        "stop_time": 1.0,
        "seed": int(random.integers(1000)),
        "components": components,
        "connections": [{"name": each, "from": [f"{each}.y"], "to": [f"end.{each}"]} for each in senders],
        "computers": {"cpu": {"scheduling": policy, "preemptive": bool(random.random() < 0.7), "tasks": on_cpu}},
        "networks": {"bus": {"kind": "can", "bit_rate": 200e3, "messages": messages}},
    }


def test_no_message_of_a_task_exceeds_its_bound() -> None:
    random, bounded = np.random.default_rng(3), 0
    for _ in range(40):
        tables = system(random)
        found = schedule(tables)
        for name, each in (*found.tasks.items(), *found.messages.items()):
            if each.bound is not None and each.response is not None:
                assert each.response.max <= each.bound, (tables, name)
                bounded += name.startswith("bus.c")
    assert bounded > 40


def test_bounds_count_with_the_clock_of_the_computer() -> None:
    tables = {"stop_time": 1.0, "computers": {"cpu": {"clock_ratio": 2.0, "tasks": tasks((1, 8), (2, 12), (3, 26))}}}
    assert [*bounds_of(system_from_tables(tables, Path())).values()] == [1_000_000, 3_000_000, 10_000_000]
