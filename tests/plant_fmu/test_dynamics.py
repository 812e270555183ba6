"""Wind and actuators against exact solutions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_kit.algebra import ZERO, Vec3
from fmu_kit.rigid_body import Wrench
from orchestration.master.sources import NUMPY
from plant_fmu.dynamics import Actuators, Wind

NO_WRENCH = Wrench(0.0, ZERO)

component = st.floats(-5.0, 5.0)
vectors = st.builds(Vec3, component, component, component)
wrenches = st.builds(Wrench, st.floats(0.0, 30.0), vectors)


def components(wrench: Wrench) -> list[float]:
    return [wrench.thrust, *wrench.torque]


@given(vectors, st.floats(0.1, 3.0), st.floats(0.0, 100.0))
def test_wind_starts_at_its_amplitude_and_turns_with_its_frequency(amplitude: Vec3, frequency: float, t: float) -> None:
    """A function of f(0) = a with f(x + y) + f(x - y) = 2 f(x) cos ωy, seen over sixths of its period."""
    wind = Wind(amplitude=amplitude, frequency=frequency)
    sixth = math.pi / (3.0 * frequency)  # cos ωy = ½
    assert wind.force(0.0) == amplitude
    both = wind.force(t + sixth) + wind.force(t - sixth)
    assert list(both) == pytest.approx(list(wind.force(t)), rel=0.0, abs=1e-11)
    assert list(wind.force(1.5 * sixth)) == pytest.approx([0.0] * 3, abs=1e-14)


def test_wind_of_the_paper() -> None:
    """0.01 N on each axis, 0.1 rad/s."""
    assert list(Wind().force(0.0)) == [0.01, 0.01, 0.01]
    assert list(Wind().force(5.0 * math.pi)) == pytest.approx([0.0] * 3, abs=1e-15)
    times = np.array([0.0, 1.0, 2.0])
    np.testing.assert_allclose(Wind().force(times, NUMPY).y, 0.01 * np.cos(0.1 * times), rtol=1e-15)


ACTUATORS = Actuators(thrust_max=20.0, torque_max=0.5)


@pytest.mark.parametrize(
    ("command", "limited"),
    [
        (Wrench(10.0, Vec3(0.1, -0.2, 0.5)), Wrench(10.0, Vec3(0.1, -0.2, 0.5))),
        (Wrench(-1.0, Vec3(0.6, -0.7, 0.0)), Wrench(0.0, Vec3(0.5, -0.5, 0.0))),
        (Wrench(20.1, Vec3(1e300, -1e300, 0.5000001)), Wrench(20.0, Vec3(0.5, -0.5, 0.5))),
        (Wrench(0.0, ZERO), Wrench(0.0, ZERO)),
    ],
)
def test_limits_cut_thrust_and_each_torque(command: Wrench, limited: Wrench) -> None:
    assert ACTUATORS.limited(command) == limited


def test_defaults_limit_and_delay_nothing_that_flies() -> None:
    command = Wrench(12.0, Vec3(143.0, -22.0, 8.0))
    assert Actuators().limited(command) == command
    assert Actuators().response(NO_WRENCH, command, 1e-9) == command


@given(wrenches, wrenches, st.floats(1e-3, 1.0), st.floats(0.0, 1.0))
def test_lag_solves_its_equation(start: Wrench, target: Wrench, time_constant: float, elapsed: float) -> None:
    """From the start on, dx/dt = (target - x) / time_constant, by the central difference."""
    lag, h = Actuators(time_constant=time_constant), 1e-4 * time_constant
    before, now, after = (lag.response(start, target, elapsed + step) for step in (-h, 0.0, h))
    for a, x, b, goal in zip(*(components(wrench) for wrench in (before, now, after, target))):
        assert (b - a) / 2e-4 == pytest.approx(goal - x, rel=1e-6, abs=1e-8)
    assert components(lag.response(start, target, 0.0)) == pytest.approx(components(start), rel=1e-15, abs=1e-14)


@given(wrenches, wrenches, st.floats(1e-3, 1.0), st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_lag_over_two_times_is_the_lag_over_their_sum(
    start: Wrench, target: Wrench, time_constant: float, first: float, second: float
) -> None:
    lag = Actuators(time_constant=time_constant)
    there = lag.response(lag.response(start, target, first), target, second)
    at_once = lag.response(start, target, first + second)
    assert there.thrust == pytest.approx(at_once.thrust, abs=1e-12)
    assert list(there.torque) == pytest.approx(list(at_once.torque), abs=1e-12)


@pytest.mark.parametrize("time_constant", [1e-6, 1e-300, 5e-324])
def test_lag_much_faster_than_the_step_has_arrived(time_constant: float) -> None:
    target = Wrench(12.0, Vec3(1.0, 2.0, 3.0))
    assert Actuators(time_constant=time_constant).response(NO_WRENCH, target, 0.01) == target
    assert Actuators(time_constant=time_constant).response(NO_WRENCH, target, 0.0).thrust == 0.0
