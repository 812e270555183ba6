"""The built-in trajectory: the paper's formula and its derivatives."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_kit.algebra import ZERO, Vec3
from fmu_kit.trajectory import Reference, Trajectory
from orchestration.simulation.engines.sources import NUMPY

lengths = st.floats(-10.0, 10.0)
trajectories = st.builds(
    Trajectory,
    amplitude_x=lengths,
    amplitude_y=lengths,
    frequency=st.one_of(st.just(0.0), st.floats(0.01, 3.0), st.floats(-3.0, -0.01)),
    start_z=lengths,
    rate_z=st.floats(-2.0, 2.0),
)
times = st.floats(-100.0, 100.0)
DERIVATIVES = ("position", "velocity", "acceleration", "jerk", "snap")


def derivative(f: Callable[[float], Vec3], t: float, h: float) -> Vec3:
    """df/dt by the central difference of sixth order."""
    return (
        45.0 * (f(t + h) - f(t - h)) - 9.0 * (f(t + 2.0 * h) - f(t - 2.0 * h)) + (f(t + 3.0 * h) - f(t - 3.0 * h))
    ) / (60.0 * h)


@pytest.mark.parametrize(("quantity", "rate"), list(pairwise(DERIVATIVES)))
@given(trajectory=trajectories, t=times)
def test_each_derivative_is_the_rate_of_the_one_before(
    quantity: str, rate: str, trajectory: Trajectory, t: float
) -> None:
    def before(time: float) -> Vec3:
        value: Vec3 = getattr(trajectory.at(time), quantity)
        return value

    numerical = derivative(before, t, 0.02 / max(1.0, abs(trajectory.frequency)))
    exact: Vec3 = getattr(trajectory.at(t), rate)
    scale = 20.0 * max(1.0, 2.0 * abs(trajectory.frequency)) ** DERIVATIVES.index(rate)
    assert (numerical - exact).norm() <= 1e-9 * scale


@given(times)
def test_defaults_are_the_trajectory_of_the_paper(t: float) -> None:
    expected = [4.0 * math.sin(0.15 * t) * math.cos(0.15 * t), 4.0 * math.sin(0.15 * t), 2.0 + 0.1 * t]
    assert list(Trajectory().position(t)) == pytest.approx(expected, rel=0.0, abs=1e-13)


@given(trajectories, times)
def test_every_parameter_has_its_place_in_the_formula(trajectory: Trajectory, t: float) -> None:
    w = trajectory.frequency
    expected = [
        trajectory.amplitude_x * math.sin(w * t) * math.cos(w * t),
        trajectory.amplitude_y * math.sin(w * t),
        trajectory.start_z + trajectory.rate_z * t,
    ]
    assert list(trajectory.position(t)) == pytest.approx(expected, rel=0.0, abs=1e-12)


@given(trajectories, times)
def test_position_is_that_of_the_whole_reference(trajectory: Trajectory, t: float) -> None:
    assert trajectory.position(t) == trajectory.at(t).position


@pytest.mark.parametrize("quantity", DERIVATIVES)
@given(trajectory=trajectories, points=st.lists(times, min_size=1, max_size=5))
def test_batch_gives_what_its_times_give(quantity: str, trajectory: Trajectory, points: list[float]) -> None:
    batch: Vec3 = getattr(trajectory.at(np.array(points), NUMPY), quantity)
    single = [list(getattr(trajectory.at(t), quantity)) for t in points]
    # The sines of numpy and of the standard library may differ in the last place.
    np.testing.assert_allclose(np.column_stack(list(batch)), single, rtol=1e-13, atol=1e-13 * 10.0 * 6.0**4)


@given(st.lists(times, min_size=1, max_size=5))
def test_every_component_of_a_batch_has_its_shape(points: list[float]) -> None:
    """A constant component too: it can be stored and indexed like the others."""
    reference = Trajectory().at(np.array(points), NUMPY)
    shapes = {np.shape(component) for name in DERIVATIVES for component in getattr(reference, name)}
    assert shapes == {(len(points),)}


def test_reference_of_a_position_alone_is_at_rest() -> None:
    reference = Reference(position=Vec3(1.0, 2.0, 3.0))
    assert [getattr(reference, name) for name in DERIVATIVES[1:]] == [ZERO] * 4


def test_the_series_of_a_reference_misses_each_derivative_by_the_first_term_that_it_lacks() -> None:
    """It ends with snap: the position is wrong in fifth order of the time, the snap in first."""
    trajectory = Trajectory(frequency=0.8)
    now = trajectory.at(1.0)

    def missed(quantity: str, time: float) -> float:
        difference: Vec3 = getattr(now.after(time), quantity) - getattr(trajectory.at(1.0 + time), quantity)
        return float(difference.norm())

    orders = [math.log2(missed(quantity, 0.01) / missed(quantity, 0.005)) for quantity in DERIVATIVES]
    assert orders == pytest.approx([5.0, 4.0, 3.0, 2.0, 1.0], abs=0.1)
