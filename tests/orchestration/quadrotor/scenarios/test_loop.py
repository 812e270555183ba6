"""The master over stub simulators: what happens when, without any FMU."""

import itertools
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.basics.times import nanoseconds
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.quadrotor.scenarios.wiring import MEASUREMENT
from orchestration.simulation.engines.sources import ConstantValues
from orchestration.systems.system.choices import Hold
from tests.orchestration.quadrotor.scenarios.strategies import timings
from tests.orchestration.quadrotor.scenarios.stubs import Call, Counting, Feedback, Plant, Still, Straying, StubRun

MS = 1_000_000
FARTHEST, FASTEST = 100.0, 1000.0
"""m from the reference and rad/s, beyond which a flight has diverged"""


def logged(timing: Timing, stop_time: float) -> list[Call]:
    """All calls of a short run, in order."""
    log: list[Call] = []
    StubRun(timing, stop_time, Plant(log=log), Counting(log))
    return log


# -- order ------------------------------------------------------------------------------------------------


def test_the_first_exchange_is_over_before_either_leaves_initialisation() -> None:
    assert logged(Timing(offset=1.0), 0.001)[:11] == [
        ("plant", "enter", 0.0, 0.001),
        ("controller", "enter", 0.0, 0.001),
        ("plant", "read"),
        ("controller", "write", "position.x"),
        ("controller", "read"),
        ("plant", "write", "thrust"),
        ("plant", "exit"),
        ("plant", "read"),
        ("controller", "exit"),
        ("controller", "read"),
        ("plant", "step", 0.0, 0.001),
    ]


def test_at_one_instant_the_plant_is_read_then_the_controller_steps_then_its_command_is_applied() -> None:
    log = logged(Timing(period=0.01, plant_interval=0.01), 0.02)
    assert log[log.index(("plant", "step", 0.0, 0.01)) :] == [
        ("plant", "step", 0.0, 0.01),
        ("plant", "read"),
        ("controller", "write", "position.x"),
        ("controller", "step", 0.01, 0.01),
        ("controller", "read"),
        ("plant", "write", "thrust"),
        ("plant", "step", 0.01, 0.01),
        ("plant", "read"),
    ]


def test_at_time_zero_the_controller_samples_without_a_plant_step() -> None:
    log = logged(Timing(), 0.01)
    assert log.index(("controller", "step", 0.0, 0.01)) < log.index(("plant", "step", 0.0, 0.001))


def test_a_row_is_the_value_just_after_its_instant() -> None:
    run = StubRun(Timing(period=0.002), 0.006)
    assert run.column("plant.thrust").tolist() == [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 3.0]
    assert run.column("controller.thrust").tolist() == [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 3.0]
    assert run.column("plant.position.y").tolist() == run.column("time").tolist()
    assert run.plant.thrusts == [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]


def test_the_first_exchange_is_held_until_the_first_arrival() -> None:
    run = StubRun(Timing(period=0.01, delay=0.0025), 0.01, controller=Feedback())
    before = run.column("plant.thrust")[:3]
    assert before.tolist() == [-4.0 - 0.1] * 3
    assert run.events("arrived")[0].time == 2_500_000


def test_the_first_exchange_is_neither_lost_nor_late_nor_noisy() -> None:
    timing = Timing(
        measurement_loss=1.0, command_loss=1.0, delay=0.05, noise={"position": 1.0}, quantisation={"position": 7.0}
    )
    run = StubRun(timing, 0.02)
    assert run.controller.received[0]["position.x"] == 1.0
    assert run.column("plant.thrust").tolist() == [0.0] * len(run.nanoseconds())


def test_the_first_exchange_is_no_sample() -> None:
    run = StubRun(Timing(offset=0.5), 0.1)
    assert run.all_events() == []
    assert run.controller.steps() == []


# -- holds, arrivals and losses ---------------------------------------------------------------------------


def test_zero_order_hold_keeps_a_command_from_its_arrival_to_the_next() -> None:
    run = StubRun(Timing(period=0.004, delay=0.0025), 0.012)
    expected = {0: 0.0, 2_500_000: 1.0, 6_500_000: 2.0, 10_500_000: 3.0}
    for time, thrust in zip(run.nanoseconds(), run.column("plant.thrust"), strict=True):
        assert thrust == expected[max(start for start in expected if start <= time)]


