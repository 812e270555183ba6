"""The position loop alone."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller_fmu.cascaded.position_loop import PositionLoop, limited_sum
from fmu_kit.algebra import ZERO, Vec3

SPEEDS = st.floats(-20.0, 20.0, allow_subnormal=False)


def test_a_step_decays_as_a_sampled_integrator_under_proportional_feedback() -> None:
    loop, period, position = PositionLoop(), 0.05, Vec3(1.0, -2.0, 0.5)
    for _ in range(40):
        position = position + period * loop.velocity(position, ZERO, ZERO)
    left = [(1.0 - period * gain) ** 40 for gain in (0.95, 0.95, 1.0)]
    assert [*position] == pytest.approx([left[0], -2.0 * left[1], 0.5 * left[2]], rel=1e-12)


def test_where_there_is_no_error_the_reference_velocity_is_flown() -> None:
    assert [*PositionLoop().velocity(ZERO, ZERO, Vec3(1.0, 2.0, -0.5))] == pytest.approx([1.0, 2.0, -0.5])


def test_climb_and_descent_have_limits_of_their_own() -> None:
    loop = PositionLoop()
    assert loop.velocity(ZERO, Vec3(0.0, 0.0, 9.0), ZERO).z == 1.5
    assert loop.velocity(ZERO, Vec3(0.0, 0.0, -9.0), ZERO).z == -3.0


@given(SPEEDS, SPEEDS, SPEEDS, SPEEDS)
def test_a_horizontal_sum_is_no_faster_than_the_limit(ax: float, ay: float, bx: float, by: float) -> None:
    x, y = limited_sum(ax, ay, bx, by, 12.0)
    assert math.hypot(x, y) <= 12.0 * (1.0 + 1e-9)
    if math.hypot(ax + bx, ay + by) <= 12.0 and math.hypot(ax, ay) < 12.0:
        assert (x, y) == pytest.approx((ax + bx, ay + by), abs=1e-9)


@given(SPEEDS, SPEEDS, SPEEDS, SPEEDS)
def test_of_a_sum_that_is_too_fast_the_first_part_is_kept_and_the_second_cut(
    ax: float, ay: float, bx: float, by: float
) -> None:
    x, y = limited_sum(ax, ay, bx, by, 12.0)
    if math.hypot(ax, ay) >= 12.0:
        assert (x, y) == pytest.approx((12.0 * ax / math.hypot(ax, ay), 12.0 * ay / math.hypot(ax, ay)), abs=1e-9)
    elif math.hypot(ax + bx, ay + by) > 12.0:
        assert math.hypot(x, y) == pytest.approx(12.0)
        assert (x - ax) * by == pytest.approx((y - ay) * bx, abs=1e-8)
        assert (x - ax) * bx + (y - ay) * by >= 0.0
