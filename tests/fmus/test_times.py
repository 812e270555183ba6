"""Steps follow on one another, none ends past the stop time, and a run ends once."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from tests.fmus.instance import Instance

ALL = ("QuadrotorPlant", "UnifiedController")


@pytest.fixture(params=ALL)
def it(built: dict[str, Path], request: pytest.FixtureRequest) -> Instance:
    """One freshly instantiated; not freed, as calls to it fail."""
    return Instance(built[request.param])


def begin(it: Instance, *, start: float = 0.0, stop: float | None = None) -> None:
    it.fmu.setupExperiment(startTime=start, stopTime=stop)
    it.fmu.enterInitializationMode()
    it.fmu.exitInitializationMode()


def assert_refused(it: Instance, call: Callable[..., object], *given: float, text: str) -> None:
    with pytest.raises(FMICallException):
        call(*given)
    assert text in it.messages[-1].text


@pytest.mark.parametrize("t", [0.0, 0.015, 0.0100001, 1.0])
def test_a_step_begins_where_the_last_one_ended(it: Instance, t: float) -> None:
    begin(it)
    it.step(0.0, 0.01)
    assert_refused(
        it, it.step, t, 0.01, text=f"currentCommunicationPoint = {t}: expected 0.01, where the last step ended"
    )


def test_a_master_may_add_up_times_or_round_them(it: Instance) -> None:
    begin(it, stop=1.0)
    t = 0.0
    for k in range(1000):
        it.step(round(0.001 * k, 9) if k % 2 else t + 1e-12, 0.001)
        t += 0.001


@pytest.mark.parametrize("start", [-1.0, 1e6])
def test_times_are_as_exact_as_numbers_of_their_size(it: Instance, start: float) -> None:
    begin(it, start=start, stop=start + 2.0)
    for k in range(20):
        it.step(start + 0.1 * k, 0.1)


def test_no_step_ends_past_the_stop_time(it: Instance) -> None:
    begin(it, stop=0.02)
    it.step(0.0, 0.01)
    it.step(0.01, 0.01 * (1.0 + 1e-12))
    assert_refused(
        it, it.step, 0.02, 0.001, text="communicationStepSize = 0.001 from 0.02: expected no step past stopTime = 0.02"
    )


def test_the_last_step_may_not_reach_over_the_stop_time(it: Instance) -> None:
    begin(it, stop=0.025)
    it.step(0.0, 0.01)
    it.step(0.01, 0.01)
    assert_refused(it, it.step, 0.02, 0.01, text="expected no step past stopTime = 0.025")


def test_without_a_stop_time_there_is_no_end(it: Instance) -> None:
    begin(it)
    for k in range(32):
        it.step(float(k), 1.0)


@pytest.mark.parametrize("stop", [1.0, -1.0, math.nan])
def test_a_run_does_not_stop_before_it_starts(it: Instance, stop: float) -> None:
    def setup(stop: float) -> None:
        it.fmu.setupExperiment(startTime=2.0, stopTime=stop)

    assert_refused(it, setup, stop, text=f"stopTime = {stop}: expected a time not before startTime = 2.0")


def test_a_restored_state_goes_on_from_its_own_time(it: Instance) -> None:
    begin(it, stop=0.03)
    it.step(0.0, 0.01)
    state = it.save()
    it.step(0.01, 0.01)
    it.restore(state)
    it.step(0.01, 0.02)
    it.restore(state)
    assert_refused(it, it.step, 0.03, 0.01, text="expected 0.01, where the last step ended")


def test_a_restored_state_stops_when_it_was_to_stop(it: Instance, built: dict[str, Path]) -> None:
    begin(it, stop=0.02)
    it.step(0.0, 0.01)
    other = Instance(built[it.description.modelName])
    other.restore(it.save())
    assert_refused(other, other.step, 0.01, 0.02, text="expected no step past stopTime = 0.02")


def test_a_reset_begins_anew(it: Instance) -> None:
    begin(it, stop=0.01)
    it.step(0.0, 0.01)
    it.fmu.reset()
    begin(it, start=5.0)
    it.step(5.0, 0.01)


def test_a_run_ends_once(it: Instance) -> None:
    begin(it)
    it.step(0.0, 0.01)
    it.fmu.terminate()
    assert_refused(it, it.fmu.terminate, text="fmi2Terminate in phase terminated: expected phase stepping")


@pytest.mark.parametrize("place", np.linspace(0.0, 1.0, 5))
def test_a_flipped_bit_is_no_other_state(it: Instance, built: dict[str, Path], place: float) -> None:
    """Wherever it is: each place is tried in another instance, as the call fails."""
    begin(it)
    it.step(0.0, 0.01)
    content = bytearray(it.save())
    content[round(place * (len(content) - 1))] ^= 0x01
    with pytest.raises(FMICallException):
        it.restore(bytes(content))
    assert "FMU state" in it.messages[-1].text