def test_the_controller_computes_at_its_sample_what_arrives_later() -> None:
    run = StubRun(Timing(period=0.004, delay=0.0025), 0.008)
    at_sample = run.nanoseconds().index(4 * MS)
    assert (run.column("controller.thrust")[at_sample], run.column("plant.thrust")[at_sample]) == (2.0, 1.0)


def test_of_several_arrivals_at_one_instant_the_last_sent_wins() -> None:
    run = StubRun(Timing(period=0.001, plant_interval=0.01, delay_jitter=0.02), 0.2, seed=3)
    together = [list(group) for _, group in itertools.groupby(run.events("arrived"), key=lambda event: event.time)]
    assert max(map(len, together)) > 2
    times, thrust = run.nanoseconds(), run.column("plant.thrust")
    for group in together:
        assert thrust[times.index(group[0].time)] == 1 + max(event.sample for event in group)


def test_a_lost_command_leaves_the_one_before_in_place() -> None:
    run = StubRun(Timing(period=0.002, command_loss=0.5), 0.2, seed=1)
    lost = {event.sample for event in run.events("lost", "command")}
    assert 20 < len(lost) < 80
    applied = 0.0
    for event in run.events("sampled"):
        applied = applied if event.sample in lost else 1.0 + event.sample
        assert run.column("plant.thrust")[run.nanoseconds().index(event.time)] == applied


def test_the_controller_still_runs_when_its_command_is_lost() -> None:
    run = StubRun(Timing(command_loss=1.0), 0.1)
    assert run.column("controller.thrust")[-1] == 10.0
    assert not run.column("plant.thrust").any()
    assert len(run.events("lost", "command")) == len(run.events("sent", "command")) == 10
    assert run.events("arrived") == []


def test_a_lost_measurement_leaves_the_controller_with_the_last_it_received() -> None:
    run = StubRun(Timing(period=0.002, measurement_loss=0.5), 0.2, seed=1)
    lost = {event.sample for event in run.events("lost", "measurement")}
    assert 20 < len(lost) < 80
    known = run.controller.received[0]["position.y"]
    for k, received in enumerate(run.controller.received[1:]):
        known = known if k in lost else k * 0.002
        assert received["position.y"] == pytest.approx(known, abs=1e-15)
    assert len(run.controller.received) == 101  # it ran at every sample


def test_first_order_hold_follows_the_line_through_the_last_two_commands() -> None:
    run = StubRun(Timing(period=0.004, hold="first"), 0.012)
    # thrust 1 at 0 ms, 2 at 4 ms, 3 at 8 ms: a slope of 1 per 4 ms from the second arrival on
    assert run.column("plant.thrust").tolist() == pytest.approx([1, 1, 1, 1, 2, 2.25, 2.5, 2.75, 3, 3.25, 3.5, 3.75, 4])


def test_first_order_hold_spans_lost_commands() -> None:
    run = StubRun(Timing(period=0.002, hold="first", command_loss=0.5), 0.1, seed=4)
    times = np.array(run.nanoseconds())
    arrived = [(event.time, 1.0 + event.sample) for event in run.events("arrived")]
    for (t0, a), (t1, b), (end, _) in zip(arrived, arrived[1:], arrived[2:], strict=False):
        between = (times >= t1) & (times < end)
        line = b + (times[between] - t1) / (t1 - t0) * (b - a)
        assert run.column("plant.thrust")[between] == pytest.approx(line)


def test_first_order_hold_is_held_over_each_plant_step() -> None:
    run = StubRun(Timing(period=0.004, plant_interval=0.0015, hold="first"), 0.05)
    assert run.plant.thrusts == run.column("plant.thrust")[:-1].tolist()


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_a_row_holds_what_acts_until_the_next(hold: Hold) -> None:
    timing = Timing(period=0.003, delay=0.001, delay_jitter=0.004, jitter=0.001, command_loss=0.2, hold=hold)
    run = StubRun(timing, 0.2, controller=Feedback())
    assert run.plant.thrusts == run.column("plant.thrust")[:-1].tolist()


