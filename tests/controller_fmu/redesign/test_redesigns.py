"""The redesigns of a law over its nominal model: their order, their equations, their minimum."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller_fmu.redesign.matching import matched_command, residuals, rotation_vector, solve
from controller_fmu.redesign.nominal import closed_loop, under_command
from controller_fmu.redesign.prediction import MAX_PENDING, all_sent, predicted_state, with_command
from controller_fmu.sliding_mode.law import Gains, evaluate, implicit_sliding
from controller_fmu.vehicle import Measurement, Model
from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.rigid_body import RigidState, Wrench
from fmu_kit.trajectory import Trajectory

MODEL = Model(mass=1.3, inertia=Inertia(xx=0.8, yy=0.9, zz=1.4, xy=0.05, xz=-0.02, yz=0.03), gravity=9.7)
START = RigidState(
    Vec3(0.4, -0.3, 2.2),
    Vec3(0.5, 0.2, -0.1),
    Quaternion.from_xyzw(0.1, 0.05, -0.1, 1.0).normalised(),
    Vec3(0.3, -0.2, 0.1),
)
Design = Callable[[float], Wrench]


def law(t: float, x: RigidState, implicit: float = 0.0) -> Wrench:
    found = evaluate(Measurement(*numbers_of(x)), Trajectory().at(t), Gains(), MODEL, implicit=implicit)
    return Wrench(found.thrust, found.torque)


def numbers_of(x: RigidState) -> tuple[Vec3, Vec3, Quaternion, Vec3]:
    return x.position, x.velocity, x.quaternion, x.angular_velocity


def flat(command: Wrench) -> np.ndarray:
    return np.array([command.thrust, *command.torque])


def mean(T: float, n: int = 3) -> Wrench:
    impulse = closed_loop(law, MODEL, 1.0, START, T / n, n).impulse
    return Wrench(impulse.thrust / T, impulse.torque / T)


def midpoint(T: float) -> Wrench:
    return law(1.0 + 0.5 * T, closed_loop(law, MODEL, 1.0, START, T / 6.0, 3).state)


def match(T: float, weight: float = 1.0) -> Wrench:
    target = closed_loop(law, MODEL, 1.0, START, T / 3.0, 3).state
    return matched_command(lambda u: under_command(MODEL, START, u, T / 3.0, 3), MODEL, target, mean(T), weight / T)


def order(difference: Callable[[float], float], T: float) -> float:
    return math.log2(difference(T) / difference(0.5 * T))


@pytest.mark.parametrize("design", [mean, midpoint, match, lambda T: law(1.0, START, T)])
def test_every_redesign_tends_to_the_explicit_law_in_first_order(design: Design) -> None:
    explicit = flat(law(1.0, START))
    assert order(lambda T: float(np.linalg.norm(flat(design(T)) - explicit)), 2e-4) == pytest.approx(1.0, abs=0.02)


def test_mean_and_midpoint_differ_in_second_order() -> None:
    assert order(lambda T: float(np.linalg.norm(flat(mean(T)) - flat(midpoint(T)))), 2e-3) == pytest.approx(
        2.0, abs=0.1
    )


def test_mean_is_the_area_under_the_continuous_command_to_fourth_order() -> None:
    T, fine = 0.08, 64
    exact = flat(mean(T, fine))
    assert order(lambda n: float(np.linalg.norm(flat(mean(T, round(1 / n))) - exact)), 1 / 3) == pytest.approx(
        4, abs=0.5
    )


@given(st.floats(-40.0, 40.0), st.floats(1e-3, 5.0), st.floats(0.1, 20.0))
def test_settled_solves_its_equation_to_rounding(s: float, time: float, k: float) -> None:
    sigma = implicit_sliding(Vec3(s, -s, 0.0), time, Vec3(k, k, k))
    slope = 1.0 + time * k / math.cosh(sigma.x) ** 2
    assert abs(sigma.x + time * k * math.tanh(sigma.x) - s) <= 1e-14 * slope * max(abs(s), 1e-300) + 1e-300
    assert sigma.y == -sigma.x
    assert sigma.z == 0.0


def test_semi_implicit_law_is_the_law_where_the_sliding_variable_is_settled() -> None:
    """The velocity that has σ in place of s, at the same errors otherwise, gives the same virtual control."""
    measured, reference = Measurement(*numbers_of(START)), Trajectory().at(1.0)
    implicit = evaluate(measured, reference, Gains(), MODEL, implicit=0.05)
    k = Gains().k_t + Vec3(Gains().beta, Gains().beta, Gains().beta)
    s = evaluate(measured, reference, Gains(), MODEL).sliding
    sigma = implicit_sliding(s, 0.05, k)
    assert implicit.sliding == sigma
    expected = reference.acceleration - k * sigma.map(math.tanh)
    assert list(implicit.virtual_control) == list(expected)


def test_match_is_the_minimum_that_an_optimiser_finds() -> None:
    optimize = pytest.importorskip("scipy.optimize")
    T, weight = 0.2, 2.0
    target = closed_loop(law, MODEL, 1.0, START, T / 3.0, 3).state

    def missed(u: np.ndarray) -> list[float]:
        return list(residuals(under_command(MODEL, START, Wrench(u[0], Vec3(*u[1:])), T / 3.0, 3), target, weight / T))

    best = optimize.least_squares(missed, flat(law(1.0, START)), xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    np.testing.assert_allclose(flat(match(T, weight)), best, rtol=0.0, atol=1e-6)


def test_match_reaches_a_target_that_one_command_leads_to() -> None:
    command = Wrench(11.0, Vec3(0.3, -0.2, 0.1))
    target = under_command(MODEL, START, command, 0.05, 3)
    found = matched_command(
        lambda u: under_command(MODEL, START, u, 0.05, 3), MODEL, target, Wrench(12.0, Vec3(0.0, 0.0, 0.0)), 5.0
    )
    np.testing.assert_allclose(flat(found), flat(command), rtol=0.0, atol=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_rotation_vector_is_axis_times_angle(x: float, y: float, z: float) -> None:
    angle = math.sqrt(x * x + y * y + z * z)
    scale = math.sin(0.5 * angle) / angle if angle > 1e-100 else 0.5
    Q = Quaternion(scale * Vec3(x, y, z), math.cos(0.5 * angle))
    if angle < math.pi - 1e-6:
        for same in (Q, -Q):
            assert list(rotation_vector(same)) == pytest.approx([x, y, z], abs=1e-12)


def test_elimination_solves_what_is_positive_definite() -> None:
    factor = np.random.default_rng(4).normal(size=(4, 9))
    matrix, right = factor @ factor.T, np.array([1.0, -2.0, 0.5, 3.0])
    found = solve(matrix.tolist(), right.tolist())
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-11)


def test_predictor_flies_the_commands_in_the_order_in_which_they_act() -> None:
    commands = [Wrench(10.0 + k, Vec3(0.1 * k, 0.0, -0.1)) for k in range(4)]
    pending = all_sent(-1.0, commands[0])
    for k, command in enumerate(commands[1:]):
        pending = with_command(pending, 0.1 * k, command)
    simulated: list[tuple[float, float]] = []

    def advanced(x: RigidState, command: Wrench, time: float) -> RigidState:
        simulated.append((command.thrust, time))
        return x

    assert predicted_state(advanced, START, 0.25, 0.2, pending) is START
    legs = [leg for leg in simulated if leg[1] > 1e-12]
    assert [thrust for thrust, _ in legs] == [11.0, 12.0, 13.0]  # that of t = 0 acts from 0.2 on
    assert [time for _, time in legs] == pytest.approx([0.05, 0.1, 0.05])
    assert len(pending) == MAX_PENDING
