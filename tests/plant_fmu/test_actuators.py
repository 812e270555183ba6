"""Limits, motors and their lag against exact solutions and against the moments of four forces."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_kit.algebra import ZERO, Vec3
from fmu_kit.rigid_body import Wrench
from plant_fmu.actuators import Actuators, Box, Channels, Motors

component = st.floats(-5.0, 5.0)
vectors = st.builds(Vec3, component, component, component)
wrenches = st.builds(Wrench, st.floats(0.0, 30.0), vectors)
channels = st.builds(Channels, component, component, component, component)
spans, time_constants = st.floats(0.0, 0.5), st.floats(1e-3, 1.0)

FREE = Motors(thrust_max=1e9, thrust_min=-1e9, arm_x=0.075, arm_y=0.1, drag_to_thrust=0.022)
"""Motors that nothing limits, on a frame that is longer than wide"""
PLACES = {"front right": (1, 1), "rear left": (-1, -1), "front left": (1, -1), "rear right": (-1, 1)}
ANTICLOCKWISE = ("front right", "rear left")


def components(wrench: Wrench) -> list[float]:
    return [wrench.thrust, *wrench.torque]


@pytest.mark.parametrize(
    ("command", "limited"),
    [
        (Wrench(10.0, Vec3(0.1, -0.2, 0.5)), Wrench(10.0, Vec3(0.1, -0.2, 0.5))),
        (Wrench(-1.0, Vec3(0.6, -0.7, 0.0)), Wrench(0.0, Vec3(0.5, -0.5, 0.0))),
        (Wrench(20.1, Vec3(1e300, -1e300, 0.5000001)), Wrench(20.0, Vec3(0.5, -0.5, 0.5))),
        (Wrench(0.0, ZERO), Wrench(0.0, ZERO)),
    ],
)
def test_the_box_cuts_thrust_and_each_torque(command: Wrench, limited: Wrench) -> None:
    assert Box(thrust_max=20.0, torque_max=0.5).limited(command) == limited


@pytest.mark.parametrize(("thrust", "limited"), [(-30.0, -5.0), (-4.0, -4.0), (12.0, 12.0), (30.0, 20.0)])
def test_the_least_thrust_of_the_box_may_be_negative(thrust: float, limited: float) -> None:
    assert Box(thrust_max=20.0, thrust_min=-5.0).limited(Wrench(thrust, ZERO)) == Wrench(limited, ZERO)


def test_defaults_limit_and_delay_nothing_that_flies() -> None:
    command, ideal = Wrench(12.0, Vec3(143.0, -22.0, 8.0)), Actuators()
    target = ideal.limited(command)
    assert ideal.wrench(target) == command
    assert ideal.response(Channels(0.0, 0.0, 0.0, 0.0), target, 1e-9) == target


def thrusts_and_moments(motors: Motors, thrusts: Channels) -> list[float]:
    """Thrust and torques of four forces along -z at the places of the motors, r × F, and of the propellers' drag."""
    total, moment = 0.0, np.zeros(3)
    for (name, (x, y)), thrust in zip(PLACES.items(), thrusts, strict=True):
        drag = motors.drag_to_thrust * thrust * (1 if name in ANTICLOCKWISE else -1)  # against the propeller's turn
        arm, force = np.array([x * motors.arm_x, y * motors.arm_y, 0.0]), np.array([0.0, 0.0, -thrust])
        moment += np.cross(arm, force) + np.array([0.0, 0.0, drag])
        total += thrust
    return [total, *moment]


@given(channels)
def test_motors_exert_the_moments_of_their_forces_and_drags(thrusts: Channels) -> None:
    assert components(FREE.wrench(thrusts)) == pytest.approx(thrusts_and_moments(FREE, thrusts), abs=1e-14)


@given(wrenches)
def test_allocation_is_the_inverse_of_what_the_motors_exert(command: Wrench) -> None:
    matrix = np.column_stack([thrusts_and_moments(FREE, Channels(*unit)) for unit in np.eye(4)])
    thrusts = FREE.limited(command)
    assert list(thrusts) == pytest.approx(np.linalg.solve(matrix, components(command)), rel=1e-12, abs=1e-11)
    assert components(FREE.wrench(thrusts)) == pytest.approx(components(command), abs=1e-12)


