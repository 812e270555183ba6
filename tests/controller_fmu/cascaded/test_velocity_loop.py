"""The velocity loop alone."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller_fmu.cascaded.velocity_loop import (
    VelocityLoop,
    VelocityState,
    control_velocity,
    initial_velocity_state,
    limited_force,
)
from controller_fmu.vehicle import Model
from fmu_kit.algebra import ZERO, Vec3

LOOP, MODEL, FULL, T = VelocityLoop(derivative=Vec3(0.2, 0.2, 0.1)), Model(mass=1.3), 26.0, 0.02
ACCELERATIONS = st.builds(Vec3, *[st.floats(-50.0, 50.0, allow_subnormal=False)] * 3)


def simulated(loop: VelocityLoop, velocity: Vec3, desired: Vec3, count: int) -> tuple[list[Vec3], VelocityState]:
    """Velocities of a vehicle that exerts the force at once, sample by sample, and what is kept in the end."""
    state, velocities = initial_velocity_state(velocity), [velocity]
    for k in range(count):
        force, state = control_velocity(loop, state, velocities[-1], desired, ZERO, T if k else 0.0, MODEL, FULL)
        velocities.append(velocities[-1] + T * (force / MODEL.mass + Vec3(0.0, 0.0, MODEL.gravity)))
    return velocities, state


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_step_is_answered_as_the_sampled_pid_loop_does(axis: str) -> None:
    """By powers of its matrix over velocity error, integral, error before and filtered derivative."""
    P, integral, D = (getattr(gain, axis) for gain in (LOOP.proportional, LOOP.integral, LOOP.derivative))
    tau = 1.0 / (2.0 * math.pi * 5.0)
    slope = np.array([1.0, 0.0, -1.0, -T]) / (tau + T) + np.array([0.0, 0.0, 0.0, 1.0])  # the filter's new value
    answer = np.array([-P, 1.0, 0.0, 0.0]) - D * slope  # the acceleration
    matrix = np.array(
        [np.array([1.0, 0.0, 0.0, 0.0]) + T * answer, [-T * integral, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], slope]
    )
    unit = Vec3(*(float(name == axis) for name in "xyz"))
    velocities, _ = simulated(LOOP, ZERO, 0.1 * unit, 60)
    # The first run has no time before it: the loop begins where it left the vehicle.
    first = -0.1 + T * P * 0.1
    errors = [(np.linalg.matrix_power(matrix, k) @ [first, 0.0, -0.1, 0.0])[0] for k in range(60)]
    assert [getattr(v, axis) - 0.1 for v in velocities[1:]] == pytest.approx(errors, abs=1e-12)


def test_the_reference_acceleration_is_fed_forward() -> None:
    force, _ = control_velocity(LOOP, initial_velocity_state(ZERO), ZERO, ZERO, Vec3(1.0, -2.0, 0.0), T, MODEL, FULL)
    assert [*force] == pytest.approx([1.3, -2.6, -1.3 * 9.81])


@given(ACCELERATIONS)
def test_the_force_is_tilted_no_further_than_allowed_and_no_larger_than_there_is(acceleration: Vec3) -> None:
    desired, limited = limited_force(LOOP, acceleration, MODEL, FULL)
    for force in (desired, limited):
        assert math.hypot(force.x, force.y) <= -force.z * (1.0 + 1e-9)  # 45 degrees
        assert force.x * acceleration.y == pytest.approx(force.y * acceleration.x, abs=1e-6)
        assert force.x * acceleration.x + force.y * acceleration.y >= 0.0
    assert 0.12 * FULL * math.cos(math.radians(45.0)) * (1.0 - 1e-9) <= limited.norm() <= FULL * (1.0 + 1e-9)


@given(ACCELERATIONS)
def test_within_the_limits_the_vertical_acceleration_is_exact_and_the_direction_that_of_the_horizontal_one(
    acceleration: Vec3,
) -> None:
    force = limited_force(LOOP, acceleration, MODEL, 1e6).limited
    if math.hypot(acceleration.x, acceleration.y) < 9.81 and 9.81 - acceleration.z > 0.12 * 1e6 / 1.3:
        assert force.z / 1.3 + 9.81 == pytest.approx(acceleration.z)
        assert force.x / force.z == pytest.approx(-acceleration.x / 9.81, abs=1e-9)


def test_the_vertical_comes_first_but_for_the_margin_of_the_horizontal() -> None:
    climb = limited_force(LOOP, Vec3(5.0, 0.0, -100.0), MODEL, FULL).limited
    assert climb.x == pytest.approx(0.3 * FULL)
    assert climb.z == pytest.approx(-FULL * math.sqrt(1.0 - 0.3**2))
    level = limited_force(LOOP, Vec3(9.0, 0.0, -6.0), MODEL, FULL).limited
    assert level.z == pytest.approx(-1.3 * 15.81)  # as desired
    assert level.norm() == pytest.approx(FULL)


def test_the_integral_does_not_grow_where_the_vertical_thrust_is_at_a_limit() -> None:
    for error in (-20.0, 20.0):  # full and least thrust
        state = initial_velocity_state(ZERO)
        for _ in range(100):
            _, state = control_velocity(LOOP, state, ZERO, Vec3(0.0, 0.0, error), ZERO, T, MODEL, FULL)
        assert state.integral.z == 0.0
    _, state = control_velocity(LOOP, state, ZERO, Vec3(0.0, 0.0, -0.1), ZERO, T, MODEL, FULL)
    assert state.integral.z == pytest.approx(-0.1 * T * 2.0)


def test_the_horizontal_integral_is_brought_back_to_where_half_of_the_error_is_left_to_it() -> None:
    """Tracking anti-windup rests where the error is 2/P (desired - limited): I = limited - P e / 2."""
    state = initial_velocity_state(ZERO)
    for _ in range(4000):
        force, state = control_velocity(LOOP, state, ZERO, Vec3(30.0, 0.0, 0.0), ZERO, T, MODEL, FULL)
    assert state.integral.x == pytest.approx(force.x / 1.3 - 1.8 * 30.0 / 2.0)
    assert abs(state.integral.x) < 0.4 * 30.0 * T * 4000 / 10.0  # of what it would have been


def test_the_vertical_integral_stays_within_gravity() -> None:
    started = VelocityState(Vec3(0.0, 0.0, -50.0), ZERO, ZERO)
    force, _ = control_velocity(LOOP, started, ZERO, ZERO, ZERO, T, MODEL, 1e3)
    assert force.z == pytest.approx(-0.12 * 1e3)
    force, _ = control_velocity(LOOP, started, ZERO, ZERO, ZERO, T, MODEL, FULL)
    assert force.z == pytest.approx(-1.3 * 2.0 * 9.81)
