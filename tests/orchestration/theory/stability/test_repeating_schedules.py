"""A schedule that is reported to repeat does so for ever."""

from fractions import Fraction
from itertools import count

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.choices import NetworkKind
from orchestration.systems.system.component import Component
from orchestration.systems.system.computers import Computer, Message, Network, Task
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System
from orchestration.theory.stability.periodic_schedule import ScheduleTrace, periodic_schedule
from orchestration.theory.stability.perturbed_runs import repeating_period
from tests.extent import tries
from tests.orchestration.simulation.engines.random_systems import some

PERIODS = (0.002, 0.003, 0.004, 0.006, 0.012)
LATER = 100
"""common periods"""


@st.composite
def timetables(draw: st.DrawFn) -> System:
    """Laws, each of which measures a plant and commands it, over a bus or not, with load beside them."""
    numbers = count()
    laws = [f"law{i}" for i in range(draw(st.integers(1, 3)))]
    loads = [f"load{i}" for i in range(draw(st.integers(0, 2)))]
    tasks = {name: draw(tasks_of_any(next(numbers), name if name in laws else None)) for name in (*laws, *loads)}
    node = Computer(
        scheduling=draw(st.sampled_from(("fixed-priority", "earliest-deadline-first", "first-come-first-served"))),
        preemptive=draw(st.booleans()), switch=draw(some(1e-5)), tasks=tasks,
    )  # fmt: skip
    measured = [Connection(name=f"to_{law}", start=("plant.y",), end=(f"{law}.y",)) for law in laws]
    commanded = [Connection(name=f"of_{law}", start=(f"{law}.u",), end=(f"plant.{law}",)) for law in laws]
    over = [x for x in commanded if draw(st.booleans())]
    messages = {x.name: Message(connection=x.name, bytes=8, identifier=next(numbers)) for x in over}
    others = Message(bytes=8, period=draw(st.sampled_from(PERIODS)), identifier=next(numbers))
    kind: NetworkKind = draw(st.sampled_from(("can", "first-come-first-served")))
    bus = Network(kind=kind, bit_rate=draw(st.sampled_from((125e3, 500e3))), messages={**messages, "others": others})
    return System(
        stop_time=1.0,
        components={"plant": Component(fmu="plant", step=0.001), **{law: Component(fmu="law") for law in laws}},
        connections=(*measured, *commanded), computers={"node": node}, networks={"bus": bus} if over else {},
    )  # fmt: skip


@st.composite
def tasks_of_any(draw: st.DrawFn, number: int, component: str | None) -> Task:
    return Task(
        component=component, period=draw(st.sampled_from(PERIODS)), offset=draw(some(0.001, 0.0137)),
        execution=draw(st.sampled_from((0.0, 0.0003, 0.001, 0.0017))),
        priority=draw(st.sampled_from((number, 2))), deadline=draw(st.none() | st.sampled_from((0.0021, 0.005, 0.017))),
        read=draw(st.sampled_from(("start", "release"))), write=draw(st.sampled_from(("end", "deadline"))),
        overrun=draw(st.sampled_from(("queue", "skip", "abort"))),
    )  # fmt: skip


@settings(max_examples=tries(120, sampled=12), derandomize=True, deadline=None)
@given(timetables())
def test_a_hundred_common_periods_later_the_same_happens(system: System) -> None:
    try:
        schedule = periodic_schedule(system)
    except UsageError as error:
        event(str(error).partition(": ")[2].partition(" by")[0][:40])
        return
    event("repeats itself")
    length = int(schedule.period * 10**9)
    turns = 1 + LATER * 12_000_000 // length
    trace = ScheduleTrace(system, (turns + 12) * length)
    assert trace.schedule_between(turns * length, (turns + 1) * length, schedule.period) == schedule
    assert schedule.period % Fraction(1, 1000) == 0


@pytest.mark.parametrize(("execution", "period"), [(0.0003, 4_000_000), (0.0019, 76_000_000), (0.0019001, None)])
def test_twin_runs_are_compared_after_whole_periods_of_the_schedule(execution: float, period: int | None) -> None:
    """With jobs of 1.9 ms beside a load of an eighth, 35 of them take 76 ms."""
    tasks = {
        "load": Task(period=0.0008, priority=1, execution=0.0001),
        "law": Task(component="law", period=0.001, priority=2, execution=execution),
    }
    assert repeating_period(
        System(
            stop_time=1.0,
            components={"plant": Component(fmu="plant", step=0.0005), "law": Component(fmu="law")},
            connections=(Connection(name="of_law", start=("law.u",), end=("plant.u",)),),
            computers={"node": Computer(scheduling="fixed-priority", preemptive=True, tasks=tasks)},
        )
    ) == period  # fmt: skip
