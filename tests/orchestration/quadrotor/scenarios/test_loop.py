"""The master over stub simulators, without any FMU; `systems/schedule/test_second_clock.py` has what happens when."""

import json
import math
from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.errors import SimulatorError
from orchestration.quadrotor.scenarios.timing import Timing
from orchestration.quadrotor.scenarios.wiring import MEASUREMENT
from orchestration.simulation.engines.sources import ConstantValues
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


@pytest.mark.parametrize("period", [0.01, 0.016, 0.0375])
def test_a_delay_of_one_period_is_jacobi_order_to_the_bit(period: float) -> None:
    delayed = StubRun(Timing(period=period, plant_interval=period, delay=period), 1.0, controller=Feedback())
    jacobi = StubRun(Timing(period=period, plant_interval=period, order="jacobi"), 1.0, controller=Feedback())
    assert delayed.bits()[0] == jacobi.bits()[0]
    assert delayed.events("arrived") == jacobi.events("arrived")


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


# -- noise -------------------------------------------------------------------------------


def test_noise_has_its_standard_deviation_and_no_mean() -> None:
    run = StubRun(Timing(period=0.001, noise={"position": 0.2}), 4.0, Still())
    true = np.column_stack([run.column(f"plant.{name}") for name in MEASUREMENT[:3]])[:-1]
    received = np.array([[received[name] for name in MEASUREMENT[:3]] for received in run.controller.received[1:]])
    error = (received - true).ravel()
    assert abs(error.mean()) < 5 * 0.2 / math.sqrt(len(error))
    assert error.std() == pytest.approx(0.2, rel=0.03)
    correlation = np.corrcoef((received - true).T) - np.eye(3)
    assert np.abs(correlation).max() < 0.08
