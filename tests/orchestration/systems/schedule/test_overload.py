"""What is said of a processor whose tasks ask for more time than there is."""

from pathlib import Path
from typing import Any

import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.runs.scheduling import schedule
from orchestration.systems.schedule.overload import errors_name_overload, overloads, overloads_in_words
from orchestration.systems.system.file import system_from_tables
from orchestration.systems.system.model import System

ANSWER = "; what is computed is of the jobs that start"


def of(urgent: float, other: float, overrun: str = "queue", **computer: Any) -> System:
    """A processor with two tasks of these execution times [ms], both released every 4 ms."""
    tasks = {
        "urgent": {"period": 0.004, "priority": 1, "execution": urgent / 1e3, "overrun": overrun},
        "other": {"period": 0.004, "priority": 2, "execution": other / 1e3},
    }
    computers = {"cpu": {"tasks": tasks, **computer}, "idle": {"tasks": {"calm": {"period": 1.0, "execution": 0.5}}}}
    return system_from_tables({"stop_time": 0.4, "computers": computers}, Path())


@pytest.mark.parametrize(
    ("system", "text"),
    [
        (of(2.0, 2.0), None),
        (of(2.0, 2.6), "115 % of its time: jobs of other wait, ever more of them"),
        (of(2.0, 2.0, switch=1e-5), "100.5 % of its time, switches included: jobs of other wait, ever more of them"),
        (
            of(2.0, 2.6, scheduling="earliest-deadline-first"),
            "115 % of its time: jobs of urgent and other wait, ever more of them",
        ),
        (
            of(5.0, 0.0, "abort"),
            "125 % of its time: jobs of urgent that are not done at their deadline end there; "
            "jobs of other wait, ever more of them",
        ),
        (
            of(2.0, 2.6, "skip", scheduling="first-come-first-served"),
            "115 % of its time: releases of urgent before its last job is done are skipped; "
            "jobs of other wait, ever more of them",
        ),
    ],
)
def test_an_overload_has_its_demand_and_what_becomes_of_the_jobs(system: System, text: str | None) -> None:
    expected = [] if text is None else [f"computers.cpu: overloaded, its tasks demand {text}{ANSWER}"]
    assert overloads_in_words([system]) == expected


def test_the_demand_is_that_of_the_table_of_schedule_also_of_jobs_that_messages_release() -> None:
    tables = {
        "stop_time": 0.4,
        "components": {
            name: {"fmu": f"{name}.fmu", "sampling": {"period": 0.004}} if name == "a" else {"fmu": "b.fmu"}
            for name in "ab"
        },
        "connections": [{"name": "x", "from": ["a.y"], "to": ["b.u"]}],
        "computers": {"cpu": {"tasks": {"b": {"component": "b", "on": "x", "execution": 0.005, "deadline": 0.004}}}},
    }
    system = system_from_tables(tables, Path())
    (found,) = overloads(system)
    assert found.demand == sum(each.utilisation for each in schedule(system).tasks.values()) == pytest.approx(1.25)


def test_of_several_systems_it_is_the_largest() -> None:
    (text,) = overloads_in_words([of(2.0, 2.2), of(2.0, 2.6), of(1.0, 1.0)])
    assert text.startswith("computers.cpu: overloaded, its tasks demand up to 115 % of its time: jobs of other wait")


@pytest.mark.parametrize(
    ("about", "named"),
    [("computers and networks: why", True), ("computers.cpu.tasks.other: why", True),
     ("computers.idle.tasks.calm: why", False)],
)  # fmt: skip
def test_an_error_about_the_schedule_names_the_overload_of_its_own_processor(*, about: str, named: bool) -> None:
    with pytest.raises(UsageError) as found, errors_name_overload(of(2.0, 2.6)):
        raise UsageError(about)
    overload = "computers.cpu: overloaded, its tasks demand 115 % of its time: jobs of other wait, ever more of them"
    assert str(found.value) == (f"{overload}; expected at most 100 %: {about}" if named else about)
    with pytest.raises(UsageError) as found, errors_name_overload(of(2.0, 2.0)):
        raise UsageError(about)
    assert str(found.value) == about