@pytest.mark.parametrize("period", [0.01, 0.016, 0.0375])
def test_a_delay_of_one_period_is_jacobi_order_to_the_bit(period: float) -> None:
    delayed = StubRun(Timing(period=period, plant_interval=period, delay=period), 1.0, controller=Feedback())
    jacobi = StubRun(Timing(period=period, plant_interval=period, order="jacobi"), 1.0, controller=Feedback())
    assert delayed.bits()[0] == jacobi.bits()[0]
    assert delayed.events("arrived") == jacobi.events("arrived")


def test_jacobi_order_differs_from_gauss_seidel() -> None:
    jacobi, gauss_seidel = (
        StubRun(Timing(order=order), 0.1, controller=Feedback()) for order in ("jacobi", "gauss-seidel")
    )
    assert jacobi.bits()[0] != gauss_seidel.bits()[0]


def test_a_jacobi_command_is_applied_at_the_next_sample_plus_the_delay() -> None:
    run = StubRun(Timing(period=0.004, order="jacobi", delay=0.001), 0.02)
    assert [(e.time, e.sample) for e in run.events("arrived")] == [((4 * k + 5) * MS, k) for k in range(4)]


# -- steps ------------------------------------------------------------------------------------------------


@given(timings(), st.integers(1, 20))
def test_the_plant_is_stepped_from_row_to_row_over_exactly_the_horizon(timing: Timing, periods: int) -> None:
    run = StubRun(timing, periods * timing.period, Still())
    times = run.nanoseconds()
    assert run.plant.steps() == [(a / 1e9, (b - a) / 1e9) for a, b in itertools.pairwise(times)]
    assert sum(round(h * 1e9) for _, h in run.plant.steps()) == times[-1] - times[0]
    assert (times[0], times[-1]) == (0, nanoseconds(periods * timing.period))
    assert run.master.running.steps == len(times) - 1


@given(timings(clock_ratio=1.0), st.integers(1, 20))
def test_the_controller_is_stepped_from_its_first_sample_to_exactly_the_end(timing: Timing, periods: int) -> None:
    run = StubRun(timing, periods * timing.period, Still())
    stop = run.nanoseconds()[-1]
    sampled = [event.time for event in run.events("sampled")]
    ends = [*sampled[1:], stop]
    assert run.controller.steps() == [(a / 1e9, (b - a) / 1e9) for a, b in zip(sampled, ends, strict=bool(sampled))]


def test_the_controller_is_not_stepped_at_stop() -> None:
    run = StubRun(Timing(period=0.01), 0.05)
    assert [t for t, _ in run.controller.steps()] == [0.0, 0.01, 0.02, 0.03, 0.04]
    assert run.column("controller.thrust")[-1] == 5.0


def test_a_command_that_arrives_at_stop_is_applied_and_recorded() -> None:
    run = StubRun(Timing(period=0.01, delay=0.01), 0.05)
    assert run.column("plant.thrust")[-1] == 5.0
    assert run.events("arrived")[-1].time == 50 * MS


@pytest.mark.parametrize("ratio", [0.5, 1.25, 0.99])
def test_the_clock_ratio_scales_the_times_of_the_controllers_steps(ratio: float) -> None:
    run = StubRun(Timing(period=0.01, clock_ratio=ratio), 0.1)
    samples = [event.time for event in run.events("sampled")]
    assert len(samples) == math.ceil(0.1 * ratio / 0.01 - 1e-9)
    for k, (t, h) in enumerate(run.controller.steps()):
        assert t == pytest.approx(k * 0.01, abs=2e-9)
        assert h == pytest.approx(min(0.01, 0.1 * ratio - t), abs=2e-9)
    assert sum(h for _, h in run.plant.steps()) == pytest.approx(0.1, abs=1e-15)


def test_with_the_fmus_clock_the_controller_is_stepped_at_every_plant_point() -> None:
    run = StubRun(Timing(period=0.01, clock="fmu"), 0.03)
    assert run.controller.steps() == run.plant.steps()
    assert len(run.events("sampled")) == 3


def test_times_are_nanoseconds_divided_once() -> None:
    run = StubRun(Timing(period=1 / 30, plant_interval=1 / 700), 0.5)
    assert all(t == ns / 1e9 for t, ns in zip(run.column("time"), run.nanoseconds(), strict=True))
    assert run.nanoseconds() == sorted(
        {*(round(k * 1e9 / 700) for k in range(351)), *(round(k * 1e9 / 30) for k in range(16))}
    )


