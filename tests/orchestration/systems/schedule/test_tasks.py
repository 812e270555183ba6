"""The timetable of a system with components on computers and connections over networks."""

from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.schedule import instant_arrays
from orchestration.systems.schedule.instant_arrays import Cursor
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.component import Component, SamplingOnArrival
from orchestration.systems.system.computers import Computer, Message, Network, Task
from tests.extent import tries
from tests.orchestration.simulation.engines.stubs import continuous, sampled, system, wire

MS = 1_000_000
NOTHING: Mapping[str, Any] = {}


def instants(what, fixed=None):
    return list(Cursor(Timetable(what, Streams(what.seed, what.streams), fixed)).instants())


def loop(controller=None, measurement=NOTHING, command=NOTHING, **keys):
    return system(
        {"plant": continuous(0.1), "controller": controller or Component(fmu="stub")},
        [wire("plant.y", "controller.y", "measurement", **measurement),
         wire("controller.u", "plant.u", "command", **command)],
        **keys,
    )  # fmt: skip


def computers(tasks=NOTHING, **keys):
    computer = {key: keys.pop(key) for key in ("scheduling", "preemptive", "switch", "clock_ratio") if key in keys}
    return {"one": Computer(tasks={"control": Task(component="controller", **keys), **tasks}, **computer)}


def times(found, what):
    """The times [ms] of the instants that have a part, by its name."""
    return [i.time / MS for i in found if getattr(i, what)]


LATE = st.floats(0.0, 0.03)


@settings(max_examples=tries(40, sampled=10), deadline=None)
@given(
    period=st.floats(0.01, 0.2), offset=st.floats(0.0, 0.1), share=st.floats(0.0, 0.9), ratio=st.floats(0.9, 1.1),
    delays=st.tuples(LATE, LATE, LATE, LATE), losses=st.tuples(*2 * [st.sampled_from([0.0, 0.3])]),
    burst=st.sampled_from([None, 2.0]), seed=st.integers(0, 99),
)  # fmt: skip
def test_a_single_task_without_execution_time_has_the_instants_of_sampling(
    period, offset, share, ratio, delays, losses, burst, seed
):
    jitter = share * period / ratio
    how = {
        "measurement": {"delay": delays[0], "delay_jitter": delays[1], "loss": losses[0], "burst_length": burst},
        "command": {"delay": delays[2], "delay_jitter": delays[3], "loss": losses[1], "burst_length": burst},
        "seed": seed,
    }
    by_sampling = loop(
        sampled(period, offset=offset, jitter=jitter, clock_ratio=ratio),
        streams={"components.controller.jitter": 7},
        **how,
    )
    by_task = loop(
        computers=computers(period=period, offset=offset, jitter=jitter, clock_ratio=ratio),
        streams={"computers.one.tasks.control.jitter": 7},
        **how,
    )
    assert _told(instants(by_task)) == _told(instants(by_sampling))


def _told(found, stop=1000 * MS):
    """The instants, those after the end as one; what is measured at the end no sample reads."""

    def message(m):
        index, k, sent, arrival = m
        return (index, k, min(sent, stop + 1), -1 if sent > stop else min(arrival, stop + 1))

    def sample(s):
        return (s.component, min(s.next_time, stop), [*map(message, s.received)], [*map(message, s.sent)])

    return [
        i._replace(
            arrivals=[*map(message, i.arrivals)],
            measured=[message(m) for m in i.measured if m[2] < stop],
            samples=[*map(sample, i.samples)],
        )
        for i in found
    ]


def test_a_constant_execution_time_has_the_instants_of_a_delay():
    by_delay = instants(loop(sampled(0.1), command={"delay": 0.003}))
    by_task = instants(loop(computers=computers(period=0.1, execution=0.003)))
    assert [i.time for i in by_task] == [i.time for i in by_delay]
    assert times(by_task, "arrivals") == times(by_delay, "arrivals")
    sent = [s.sent[0][2:] for i in by_task for s in i.samples]
    assert sent[0] == [3 * MS, 3 * MS]


