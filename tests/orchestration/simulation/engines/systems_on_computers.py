"""What hypothesis draws from: systems whose components are tasks, and whose connections go over networks."""

import functools
from dataclasses import replace

from hypothesis import strategies as st

from orchestration.systems.system.choices import NetworkKind
from orchestration.systems.system.computers import Arrivals, Computer, Message, Network, Task
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.model import System
from tests.orchestration.simulation.engines.random_systems import (
    BOOLEANS,
    TIMES,
    chosen,
    distributions,
    some,
    systems,
    whole,
)

KINDS: tuple[NetworkKind, ...] = ("can", "can-fd", "tdma", "ethernet", "first-come-first-served")
LATE = st.just(0.0) | st.floats(0.0, 0.4)
LATE_MESSAGES = st.just(0.0) | st.floats(0.0, 0.9)
DEADLINES = st.none() | st.sampled_from(TIMES) | st.floats(0.001, 0.1)
EXECUTIONS = some(0.001, 0.005, 0.01) | distributions(0.02)


@functools.cache
@st.composite
def systems_on_computers(draw: st.DrawFn) -> System:
    """Some of the sampled components are tasks, some connections messages, and there is load beside them."""
    system = draw(systems(most=4))
    over = [x for x in system.connections if draw(BOOLEANS)]
    networks = {f"n{i}": draw(_networks(system, [x for j, x in enumerate(over) if j % 2 == i])) for i in range(2)}
    names = [name for name, component in system.components.items() if component.sampling is not None]
    tasks = [name for name in names if draw(whole(0, 2))]
    computers = {
        f"p{i}": draw(_computers(system, over, [t for j, t in enumerate(tasks) if j % 2 == i])) for i in range(2)
    }
    components = {
        name: replace(component, sampling=None) if name in tasks else component
        for name, component in system.components.items()
    }
    connections = tuple(replace(x, order="gauss-seidel") for x in system.connections)
    used = {name: one for name, one in networks.items() if one.messages}
    return replace(system, components=components, connections=connections, computers=computers, networks=used)


@st.composite
def _computers(draw: st.DrawFn, system: System, over: list[Connection], names: list[str]) -> Computer:
    own = {name: draw(_tasks(system, over, name)) for name in names}
    load = {f"load{i}": draw(_loads()) for i in range(draw(whole(0, 2)))}
    return Computer(
        scheduling=draw(chosen(("fixed-priority", "earliest-deadline-first", "first-come-first-served"))),
        preemptive=draw(BOOLEANS), switch=draw(some(1e-9, 1e-3)),
        clock_ratio=draw(chosen((1.0, 1.0, 0.5, 1.001))), tasks={**own, **load},
    )  # fmt: skip


@st.composite
def _tasks(draw: st.DrawFn, system: System, over: list[Connection], name: str) -> Task:
    task = replace(
        draw(_loads()), component=name, read=draw(chosen(("start", "release"))),
        write=draw(chosen(("end", "deadline"))), overrun=draw(chosen(("queue", "skip", "abort"))),
    )  # fmt: skip
    # what has arrivals: those over networks, whatever sends them
    into = [x.name for x in over if x.receiver == name and system.components[x.sender].sampling is None]
    is_released = bool(into) and draw(whole(0, 1)) == 0
    if is_released:
        return replace(task, on=draw(st.sampled_from(into)), period=None, offset=0.0, jitter=0.0, arrivals=None,
                       deadline=draw(chosen(TIMES)))  # fmt: skip
    return task


@functools.cache
@st.composite
def _loads(draw: st.DrawFn) -> Task:
    period = draw(chosen(TIMES))
    execution = draw(EXECUTIONS)
    by_chance = draw(whole(0, 4)) == 0
    return Task(
        period=None if by_chance else period, arrivals=Arrivals(poisson=1 / period) if by_chance else None,
        offset=draw(some()), jitter=0.0 if by_chance else draw(LATE) * period,
        priority=draw(whole(0, 3)), execution=execution,
        deadline=draw(DEADLINES),
    )  # fmt: skip


@st.composite
def _networks(draw: st.DrawFn, system: System, over: list[Connection]) -> Network:
    kind = draw(chosen(KINDS))
    messages = {}
    for i, x in enumerate(over):
        sampled = system.components[x.sender].sampling is not None
        period = draw(chosen(TIMES))
        messages[x.name] = replace(
            draw(_messages(i)), connection=x.name, period=None if sampled else period,
            jitter=0.0 if sampled else draw(LATE_MESSAGES) * period, start="a", end="b",
        )  # fmt: skip
    for i in range(draw(whole(0, 2)) if over else 0):
        messages[f"load{i}"] = draw(_messages(100 + i))
    return Network(
        kind=kind, bit_rate=draw(chosen((1e4, 5e4, 1e6))), data_bit_rate=2e6 if kind == "can-fd" else None,
        slots=(0.01, 0.02) if kind == "tdma" else (), latency=draw(some(0.001)) if kind == "ethernet" else 0.0,
        error=draw(chosen((0.0, 0.3))), messages=messages,
    )  # fmt: skip


@functools.cache
@st.composite
def _messages(draw: st.DrawFn, identifier: int) -> Message:
    return Message(
        bytes=draw(whole(1, 8)), identifier=identifier, slot=draw(whole(0, 1)),
        priority=draw(whole(0, 2)), period=draw(chosen(TIMES)), offset=draw(some()),
        start=draw(chosen("ac")), end=draw(chosen("bd")),
    )  # fmt: skip
