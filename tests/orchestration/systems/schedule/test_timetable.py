"""The timetable of any system."""

from fractions import Fraction

import pytest

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import Grid, exact_nanoseconds
from orchestration.systems.schedule import instant_arrays
from orchestration.systems.schedule.common_timetable import CommonTimetable
from orchestration.systems.schedule.instant_arrays import Cursor
from orchestration.systems.schedule.plan import MAX_TIME, FixedStep
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.connection import Source
from orchestration.systems.system.paths import changed
from tests.orchestration.simulation.engines.stubs import continuous, sampled, system, wire

MS = 1_000_000


def instants(what, fixed=None):
    return list(Cursor(Timetable(what, Streams(what.seed), fixed)).instants())


def loop(sampling, **keys):
    return system(
        {"plant": continuous(0.1), "controller": sampling},
        [wire("plant.y", "controller.y", "measurement", **keys.pop("measurement", {})),
         wire("controller.u", "plant.u", "command", **keys.pop("command", {}))],
        **keys,
    )  # fmt: skip


def test_instants_are_points_samples_arrivals_and_the_end():
    found = instants(loop(sampled(0.25), command={"delay": 0.03}, stop_time=0.5))
    assert [i.time // MS for i in found] == [0, 30, 100, 200, 250, 280, 300, 400, 500]
    assert [i.time // MS for i in found if i.samples] == [0, 250]  # none at the end
    assert [i.time // MS for i in found if i.arrivals] == [30, 280]


def test_systems_that_differ_in_samples_only_share_their_regular_instants():
    one, other, finer = (
        CommonTimetable(changed(loop(sampled(0.25), stop_time=0.5), {path: value}), {}).regular(0, 200 * MS)
        for path, value in (
            ("components.controller.sampling.period", 0.2),
            ("connections.command.delay", 0.03),
            ("components.plant.step", 0.05),
        )
    )
    assert one is other
    assert (len(one), len(finer)) == (2, 4)


def test_a_component_is_stepped_only_to_its_own_events():
    what = system(
        {"fast": continuous(0.1), "slow": continuous(0.5), "reader": sampled(0.25)},
        [wire("fast.y", "reader.y")],
        stop_time=1.0,
    )
    stepped = {i.time // MS: i.stepped for i in instants(what)}
    assert stepped[250] == [0]
    assert [time for time, which in stepped.items() if 1 in which] == [0, 500, 1000]


def test_a_late_measurement_is_taken_before_its_sample():
    found = instants(loop(sampled(0.2), measurement={"delay": 0.03}, stop_time=0.5))
    taken = [(i.time // MS, [arrival // MS for *_, arrival in i.measured]) for i in found if i.measured]
    assert taken == [(0, [0]), (170, [200]), (370, [400])]


def test_a_delay_of_measurements_longer_than_periods_is_the_same():
    found = instants(loop(sampled(0.1), measurement={"delay": 0.25}, stop_time=1.0))
    taken = [(sent // MS, arrival // MS) for i in found for _, _, sent, arrival in i.measured]
    assert taken[:3] == [(0, 0), (0, 100), (0, 200)]
    assert taken[3:] == [(50 + 100 * k, 300 + 100 * k) for k in range(10)]  # also for samples beyond the end
    received = [[sent // MS for _, _, sent, _ in due.received] for i in found for due in i.samples]
    assert received[:4] == [[0], [0], [0], [50]]


def test_messages_never_overtake():
    found = instants(loop(sampled(0.01), command={"delay_jitter": 0.1}, stop_time=2.0, seed=4))
    arrivals = [arrival for i in found for due in i.samples for *_, arrival in due.sent]
    assert arrivals == sorted(arrivals)
    assert len(set(arrivals)) < len(arrivals)  # some wait for the one before


def test_in_jacobi_order_a_command_goes_out_with_the_next_sample():
    found = instants(loop(sampled(0.2), command={"order": "jacobi"}, stop_time=0.5))
    assert [(i.time // MS, sent // MS) for i in found for due in i.samples for _, _, sent, _ in due.sent] == [
        (0, 200), (200, 400), (400, 600),
    ]  # fmt: skip


def test_posted_messages_go_out_and_arrive_by_their_senders_and_then_in_the_order_of_the_file():
    ends = ("b.y", "a.u"), ("a.y", "b.u"), ("b.y", "a.v"), ("a.y", "b.v")
    what = system(
        {"a": continuous(0.1), "b": continuous(0.1)},
        [wire(start, end, f"{i}", delay=0.05, noise={"y": 1.0}) for i, (start, end) in enumerate(ends)],
        stop_time=0.3,
    )
    found = instants(what)
    assert [[connection for connection, *_ in i.posted] for i in found if i.posted] == [[1, 3, 0, 2]] * 4
    assert [[connection for connection, *_ in i.arrivals] for i in found if i.arrivals] == [[1, 3, 0, 2]] * 3


@pytest.mark.parametrize("place", ["components.a.step", "sources.wind.period"])
def test_a_time_beyond_the_limit_is_rejected_by_name(place):
    plain = system({"a": continuous(0.1)}, sources={"wind": Source(noise=1.0, period=0.1, to=("a.u",))})
    with pytest.raises(UsageError, match=rf"^{place} = 1e\+300 s: expected less than 1\.15292e\+09 s$"):
        instants(changed(plain, {place: 1e300}))


def test_a_measurement_that_is_late_by_too_many_samples_is_rejected_by_name():
    late = loop(sampled(0.1), measurement={"delay": 1e9})
    line = (
        r"^connections.measurement.delay: is measured 1e\+09 s before a sample of controller, every 0.1 s: expected at"
    )
    with pytest.raises(UsageError, match=line):
        instants(late)
    assert instants(loop(sampled(0.1), command={"delay": 1e9}))


def test_components_that_are_due_together_follow_the_connections():
    what = system({"controller": sampled(), "sensor": sampled()}, [wire("sensor.y", "controller.y")], stop_time=0.15)
    assert [[due.component for due in i.samples] for i in instants(what) if i.samples] == [[1, 0], [1, 0]]


def fixed_plant(moves):
    return {"plant": FixedStep(name="plant", grid=Grid(Fraction(0), exact_nanoseconds(0.1)), moves=moves)}


def test_between_two_points_of_a_fixed_step_is_an_error_that_names_them():
    with pytest.raises(UsageError, match=r"t = 0.25 s .*components.plant.* 0.1 s only: expected 0.2 s or 0.3 s"):
        instants(loop(sampled(0.25)), fixed_plant(False))
    with pytest.raises(UsageError, match=r"arrival over connections\.command"):
        instants(loop(sampled(0.2), command={"delay": 0.03}), fixed_plant(False))


def test_the_error_comes_when_all_instants_before_it_are_past(monkeypatch):
    what = loop(sampled(0.2), command={"delay": 0.03, "loss": 0.5}, stop_time=2.0, seed=5)
    first = next(time for time in instants(what) if time.arrivals).time
    for size in (1, 3, instant_arrays.INSTANTS):
        monkeypatch.setattr(instant_arrays, "INSTANTS", size)
        begun = Cursor(Timetable(what, Streams(what.seed), fixed_plant(False)))
        with pytest.raises(UsageError, match=rf"arrival over connections\.command at t = {first / 1e9:g} s"):
            list(begun.instants())
        assert begun.past == len(range(0, first, 100 * MS))


def test_an_instant_between_two_points_after_the_end_is_no_error():
    late = loop(sampled(0.5), command={"delay": 0.03, "order": "jacobi"}, stop_time=0.5)
    assert len(instants(late, fixed_plant(False))) == 6
    assert len(instants(loop(sampled(0.75), stop_time=0.7), fixed_plant(False))) == 8


@pytest.mark.parametrize("key", ["offset", "period"])
def test_a_sample_in_millions_of_years_is_rejected(key):
    with pytest.raises(UsageError, match=rf"^components\.controller\.sampling\.{key} = 1e\+12 s: expected less"):
        instants(loop(sampled(**{key: 1e12})))


def test_times_up_to_the_longest_are_exact():
    longest = (MAX_TIME - 10**6) / 10**9
    found = instants(loop(sampled(longest, offset=longest), command={"delay": longest, "delay_jitter": longest}))
    assert len(found) == 11
    with pytest.raises(UsageError, match=r"connections\.command\.delay = 2e\+09 s: expected less than 1\.15292e\+09 s"):
        instants(loop(sampled(), command={"delay": 2e9}))


def test_an_aligned_instant_moves_to_the_next_point():
    found = instants(loop(sampled(0.25), command={"delay": 0.03}, stop_time=0.8), fixed_plant(True))
    assert [i.time // MS for i in found for due in i.samples] == [0, 300, 500]
    assert [arrival // MS for i in found for *_, arrival in i.arrivals] == [100, 400, 600]
    assert {i.time // MS % 100 for i in found} == {0}


def test_a_message_between_components_in_continuous_time_leaves_at_the_senders_points():
    what = system(
        {"plant": continuous(0.1), "filter": continuous(0.25)},
        [wire("plant.y", "filter.u", delay=0.03)],
        stop_time=0.3,
    )
    found = instants(what)
    assert [(sent // MS, arrival // MS) for i in found for _, _, sent, arrival in i.posted] == [
        (0, 30), (100, 130), (200, 230), (300, 330),
    ]  # fmt: skip
    assert [i.time // MS for i in found if 1 in i.stepped] == [0, 30, 130, 230, 250, 300]
