"""Timelines of systems: kinds of networks, random arrivals, numbers from their streams."""

import math
import re

import numpy as np
import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.computers.scheduler import Scheduler
from orchestration.systems.schedule.resources import timeline_of
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.system.computers import Arrivals, Computer, Message, Network, Task
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System
from tests.orchestration.components.fmi.small import needs_compiler

MS = 1_000_000


def of(network, stop_time=1.0, **keys):
    return timeline_of(System(stop_time=stop_time, networks={"n": network}, **keys)).frames


def test_a_message_of_tdma_waits_for_its_slot_and_one_goes_in_a_slot():
    frames = of(
        Network(kind="tdma", bit_rate=8e3, slots=(0.002, 0.003), messages={
            "a": Message(bytes=1, slot=0, period=0.005), "b": Message(bytes=2, slot=1, period=0.01, offset=0.001),
            "c": Message(bytes=1, slot=1, period=0.01),
        }), stop_time=0.02,
    )  # fmt: skip
    assert frames["n.a"].ended.tolist() == [MS, 6 * MS, 11 * MS, 16 * MS]
    assert frames["n.b"].ended.tolist() == [9 * MS, 19 * MS]  # that of 0 ms was first
    assert frames["n.c"].ended.tolist() == [3 * MS, 13 * MS]


def test_a_switch_stores_and_forwards_and_the_most_urgent_goes_first_on_each_link():
    messages = {
        "low": Message(bytes=62, priority=2, period=1.0, start="a", end="c"),
        "high": Message(bytes=62, priority=1, period=1.0, start="b", end="c"),
        "other": Message(bytes=62, priority=3, period=1.0, start="b", end="a"),
    }
    frames = of(Network(kind="ethernet", bit_rate=8e5, latency=1e-3, messages=messages), stop_time=0.5)
    assert frames["n.high"].ended.tolist() == [3 * MS]
    assert frames["n.low"].ended.tolist() == [4 * MS]  # both are in the switch at 2 ms
    assert frames["n.other"].ended.tolist() == [4 * MS]  # after `high` from its node, and full duplex
    assert frames["n.low"].attempts.tolist() == [2]


def test_frames_blocked_for_all_but_a_nanosecond_reach_the_bounds_of_can():
    def responses(offsets):
        periods = (0.0025, 0.0035, 0.0035)
        messages = {
            name: Message(bytes=1, identifier=i, period=period, offset=offset)
            for i, (name, period, offset) in enumerate(zip("abc", periods, offsets))
        }
        frames = of(Network(kind="can", bit_rate=65e3, messages=messages), stop_time=0.2)  # 65 bits: 1 ms
        return [int(each.responses.max()) for each in frames.values()]

    assert responses((1e-9, 0.1, 0.0))[0] == 1_999_999
    assert responses((1e-9, 1e-9, 0.0))[1] == 2_999_999
    assert responses((0.0, 0.0, 0.0))[2] == 3_500_000


def test_random_arrivals_are_the_numbers_of_their_stream():
    tasks = {"load": Task(arrivals=Arrivals(poisson=100.0), offset=0.5, execution=0.001)}
    system = System(stop_time=5.0, seed=3, computers={"one": Computer(tasks=tasks)})
    u = Streams(3).of("computers.one.tasks.load", "arrivals").random(1000).tolist()
    times = 500_000_000 + np.cumsum([max(1, math.floor(-math.log(1.0 - each) * 1e9 / 100.0)) for each in u])
    (jobs,) = timeline_of(system).jobs.values()
    assert 350 < len(jobs) < 550
    assert jobs.released.tolist() == times[: len(jobs)].tolist()


def test_execution_and_lateness_belong_to_the_release_also_where_it_is_skipped():
    task = Task(period=0.01, jitter=0.005, execution=Distribution(uniform=(0.0, 0.02)), overrun="skip", offset=0.002)
    system = System(stop_time=1.0, seed=8, computers={"one": Computer(tasks={"t": task}, clock_ratio=1.1)})
    (jobs,) = timeline_of(system).jobs.values()
    late = np.floor(Streams(8).of("computers.one.tasks.t", "jitter").random(len(jobs)) * 5 * MS)
    takes = np.floor(Streams(8).of("computers.one.tasks.t", "execution").random(len(jobs)) * 20 * MS)
    assert (jobs.released - jobs.nominal).tolist() == late.tolist()
    assert jobs.nominal.tolist() == [round((2 + 10 * k) * MS / 1.1) for k in range(len(jobs))]
    assert 10 < jobs.done.sum() < len(jobs) - 10
    assert (jobs.ended - jobs.started)[jobs.done].tolist() == takes[jobs.done].tolist()


def test_attempt_n_takes_number_n():
    message = Message(bytes=8, identifier=1, period=0.01)
    frames = of(Network(kind="can", bit_rate=5e5, error=0.4, messages={"m": message}), seed=5)
    spoilt = (Streams(5).of("networks.n.messages.m", "error").random(500) < 0.4).tolist()
    attempts = []
    for _ in range(len(frames["n.m"])):
        attempts.append(spoilt.index(False) + 1)
        del spoilt[: attempts[-1]]
    assert frames["n.m"].attempts.tolist() == attempts
    durations = (frames["n.m"].ended - frames["n.m"].started)[:-1]
    assert durations.tolist() == [270_000 + (each - 1) * (135 + 31) * 2000 for each in attempts][:-1]


STARVED = {"all": Task(period=0.001, execution=0.001), "none": Task(period=1e-8, priority=2, execution=0.001)}
JAMMED = {"all": Message(period=0.001, bytes=1, identifier=0), "none": Message(period=1e-8, bytes=1, identifier=1)}


@pytest.mark.parametrize("in_c", [pytest.param(True, marks=needs_compiler), False])
@pytest.mark.parametrize(
    ("system", "line"),
    [
        (
            System(stop_time=1.0, computers={"c": Computer(tasks=STARVED)}),
            "computers.c.tasks.none: more than 1048576 of its jobs wait: expected that it gets its processor",
        ),
        (
            System(stop_time=1.0, networks={"n": Network(kind="can", bit_rate=6e4, messages=JAMMED)}),
            "networks.n.messages.none: more than 1048576 of its frames wait: expected a network that carries them",
        ),
    ],
)
def test_queues_that_grow_without_end_are_reported_before_they_take_all_memory(
    monkeypatch: pytest.MonkeyPatch, system: System, line: str, in_c: bool
) -> None:
    if not in_c:
        monkeypatch.setattr("orchestration.systems.schedule.resources.scheduler", Scheduler)
        monkeypatch.setattr("orchestration.systems.computers.scheduler.MAX_WAITING", 100)
    with pytest.raises(UsageError, match=f"^{re.escape(line)}"):
        timeline_of(system)