def test_a_job_reads_at_its_start_or_release_and_writes_at_its_end_or_deadline():
    load = {"other": Task(period=0.1, execution=0.02, priority=0)}
    for read, samples in (("start", [20, 120, 220]), ("release", [0, 100, 200])):
        for write, writes in (("end", [30, 130, 230]), ("deadline", [80, 180, 280])):
            how = computers(period=0.1, execution=0.01, deadline=0.08, read=read, write=write, tasks=load)
            found = instants(loop(computers=how, stop_time=0.29))
            assert times(found, "samples") == samples
            assert times(found, "arrivals") == writes


def test_a_task_that_waits_steps_to_its_next_sample_and_reads_the_newest():
    load = {"other": Task(period=0.3, execution=0.15, priority=0)}
    found = instants(loop(computers=computers(period=0.1, execution=0.01, tasks=load), stop_time=0.5))
    samples = [(i.time // MS, s.next_time // MS) for i in found for s in i.samples]
    assert samples == [(150, 160), (160, 200), (200, 450), (450, 460), (460, 2**60 // MS)]


def test_an_aborted_job_samples_and_sends_nothing_and_one_that_never_started_does_neither():
    load = {"other": Task(period=0.5, execution=0.25, priority=0, offset=0.095)}
    how = computers(period=0.1, execution=0.01, overrun="abort", tasks=load, offset=0.09)
    found = instants(loop(computers=how, stop_time=0.5))
    assert times(found, "samples") == [90, 345, 390, 490]  # that of 90 is interrupted, that of 190 never begins
    assert times(found, "arrivals") == [355, 400, 500]
    (first,) = (s for i in found for s in i.samples if i.time == 90 * MS)
    assert first.sent[0][3] == -1
    assert first.sent[0][2] > 500 * MS


def test_a_starved_task_steps_to_the_end():
    load = {"other": Task(period=0.1, execution=0.1, priority=0, offset=0.05)}
    found = instants(loop(computers=computers(period=0.1, execution=0.01, tasks=load)))
    assert times(found, "samples") == [0]
    assert times(found, "arrivals") == [10]


def bus(*, kind="can", bit_rate=500e3, stuffing="none", more=NOTHING, **keys):
    message = {"connection": "command", "bytes": 8, "identifier": 1, **keys}
    return {
        "bus": Network(
            kind=kind, bit_rate=bit_rate, stuffing=stuffing, messages={"command": Message(**message), **more}
        )
    }


def test_a_message_over_a_network_arrives_after_its_last_bit_and_the_delay_of_its_connection():
    found = instants(loop(sampled(0.1), command={"delay": 0.001}, networks=bus(), stop_time=0.25))
    bits = 111 * 2000
    assert [i.time for i in found if i.arrivals] == [k * 100 * MS + bits + MS for k in range(3)]
    load = {"status": Message(period=0.1, bytes=8, identifier=0)}
    found = instants(loop(sampled(0.1), networks=bus(more=load), stop_time=0.25))
    assert [i.time for i in found if i.arrivals] == [k * 100 * MS + 2 * bits for k in range(3)]


def test_messages_of_a_component_in_continuous_time_over_a_network_have_separate_instants():
    how = {"bus": Network(kind="first-come-first-served", bit_rate=8e3, messages={
        "measurement": Message(connection="measurement", bytes=1, period=0.04, offset=0.01)})}  # fmt: skip
    found = instants(loop(sampled(0.1), networks=how, stop_time=0.2))
    assert times(found, "posted") == [10, 50, 90, 130, 170]
    assert [(i.time // MS, m[1]) for i in found for m in i.arrivals if m[0] == 0] == [
        (11, 0), (51, 1), (91, 2), (131, 3), (171, 4),
    ]  # fmt: skip
    assert all(0 in i.stepped for i in found if i.posted)


def test_a_task_is_released_by_each_message_that_arrives_and_reads_it():
    what = system(
        {"plant": continuous(0.1), "imu": sampled(0.1), "filter": Component(fmu="stub")},
        [wire("plant.y", "imu.u", "sensed"), wire("imu.y", "filter.u", "imu", delay=0.02, loss=0.5),
         wire("filter.y", "plant.u", "filtered")],
        computers={"one": Computer(tasks={"f": Task(component="filter", on="imu", execution=0.004, deadline=0.1)})},
        seed=3,
    )  # fmt: skip
    found = instants(what)
    arrivals = [i.time for i in found for m in i.arrivals if m[0] == 1]
    samples = [i.time for i in found for s in i.samples if s.component == 2]
    assert 2 < len(arrivals) < 10
    assert samples == arrivals


def test_windows_of_any_length_are_one_schedule(monkeypatch):
    load = {"other": Task(period=0.07, execution=0.03, priority=0), "more": Task(period=0.31, execution=0.1)}
    what = loop(
        computers=computers(period=0.04, execution=0.01, jitter=0.01, tasks=load), networks=bus(), seed=4,
        measurement={"delay": 0.02},
    )  # fmt: skip
    found = instants(what)
    for size in (1, 7, 11, 100):
        monkeypatch.setattr(instant_arrays, "INSTANTS", size)
        assert instants(what) == found


def test_while_a_task_is_starved_others_are_drawn_a_window_at_a_time():
    """Else each window would process all samples of the lookahead, which reaches to the end."""
    busy = Task(component="busy", period=0.01, execution=0.01)
    starved = Task(component="starved", period=0.01, priority=2)
    what = system(
        {"plant": continuous(0.1), "busy": Component(fmu="stub"), "starved": Component(fmu="stub")},
        [wire("plant.y", "busy.y", "one"), wire("busy.u", "plant.u", "two"), wire("plant.y", "starved.y", "three")],
        computers={"one": Computer(tasks={"busy": busy, "starved": starved})}, stop_time=50.0,
    )  # fmt: skip
    timetable, drawn, seen = Timetable(what, Streams(0)), 0, 0
    while (found := timetable.next_schedule(100)) is not None:
        drawn, seen = max(drawn, *(len(each.times) for each in timetable._tasks)), seen + len(found.samples)
    assert seen == 5000
    assert drawn < 200


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"command": {"order": "jacobi"}}, r"connections\.command\.order = jacobi: expected gauss-seidel beside "
         r"computers\.one\.tasks\.control"),
        ({"controller": sampled(0.1)}, r"components\.controller\.sampling = given: expected none beside "
         r"computers\.one\.tasks\.control"),
    ],
)  # fmt: skip
def test_invalid_tasks_are_rejected_by_name(change, complaint):
    with pytest.raises(UsageError, match=complaint):
        loop(computers=computers(period=0.1), **change)


def test_a_component_may_run_on_arrivals_without_a_computer():
    networks = {"bus": Network(kind="can", bit_rate=500e3, stuffing="none", messages={
        "sensed": Message(connection="sensed", bytes=8, identifier=1, period=0.1)})}  # fmt: skip
    what = system(
        {"plant": continuous(0.1), "filter": Component(fmu="stub", sampling=SamplingOnArrival(on="sensed"))},
        [wire("plant.y", "filter.u", "sensed", loss=0.3), wire("filter.y", "plant.u", "filtered", delay=0.01)],
        networks=networks, seed=2,
    )  # fmt: skip
    found = instants(what)
    samples = [i.time for i in found if i.samples]
    assert 4 < len(samples) < 10
    assert samples == [i.time for i in found for m in i.arrivals if m[0] == 0]
    assert {time % (100 * MS) for time in samples} == {222_000}
    sent = [m[3] for i in found for s in i.samples for m in s.sent]
    assert sent == [time + 10 * MS for time in samples]


def test_a_gateway_between_two_buses_forwards_arrivals():
    def bus(name, period=None):
        message = Message(connection=name, bytes=8, identifier=1, period=period)
        return Network(kind="can", bit_rate=500e3, stuffing="none", messages={name: message})

    what = system(
        {"sensor": continuous(0.1), "gateway": Component(fmu="stub"), "actuator": continuous(0.1)},
        [wire("sensor.y", "gateway.u", "first"), wire("gateway.y", "actuator.u", "second")],
        computers={
            "node": Computer(tasks={"pass": Task(component="gateway", on="first", execution=0.001, deadline=1.0)})
        },
        networks={"one": bus("first", 0.1), "two": bus("second")},
    )
    found = instants(what)
    there = [i.time for i in found for m in i.arrivals if m[0] == 1]
    assert there == [k * 100 * MS + 2 * 222_000 + MS for k in range(10)]
