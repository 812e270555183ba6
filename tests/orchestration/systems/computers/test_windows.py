"""Windows of samples and messages against the scheduler: nothing occurs outside, for any random numbers."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.computers.windows import Window, windows_of
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.computers import Arrivals, Computer, Message, Network, Task
from orchestration.systems.system.connection import Connection
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from tests.extent import tries

MS = 1e-3
FRAME = 0.27
"""of 8 bytes at 500 kbit/s, with all stuff bits [ms]"""


def system(
    control: Mapping[str, Any] | None, load: Mapping[str, Task] | None = None,
    computer: Mapping[str, Any] | None = None,
    messages: Mapping[str, Message] | None = None, sampling: Sampling | None = None, stop_time: float = 0.4,
) -> System:  # fmt: skip
    """A plant, and a controller that is a task, or sampled by itself."""
    network = Network(kind="can", bit_rate=5e5, messages=messages or {})
    tasks = {} if control is None else {"control": Task(component="controller", **control)}
    return System(
        components={"plant": Component(fmu="p.fmu", step=MS), "controller": Component(fmu="c.fmu", sampling=sampling)},
        connections=(
            Connection(name="measurement", start=("plant.y",), end=("controller.y",)),
            Connection(name="command", start=("controller.u",), end=("plant.u",)),
        ),
        computers={"node": Computer(**(computer or {}), tasks={**tasks, **(load or {})})} if control else {},
        networks={"bus": network} if messages else {}, stop_time=stop_time, seed=1,
    )  # fmt: skip


def window(control: Mapping[str, Any], *others: Any, **more: Any) -> Window:
    return windows_of(system({"period": 10 * MS, "execution": 2 * MS} | dict(control), *others, **more))["controller"]


def up_to(most: float) -> Distribution:
    return Distribution(uniform=(0.0, most))


FIRST = {"other": Task(period=5 * MS, priority=1, execution=up_to(1 * MS))}
LAST = {"other": Task(period=5 * MS, priority=3, execution=up_to(1 * MS))}
AFTER = {"priority": 2}


def in_ms(found: Window) -> tuple[float, ...]:
    times = (found.earliest, found.latest, found.least, found.most, found.end)
    return tuple(round(time / 1e6, 6) for time in times)


@pytest.mark.parametrize(
    ("control", "others", "computer", "expected"),
    [
        (AFTER, {}, {}, (0, 0, 2, 2, 2)),
        (AFTER, {}, {"switch": 0.1 * MS}, (0.1, 0.1, 2, 2, 2.1)),
        (AFTER, FIRST, {}, (0, 1, 2, 3, 3)),  # it may be preempted before it starts, or after
        (AFTER, FIRST, {"preemptive": False}, (0, 1, 2, 2, 3)),
        (AFTER, LAST, {}, (0, 0, 2, 2, 2)),
        (AFTER, LAST, {"preemptive": False}, (0, 0.999999, 2, 2, 2.999999)),
        (AFTER | {"execution": up_to(2 * MS)}, FIRST, {}, (0, 1, 0, 3, 3)),
        (AFTER | {"read": "release"}, FIRST, {}, (0, 0, 2, 3, 3)),
        (AFTER | {"read": "release", "jitter": 1 * MS}, FIRST, {}, (0, 1, 2, 4, 4)),
        (AFTER | {"write": "deadline"}, FIRST, {}, (0, 1, 10, 10, 10)),
        (AFTER | {"deadline": 6 * MS}, FIRST, {"scheduling": "earliest-deadline-first"}, (0, 4, 2, 6, 6)),
    ],
)
def test_windows_by_hand(control: dict[str, Any], others: Any, computer: Any, expected: tuple[float, ...]) -> None:
    assert in_ms(window(control, others, computer)) == expected


def test_a_frame_is_between_a_sample_and_its_arrival() -> None:
    command = Message(connection="command", bytes=8, identifier=2)
    status = Message(period=5 * MS, bytes=8, identifier=1)
    more: Any = {"messages": {"command": command, "status": status}}
    assert in_ms(window(AFTER, **more)) == (0, 0, 2 + FRAME, 2 + 2 * FRAME, 2 + 2 * FRAME)
    by_itself = windows_of(system(None, sampling=Sampling(period=10 * MS, jitter=1 * MS), **more))["controller"]
    assert in_ms(by_itself) == (0, 1, FRAME, 2 * FRAME, 1 + 2 * FRAME)


@pytest.mark.parametrize(
    ("control", "others", "computer", "message"),
    [
        ({}, {"radio": Task(arrivals=Arrivals(poisson=10.0), execution=MS)}, {}, "theory has no bound"),
        ({}, FIRST, {"scheduling": "first-come-first-served"}, "theory has no bound"),
        (
            {"execution": 6 * MS, "jitter": 5 * MS} | AFTER,
            FIRST,
            {},
            "may respond after 0.013 s; expected 0.01 s at most",
        ),
        ({"deadline": 2 * MS, "write": "deadline"} | AFTER, FIRST, {}, "expected 0.002 s at most"),
        ({"deadline": 2 * MS, "overrun": "abort"} | AFTER, FIRST, {}, "expected 0.002 s at most"),
    ],
)
def test_what_has_no_bound_is_rejected(control: Any, others: Any, computer: Any, message: str) -> None:
    with pytest.raises(UsageError, match=rf"^computers\.node\.tasks\.control: .*{message}"):
        window(control, others, computer)


def test_messages_of_components_in_continuous_time_have_windows_of_their_own() -> None:
    measured = Message(connection="measurement", bytes=8, identifier=1, period=5 * MS)
    found = windows_of(system({"period": 10 * MS, "execution": 2 * MS}, messages={"y": measured}))
    assert found["controller"] == window({})
    frame = found["networks.bus.messages.y"]
    assert (frame.earliest, frame.latest, frame.at_deadline) == (0, 0, False)
    assert frame.least == frame.most == frame.end > 0


def test_a_component_beside_a_network_is_as_late_as_its_own_clock() -> None:
    measured = Message(connection="measurement", bytes=8, identifier=1, period=5 * MS)
    found = windows_of(system(None, messages={"y": measured}, sampling=Sampling(period=10 * MS, jitter=4 * MS)))
    assert (found["controller"].earliest, found["controller"].latest, found["controller"].end) == (0, 4e6, 4e6)


def drawn(random: np.random.Generator) -> System:
    """A controller among other tasks, in half of the systems with its command on a bus among other frames."""

    def chance(share: float = 0.5) -> bool:
        return bool(random.random() < share)

    def some(most: float) -> float:
        return round(float(random.uniform(0.0, most)), 5)

    def task(share: float) -> dict[str, Any]:
        period = round(float(random.uniform(4.0, 20.0))) * MS
        most = round(share * period, 6)
        least = most if chance() else 0.0
        return {
            "period": period, "offset": 0.0 if chance() else some(period),
            "jitter": some(0.2 * period) if chance(0.3) else 0.0,
            "priority": int(random.integers(1, 4)),
            "execution": most if least == most else Distribution(values=(least, most)),
        }  # fmt: skip

    shares = random.dirichlet(np.ones(4)) * random.uniform(0.3, 0.8)
    control = task(shares[0]) | {
        "read": "release" if chance(0.3) else "start", "write": "deadline" if chance(0.3) else "end",
        "overrun": ["queue", "skip", "abort"][int(random.integers(3))],
    }  # fmt: skip
    computer = {
        "scheduling": "fixed-priority" if chance(0.7) else "earliest-deadline-first",
        "preemptive": chance(0.7), "switch": 2e-5 if chance(0.3) else 0.0,
    }  # fmt: skip
    messages = {
        "command": Message(connection="command", bytes=8, identifier=2),
        "before": Message(period=round(float(random.uniform(1.0, 5.0)), 2) * MS, bytes=8, identifier=1),
        "after": Message(period=3 * MS, jitter=MS, bytes=8, identifier=3),
    }
    load = {f"load {i}": Task(**task(share)) for i, share in enumerate(shares[1:], start=1)}
    return system(control, load, computer, messages if chance() else {})


def test_nothing_occurs_outside_its_window() -> None:
    random, seen, edges = np.random.default_rng(5), 0, 0
    for _ in range(many := tries(400, sampled=100)):
        one = drawn(random)
        try:
            found = windows_of(one)["controller"]
        except UsageError:
            continue
        seen += 1
        timeline = timeline_of(one)
        jobs, task = timeline.jobs["node.control"], one.computers["node"].tasks["control"]
        sent = timeline.frames["bus.command"].ended if one.networks else jobs.written
        count = int((jobs.done & (jobs.written > 0))[: len(sent)].sum())
        nominal, arrived = jobs.nominal[:count], sent[:count]
        read = (jobs.released if task.read == "release" else jobs.started)[:count]
        there = arrived >= 0
        shift, waited = read - nominal, (arrived - (nominal if found.at_deadline else read))[there]
        assert found.earliest <= shift.min()
        assert shift.max() <= found.latest
        assert found.least <= waited.min()
        assert waited.max() <= found.most
        assert (arrived - nominal)[there].max() <= found.end
        edges += int(shift.max() == found.latest) + int(waited.min() == found.least) + int(waited.max() == found.most)
    assert seen > 0.375 * many
    assert edges > 0.375 * many