# -- events -----------------------------------------------------------------------------------------------


@given(timings(), st.integers(1, 20))
def test_every_sample_is_sent_and_then_arrives_or_is_lost_or_is_still_on_its_way(timing: Timing, periods: int) -> None:
    run = StubRun(timing, periods * timing.period, Still())
    stop = run.nanoseconds()[-1]
    sampled = {event.sample for event in run.events("sampled")}
    sent = {event.sample: event.time for event in run.events("sent")}
    assert sampled - sent.keys() <= {max(sampled, default=0)}  # in Jacobi order the last may go out after the end
    lost = {event.sample for event in run.events("lost", "command")}
    arrived = {event.sample for event in run.events("arrived")}
    assert not lost & arrived
    assert lost | arrived <= sampled
    late = timing.delay + timing.delay_jitter + 2 * timing.period / timing.clock_ratio + timing.jitter
    assert all(sent[k] >= stop - late * 1e9 for k in sent.keys() - lost - arrived)


def test_events_name_what_they_are_about() -> None:
    run = StubRun(Timing(period=0.01, delay=0.002), 0.005)
    assert [tuple(event) for event in run.all_events()] == [
        (0, "sampled", "measurement", 0),
        (0, "sent", "command", 0),
        (2 * MS, "arrived", "command", 0),
    ]


# -- divergence -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "sudden",
    [
        {"position__x": FARTHEST + 0.1},
        {"position__y": 80.0, "position__z": -80.0},
        {"angular_velocity__z": -FASTEST - 1.0},
        {"angular_velocity__x": 800.0, "angular_velocity__y": 800.0},
        {"position__z": math.nan},
        {"position__x": math.inf},
        {"angular_velocity__y": math.nan},
        {"angular_velocity__x": -math.inf},
    ],
    ids=str,
)
def test_leaving_the_region_ends_the_run_with_its_time(sudden: dict[str, Any]) -> None:
    plant = Straying(time=0.012, **sudden)
    run = StubRun(Timing(period=0.01), 0.1, plant)
    assert run.over is True
    assert run.master.divergence_time == 12 * MS
    assert "expected a" in str(run.master.divergence)
    assert run.nanoseconds() == [k * MS for k in range(12)]  # what diverged is not recorded
    assert np.isfinite(run.rows()).all()
    assert run.plant.steps()[-1] == (0.011, 0.001)


def test_divergence_at_a_sampling_instant_is_noticed_before_the_controller_hears_of_it() -> None:
    plant = Straying(time=0.01, position__x=math.nan)
    run = StubRun(Timing(period=0.01), 0.1, plant)
    assert run.master.divergence_time == 10 * MS
    assert len(run.controller.steps()) == 1


@pytest.mark.parametrize("loss", [0.0, 1.0])
def test_in_jacobi_order_nothing_is_sent_or_lost_after_a_run_has_diverged(loss: float) -> None:
    run = StubRun(Timing(order="jacobi", command_loss=loss), 0.1, Straying(time=0.012, position__x=math.nan))
    assert run.events("sampled")[-1].time == 10 * MS
    assert max(event[0] for event in run.all_events()) == 10 * MS < (run.master.divergence_time or 0)


def test_a_state_just_inside_the_region_does_not_diverge() -> None:
    plant = Straying(time=0.012, position__x=60.0, position__y=79.9, position__z=0.0, angular_velocity__z=FASTEST)
    run = StubRun(Timing(period=0.01), 0.05, plant)
    assert run.master.divergence is None
    assert run.nanoseconds()[-1] == 50 * MS


def test_the_distance_is_that_to_the_reference() -> None:
    far = ConstantValues([300.0, 0.0, 0.0])
    plant = Straying(**{})
    plant.values["position.x"] = 250.0
    assert StubRun(Timing(), 0.05, plant, reference=far).master.divergence is None
    assert StubRun(Timing(), 0.05, Plant(), reference=far).master.divergence is not None