@pytest.mark.parametrize(
    ("command", "acting"),
    [
        (Wrench(8.0, ZERO), Wrench(8.0, ZERO)),
        (Wrench(20.0, ZERO), Wrench(16.0, ZERO)),  # all at their upper limit
        (Wrench(-1.0, ZERO), Wrench(0.4, ZERO)),  # at their lower limit
        # Roll asks for 2 ± 2.5 N: thrust goes down by what the upper limit cuts, up by what the lower one does.
        (Wrench(8.0, Vec3(1.0, 0.0, 0.0)), Wrench(8.2, Vec3(0.78, 0.0, 0.0))),
        # With thrust in need all motors are near the top: roll loses what they lack.
        (Wrench(15.0, Vec3(0.4, 0.0, 0.0)), Wrench(2 * (4.0 + 2.75), Vec3(0.2 * (4.0 - 2.75), 0.0, 0.0))),
        # One torque at its limit takes from another: pitch and roll meet in one motor.
        (Wrench(8.0, Vec3(0.4, 0.4, 0.0)), Wrench(8.0 + 0.1, Vec3(0.39, 0.39, -0.002))),
    ],
)
def test_each_motor_is_cut_to_its_limits_and_nothing_is_shared_out(command: Wrench, acting: Wrench) -> None:
    motors = Motors(thrust_max=4.0, thrust_min=0.1, arm_x=0.1, arm_y=0.1, drag_to_thrust=0.02)
    assert components(motors.wrench(motors.limited(command))) == pytest.approx(components(acting), abs=1e-14)


@given(wrenches, wrenches, time_constants, st.floats(0.0, 1.0))
def test_motors_that_nothing_limits_do_as_the_box(
    start: Wrench, target: Wrench, time_constant: float, elapsed: float
) -> None:
    by_motors = Actuators(motors=replace(FREE, up=time_constant, down=time_constant))
    by_box = Actuators(box=Box(time_constant=time_constant))
    acting = [
        components(kind.wrench(kind.response(kind.limited(start), kind.limited(target), elapsed)))
        for kind in (by_motors, by_box)
    ]
    assert acting[0] == pytest.approx(acting[1], abs=1e-11)


def test_the_box_limits_what_the_motors_are_asked_for() -> None:
    both = Actuators(box=Box(thrust_max=10.0, torque_max=0.1), motors=FREE)
    acting = both.wrench(both.limited(Wrench(12.0, Vec3(0.2, -0.05, 0.0))))
    assert components(acting) == pytest.approx([10.0, 0.1, -0.05, 0.0], abs=1e-13)


def lags(time_constant: float) -> tuple[Box | Motors, ...]:
    return Box(time_constant=time_constant), Motors(up=time_constant, down=time_constant)


@given(channels, channels, time_constants, st.floats(0.0, 1.0))
def test_lag_solves_its_equation(start: Channels, target: Channels, time_constant: float, elapsed: float) -> None:
    """From the start on, dx/dt = (target - x) / time_constant, by the central difference."""
    h = 1e-4 * time_constant
    for lag in lags(time_constant):
        before, now, after = (lag.response(start, target, elapsed + step) for step in (-h, 0.0, h))
        for a, x, b, goal in zip(before, now, after, target):
            assert (b - a) / 2e-4 == pytest.approx(goal - x, rel=1e-6, abs=1e-8)
        assert lag.response(start, target, 0.0) == pytest.approx(start, rel=1e-15, abs=1e-14)


@given(channels, channels, time_constants, time_constants, spans, spans)
def test_lag_over_two_times_is_the_lag_over_their_sum(
    start: Channels, target: Channels, up: float, down: float, first: float, second: float
) -> None:
    for lag in (Box(time_constant=up), Motors(up=up, down=down)):
        there = lag.response(lag.response(start, target, first), target, second)
        assert there == pytest.approx(lag.response(start, target, first + second), abs=1e-12)


def test_each_motor_rises_and_falls_with_a_time_constant_of_its_own() -> None:
    lag, start, target = Motors(up=0.0125, down=0.025), Channels(1.0, 1.0, 2.0, 3.0), Channels(2.0, 0.0, 2.0, 2.0)
    gone = [1.0 - math.exp(-0.01 / 0.0125), 1.0 - math.exp(-0.01 / 0.025)]
    expected = [1.0 + gone[0], 1.0 - gone[1], 2.0, 3.0 - gone[1]]
    assert lag.response(start, target, 0.01) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize("time_constant", [1e-6, 1e-300, 5e-324])
def test_lag_much_faster_than_the_step_has_arrived(time_constant: float) -> None:
    start, target = Channels(0.0, 0.0, 0.0, 0.0), Channels(12.0, 1.0, 2.0, 3.0)
    for lag in lags(time_constant):
        assert lag.response(start, target, 0.01) == target
        assert lag.response(start, target, 0.0) == start


def test_motors_without_lag_are_at_once_where_they_are_told_to_be() -> None:
    start, target = Channels(0.0, 5.0, 2.0, 1.0), Channels(12.0, 1.0, 2.0, 3.0)
    assert Motors(down=0.1).response(start, target, 0.0)[::2] == target[::2]
    assert Motors().response(start, target, 0.0) == target
