"""The rate loop alone."""

import math

import numpy as np
import pytest

from controller_fmu.cascaded.airframe import Airframe
from controller_fmu.cascaded.rate_loop import RateLoop, RateState, control_rate, initial_rate_state
from fmu_kit.algebra import ZERO, Inertia, Vec3

LOOP, FRAME, T = RateLoop(), Airframe(), 0.004
J = Inertia(xx=1.0, yy=1.2, zz=0.9, xy=0.05)


def run(
    state: RateState, rate: Vec3, desired: Vec3, elapsed: float = T, loop: RateLoop = LOOP
) -> tuple[Vec3, RateState]:
    return control_rate(loop, state, rate, desired, elapsed, J, FRAME)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_step_is_answered_as_the_sampled_pid_loop_does(axis: str) -> None:
    """By powers of its matrix over error, integral, error before and filtered derivative."""
    P, integral, D = (getattr(gain, axis) for gain in (LOOP.proportional, LOOP.integral, LOOP.derivative))
    tau = 1.0 / (2.0 * math.pi * 30.0)
    slope = np.array([1.0, 0.0, -1.0, -T]) / (tau + T) + np.array([0.0, 0.0, 0.0, 1.0])
    answer = np.array([-P, 1.0, 0.0, 0.0]) - D * slope
    matrix = np.array(
        [np.array([1.0, 0.0, 0.0, 0.0]) + T * answer, [-T * integral, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], slope]
    )
    size = 1e-6  # small: the share of an error that is integrate_error is 1 - (error / 400 deg/s)²
    desired = size * Vec3(*(float(name == axis) for name in "xyz"))
    rate, state, found = ZERO, initial_rate_state(ZERO), []
    for k in range(100):
        torque, state = run(state, rate, desired, T if k else 0.0)
        rate = rate + T * J.solve(torque)
        found.append((getattr(rate, axis) - size) / size)
    first = -1.0 + T * P
    errors = [(np.linalg.matrix_power(matrix, k) @ [first, 0.0, -1.0, 0.0])[0] for k in range(100)]
    assert found == pytest.approx(errors, abs=1e-9)


def test_the_yaw_command_goes_through_a_low_pass() -> None:
    tau, state, found = 1.0 / (2.0 * math.pi * 2.0), initial_rate_state(ZERO), []
    loop = RateLoop(integral=ZERO)
    for _ in range(50):
        torque, state = run(state, ZERO, Vec3(0.0, 0.0, 0.1), loop=loop)
        found.append(torque.z)
    demand = 0.9 * loop.proportional.z * 0.1
    assert found == pytest.approx([demand * (1.0 - (tau / (tau + T)) ** (k + 1)) for k in range(50)])


def test_the_desired_rate_is_fed_forward() -> None:
    loop = RateLoop(proportional=ZERO, integral=ZERO, derivative=ZERO, feedforward=Vec3(3.0, 3.0, 0.0))
    torque, _ = run(initial_rate_state(ZERO), ZERO, Vec3(0.1, 0.2, 0.0), loop=loop)
    assert [*torque] == pytest.approx([*(J @ Vec3(0.3, 0.6, 0.0))])


def test_torques_stay_within_full_commands_and_what_is_cut_is_kept() -> None:
    torque, state = run(initial_rate_state(ZERO), ZERO, Vec3(100.0, -100.0, 0.0))
    assert [torque.x, torque.y] == pytest.approx([FRAME.full_torque.x, -FRAME.full_torque.y])
    assert state.excess.x > 0.0 > state.excess.y


def test_the_integral_does_not_grow_in_saturation_and_may_shrink() -> None:
    saturated = RateState(Vec3(5.0, 5.0, 0.0), ZERO, ZERO, 0.0, Vec3(0.1, -0.1, 0.0))
    _, state = run(saturated, ZERO, Vec3(0.5, 0.5, 0.5))
    assert state.integral.x == 5.0  # cut above: no more
    assert state.integral.y > 5.0  # cut below: upwards it may
    assert state.integral.z > 0.0
    _, state = run(saturated, ZERO, Vec3(-0.5, -0.5, 0.0))
    assert state.integral.x < 5.0 == state.integral.y


def test_of_large_errors_less_is_integrated_and_of_the_largest_none() -> None:
    def taken(error: float) -> float:
        return run(initial_rate_state(ZERO), ZERO, Vec3(error, 0.0, 0.0))[1].integral.x / (LOOP.integral.x * error * T)

    assert taken(math.radians(4.0)) == pytest.approx(1.0 - 1e-4)
    assert taken(math.radians(200.0)) == pytest.approx(0.75)
    assert taken(math.radians(400.0)) == taken(math.radians(500.0)) == 0.0


def test_the_integral_stays_within_its_share_of_a_full_command() -> None:
    state = initial_rate_state(ZERO)
    for _ in range(2000):
        _, state = run(RateState(state.integral, ZERO, ZERO, 0.0, ZERO), ZERO, Vec3(1.0, -1.0, 0.0))
    bound = [0.3 * FRAME.full_torque.x / J.xx, -0.3 * FRAME.full_torque.y / J.yy]
    assert [state.integral.x, state.integral.y] == pytest.approx(bound)


def test_no_time_changes_nothing() -> None:
    before = RateState(Vec3(1.0, 2.0, 0.5), ZERO, Vec3(0.1, 0.2, 0.3), 0.01, ZERO)
    _, after = run(before, ZERO, Vec3(0.3, 0.2, 0.1), 0.0)
    assert (after.integral, after.angular_acceleration, after.yaw_command) == (before[0], before[2], before[3])