@pytest.mark.parametrize("side", ["plant", "controller"])
def test_a_simulator_that_reports_divergence_ends_the_run_with_its_time(side: str) -> None:
    error = SimulatorError("state not finite", divergence=True)
    run = StubRun(Timing(), 0.1, Straying(time=0.012, error=error) if side == "plant" else None, failing(side, error))
    assert run.over is True
    at = 12 if side == "plant" else 10
    assert run.master.divergence == f"state not finite, at t = {at / 1000:g} s"
    assert run.master.divergence_time == at * MS
    assert len(run.nanoseconds()) == at


def failing(side: str, error: SimulatorError) -> Counting:
    class Failing(Counting):
        def advance(self, t: float, h: float) -> None:
            super().advance(t, h)
            if t >= 0.01 and side == "controller":
                raise error

    return Failing()


@pytest.mark.parametrize("side", ["plant", "controller"])
def test_any_other_failure_of_a_simulator_is_an_error(side: str) -> None:
    error = SimulatorError("mass = -1: expected more")
    plant = Straying(time=0.012, error=error) if side == "plant" else None
    with pytest.raises(SimulatorError, match="expected more"):
        StubRun(Timing(), 0.1, plant, failing(side, error))


def test_divergence_at_initialisation_is_a_run_of_one_row() -> None:
    class Hopeless(Counting):
        def exit_initialization(self) -> None:
            raise SimulatorError("no desired attitude", divergence=True)

    run = StubRun(Timing(), 0.1, controller=Hopeless())
    assert run.over is True
    assert (run.master.divergence, run.master.divergence_time) == ("no desired attitude", 0)
    assert run.nanoseconds() == [0]
    assert run.plant.steps() == []


def test_any_other_failure_at_initialisation_is_an_error() -> None:
    class Refusing(Counting):
        def enter_initialization(self, start: float, stop: float) -> None:
            raise SimulatorError("wrong phase")

    with pytest.raises(SimulatorError, match="wrong phase"):
        StubRun(Timing(), 0.1, controller=Refusing())


# -- pause and restore ------------------------------------------------------------------------------------

EVERYTHING: dict[str, Any] = {
    "period": 0.003,
    "delay": 0.004,
    "delay_jitter": 0.003,
    "jitter": 0.001,
    "measurement_loss": 0.2,
    "command_loss": 0.2,
    "burst_length": 2.0,
    "noise": {"position": 0.01, "velocity.x": 0.1},
    "quantisation": {"velocity": 0.05},
}


def everything(**changes: Any) -> StubRun:
    return StubRun(Timing(**{**EVERYTHING, **changes}), 0.05, controller=Feedback(), seed=11, start=False)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("order", ["gauss-seidel", "jacobi"])
def test_a_run_restored_at_any_pause_goes_on_to_the_same_bits(hold: str, order: str) -> None:
    whole = everything(hold=hold, order=order)
    whole.master.initialise()
    assert whole.master.run()
    for pause_at in range(0, 48 * MS, 1_700_000):
        paused, resumed = (everything(hold=hold, order=order) for _ in range(2))
        paused.master.initialise()
        assert not paused.master.run(pause_at=pause_at)
        resumed.master.restore(*paused.state())
        assert resumed.master.run()
        assert resumed.bits() == whole.bits()
        assert resumed.master.running.steps == whole.master.running.steps


def test_a_run_paused_again_and_again_is_the_same_run() -> None:
    whole, hopping = everything(), everything()
    for run in (whole, hopping):
        run.master.initialise()
    whole.master.run()
    while not hopping.master.run(pause_at=hopping.master.running.now + 2 * MS):
        state = hopping.state()
        hopping = everything()
        hopping.master.restore(*state)
    assert hopping.bits() == whole.bits()


def test_a_paused_master_itself_goes_on_to_the_same_bits() -> None:
    whole, paused = everything(), everything()
    for run in (whole, paused):
        run.master.initialise()
    whole.master.run()
    assert not paused.master.run(pause_at=20 * MS)
    assert paused.master.run()
    assert paused.bits() == whole.bits()


def test_a_pause_is_at_the_first_instant_from_the_time_given() -> None:
    run = everything(jitter=0.0, delay_jitter=0.0)
    run.master.initialise()
    assert not run.master.run(pause_at=10_500_000)
    assert run.master.running.now == 11 * MS
    assert run.nanoseconds()[-1] == 11 * MS


