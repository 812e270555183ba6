"""The Runge-Kutta method: its order, what it integrates exactly, and how many steps cover a step."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_kit.algebra import Inertia, Quaternion, Vec3
from fmu_kit.integrator import internal_steps, rk4_step
from fmu_kit.rigid_body import Body, RigidState, Wrench, derivative


@dataclass(frozen=True)
class Number:
    """The smallest state that can be moved."""

    value: float

    def plus(self, factor: float, rate: "Number") -> "Number":
        return Number(self.value + factor * rate.value)


def integrated(f: Callable[[float, Number], Number], x: float, seconds: float, steps: int) -> float:
    state, h = Number(x), seconds / steps
    for i in range(steps):
        state = rk4_step(f, i * h, state, h)
    return state.value


def order(error: Callable[[int], float], steps: int) -> float:
    """The power of the step with which the error falls when the step is halved."""
    return math.log2(error(steps) / error(2 * steps))


def test_halving_the_step_of_a_number_divides_the_error_by_16() -> None:
    """dx/dt = x cos t, which depends on state and time: x = exp(sin t)."""

    def error(steps: int) -> float:
        result = integrated(lambda t, x: Number(x.value * math.cos(t)), 1.0, 2.0, steps)
        return abs(result - math.exp(math.sin(2.0)))

    assert order(error, 40) == pytest.approx(4.0, abs=0.1)
    assert order(error, 80) == pytest.approx(4.0, abs=0.1)


def test_halving_the_step_of_the_rigid_body_divides_the_error_by_16() -> None:
    body = Body(mass=1.3, inertia=Inertia(xx=0.8, yy=0.9, zz=1.4, xy=0.05, xz=-0.02, yz=0.03))
    start = RigidState(
        Vec3(0.0, 0.0, 0.0),
        Vec3(1.0, 0.0, 0.0),
        Quaternion.from_xyzw(0.1699, 0.3058, 0.1699, 0.9212).normalised(),
        Vec3(2.0, -1.0, 3.0),
    )

    def f(t: float, x: RigidState) -> RigidState:
        wrench = Wrench(10.0 + math.sin(5.0 * t), Vec3(math.cos(4.0 * t), 0.5, -1.0))
        return derivative(x, wrench, Vec3(0.0, 0.1 * t, 0.0), body)

    def simulated(steps: int) -> RigidState:
        state = start
        for i in range(steps):
            state = rk4_step(f, i / steps, state, 1.0 / steps).normalised()
        return state

    exact = simulated(2560)

    def error(steps: int) -> float:
        state = simulated(steps)
        differences = (
            (state.position - exact.position).norm(),
            (state.velocity - exact.velocity).norm(),
            state.quaternion.plus(-1.0, exact.quaternion).norm(),
            (state.angular_velocity - exact.angular_velocity).norm(),
        )
        return max(differences)

    assert order(error, 40) == pytest.approx(4.0, abs=0.2)
    assert order(error, 80) == pytest.approx(4.0, abs=0.2)


@given(st.lists(st.floats(-10.0, 10.0), min_size=4, max_size=4), st.floats(-2.0, 2.0), st.floats(0.01, 2.0))
def test_polynomials_of_time_up_to_third_degree_are_integrated_exactly(
    coefficients: list[float], t: float, h: float
) -> None:
    a, b, c, d = coefficients

    def antiderivative(t: float) -> float:
        return a * t + b * t**2 / 2.0 + c * t**3 / 3.0 + d * t**4 / 4.0

    result = rk4_step(lambda t, x: Number(a + b * t + c * t**2 + d * t**3), t, Number(1.0), h)
    assert result.value == pytest.approx(1.0 + antiderivative(t + h) - antiderivative(t), abs=1e-11)


@given(st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_step_of_a_linear_equation_is_the_taylor_polynomial_of_fourth_degree(rate: float, h: float) -> None:
    z = rate * h
    result = rk4_step(lambda t, x: Number(rate * x.value), 0.0, Number(1.0), h)
    assert result.value == pytest.approx(1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0, rel=1e-13)


def test_step_backwards_nearly_undoes_a_step_forwards() -> None:
    def f(t: float, x: Number) -> Number:
        return Number(x.value * math.cos(t))

    there = rk4_step(f, 1.0, Number(2.0), 1e-3)
    back = rk4_step(f, 1.0 + 1e-3, there, -1e-3)
    assert abs(there.value - 2.0) > 1e-4
    assert back.value == pytest.approx(2.0, abs=1e-14)


@pytest.mark.parametrize(
    ("h", "largest", "count"),
    [
        (0.01, 0.002, 5),
        (0.002, 0.002, 1),
        (0.001, 0.002, 1),
        (0.0021, 0.002, 2),
        (0.02, 0.002, 10),
        (0.03, 0.01, 3),  # 0.03 / 0.01 is a little more than 3 in floats
        (0.3, 0.1, 3),
        (0.01 + 1e-15, 0.002, 5),
        (0.01 + 1e-8, 0.002, 6),
        (1e-13, 0.002, 1),
        (1e-300, 0.002, 1),
        (0.05, 1.0, 1),
        (1.0, 1e-4, 10000),
    ],
)
def test_steps_are_as_many_as_the_largest_needs_and_no_more(h: float, largest: float, count: int) -> None:
    assert internal_steps(h, largest) == count


@given(st.integers(1, 10000), st.floats(1e-5, 0.1), st.floats(-1e-15, 1e-15))
def test_multiple_of_the_largest_step_takes_that_many_in_spite_of_rounding(
    count: int, largest: float, error: float
) -> None:
    assert internal_steps(count * largest + error, largest) == count


@given(st.floats(1e-9, 1.0), st.floats(1e-5, 1.0))
def test_steps_are_the_fewest_that_are_short_enough(h: float, largest: float) -> None:
    count = internal_steps(h, largest)
    assert h / count <= largest * (1.0 + 1e-6)
    assert count == 1 or h / (count - 1) > largest