def test_a_pause_at_or_beyond_the_end_is_none() -> None:
    for pause_at in (50 * MS, 90 * MS):
        run = everything()
        run.master.initialise()
        assert run.master.run(pause_at=pause_at)


def test_the_state_beside_what_is_saved_as_bytes_is_json() -> None:
    run = everything()
    run.master.initialise()
    run.master.run(pause_at=20 * MS)
    state, saved = run.state()
    resumed = everything()
    resumed.master.restore(json.loads(json.dumps(state)), saved)
    resumed.master.run()
    run.master.run()
    assert resumed.bits() == run.bits()


def test_progress_ends_at_one_and_never_falls() -> None:
    heard: list[float] = []
    run = StubRun(Timing(), 2.0, start=False)
    run.master.initialise()
    run.master.run(progress=heard.append)
    assert heard == sorted(heard)
    assert len(heard) > 2
    assert heard[-1] == 1.0


# -- noise and quantisation -------------------------------------------------------------------------------

DISTURBANCES = [{"noise": {"position.x": 0.1}}, {"quantisation": {"position.x": 0.3}}]


@pytest.mark.parametrize("disturbance", DISTURBANCES, ids=str)
def test_noise_and_quantisation_leave_the_plant_untouched(disturbance: dict[str, Any]) -> None:
    plain, disturbed = StubRun(Timing(), 0.2), StubRun(Timing(**disturbance), 0.2)
    assert disturbed.bits() == plain.bits()  # this controller ignores what it receives
    received = [[received["position.x"] for received in run.controller.received[1:]] for run in (plain, disturbed)]
    assert sum(a != b for a, b in zip(*received, strict=True)) > 15


@pytest.mark.parametrize("disturbance", DISTURBANCES, ids=str)
def test_noise_and_quantisation_touch_only_the_measurements_named(disturbance: dict[str, Any]) -> None:
    plain, disturbed = StubRun(Timing(), 0.2), StubRun(Timing(**disturbance), 0.2)
    for one, other in zip(plain.controller.received, disturbed.controller.received, strict=True):
        assert {n: v for n, v in one.items() if n != "position.x"} == {
            n: v for n, v in other.items() if n != "position.x"
        }


def test_quantised_measurements_are_the_nearest_multiples_of_the_quantum() -> None:
    run = StubRun(Timing(quantisation={"position": 0.3}), 2.0)
    true = run.column("plant.position.x")[::10]
    for received, x in zip(run.controller.received[1:], true, strict=False):
        assert received["position.x"] == pytest.approx(round(received["position.x"] / 0.3) * 0.3)
        assert abs(received["position.x"] - x) <= 0.15 + 1e-12


def test_noise_has_its_standard_deviation_and_no_mean() -> None:
    run = StubRun(Timing(period=0.001, noise={"position": 0.2}), 4.0, Still())
    true = np.column_stack([run.column(f"plant.{name}") for name in MEASUREMENT[:3]])[:-1]
    received = np.array([[received[name] for name in MEASUREMENT[:3]] for received in run.controller.received[1:]])
    error = (received - true).ravel()
    assert abs(error.mean()) < 5 * 0.2 / math.sqrt(len(error))
    assert error.std() == pytest.approx(0.2, rel=0.03)
    correlation = np.corrcoef((received - true).T) - np.eye(3)
    assert np.abs(correlation).max() < 0.08


def test_noise_on_one_measurement_is_the_same_with_or_without_noise_on_another() -> None:
    one = StubRun(Timing(noise={"position": 0.1}), 0.2)
    both = StubRun(Timing(noise={"position": 0.1, "velocity": 3.0}), 0.2)
    for a, b in zip(one.controller.received, both.controller.received, strict=True):
        assert a["position.x"] == b["position.x"]


def test_a_measurement_that_is_rounded_is_noisy_first() -> None:
    run = StubRun(Timing(noise={"position": 0.5}, quantisation={"position": 0.25}), 0.5)
    received = [received["position.z"] for received in run.controller.received[1:]]
    assert all(value == round(value / 0.25) * 0.25 for value in received)
    assert len(set(received)) > 4
