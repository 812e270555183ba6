"""Curves through points: they pass through them, are smooth to the fourth derivative, and keep the limits."""

import math
from pathlib import Path

import numpy as np
import pytest

from orchestration.systems.signals.spline import Spline, through
from orchestration.systems.signals.waypoints import read_waypoints
from quadcosim import UsageError

TIMES = np.array([0.0, 1.0, 2.5, 3.0, 7.0])
POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [3.0, 1.0, -1.0], [3.0, 0.0, 1.0], [10.0, 0.0, 2.0]])


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "points.csv"
    path.write_text(text)
    return path


def derivative(curve: Spline, order: int, *, at_end: bool) -> np.ndarray:
    """The derivative of each piece at one of its ends, shape (n, 3)."""
    falling = [math.perm(n, order) for n in range(10)]
    weights = np.array([f if at_end or n == order else 0.0 for n, f in enumerate(falling)])
    spans = np.diff(curve.knots)[:, None]
    return np.einsum("n,snk->sk", weights, curve.coefficients) / spans**order


def test_a_curve_passes_through_its_points() -> None:
    assert through(TIMES, POINTS).at(TIMES)[:, 0] == pytest.approx(POINTS, abs=1e-10)


def test_position_to_snap_are_continuous_at_the_knots() -> None:
    curve = through(TIMES, POINTS)
    before, behind = curve.at(np.nextafter(TIMES[1:-1], 0.0)), curve.at(TIMES[1:-1])
    assert before == pytest.approx(behind, abs=1e-7)


def test_derivatives_are_those_of_the_positions() -> None:
    curve, h = through(TIMES, POINTS), 1e-4
    for t in (0.4, 1.9, 2.7, 5.0):
        around = curve.at(np.array([t - h, t, t + h]))
        for order in range(1, 5):
            numerical = (around[2, order - 1] - around[0, order - 1]) / (2.0 * h)
            assert around[1, order] == pytest.approx(numerical, rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("order", [5, 6, 7, 8])
def test_the_integral_is_least_where_the_next_four_derivatives_are_continuous_too(order: int) -> None:
    curve = through(TIMES, POINTS)
    ends, begins = derivative(curve, order, at_end=True)[:-1], derivative(curve, order, at_end=False)[1:]
    assert ends == pytest.approx(begins, rel=1e-7, abs=1e-6)


def test_a_curve_is_at_rest_before_its_first_and_after_its_last_point() -> None:
    found = through(TIMES, POINTS).at(np.array([-1.0, 0.0, 7.0, 9.0]))
    assert found[:, 0] == pytest.approx(POINTS[[0, 0, -1, -1]], abs=1e-9)
    assert not found[:, 1:].any()


def test_two_points_are_the_smooth_step() -> None:
    from orchestration.systems.signals.motions import Step

    curve, step = through(np.array([1.0, 3.0]), np.array([[0.0] * 3, [1.0, 0.0, 0.0]])), Step(dx=1.0)
    for t in (1.3, 2.0, 2.9):
        one = step.at(t)
        expected = [one.position.x, one.velocity.x, one.acceleration.x, one.jerk.x, one.snap.x]
        assert curve.at(np.array([t]))[0, :, 0] == pytest.approx(expected, abs=1e-10)


def test_spans_of_very_different_length_stay_smooth() -> None:
    times = np.cumsum([0.0, 1.0, 0.02, 3.0, 0.05, 1.0])
    curve = through(times, np.cumsum([[0.0] * 3, [1.0] * 3, [0.02] * 3, [3.0] * 3, [0.05] * 3, [1.0] * 3], axis=0))
    assert curve.at(times)[:, 0] == pytest.approx(np.repeat(times[:, None], 3, axis=1), abs=1e-9)


def test_far_from_the_origin_no_digits_are_lost() -> None:
    near, far = through(TIMES, POINTS), through(TIMES, POINTS + 1e6)
    assert far.at(np.array([1.7]))[0, 1:] == pytest.approx(near.at(np.array([1.7]))[0, 1:], rel=1e-6)


def test_rows_with_times_are_passed_at_these_times(tmp_path: Path) -> None:
    path = written(tmp_path, "time,x,y,z\n0,0,0,0\n1,1,2,0\n4,3,1,-1\n")
    assert read_waypoints(path, {}).at(np.array([1.0]))[0, 0] == pytest.approx([1.0, 2.0, 0.0])


SQUARE = "x,y,z,hold,speed\n0,0,0,1,0\n2,0,-1,0,1\n2,2,-1,2,1\n0,2,-1,0,0.5\n0,0,0,0,0.5\n"


def test_speed_or_acceleration_touches_its_limit_and_neither_passes_it(tmp_path: Path) -> None:
    path = written(tmp_path, "x,y,z\n0,0,0\n2,0,-1\n2,2,-1\n0,2,-1\n0,0,0\n")
    for limits in ({"speed": 0.5}, {"speed": 9.0, "acceleration": 0.7}):
        curve = read_waypoints(path, limits)
        found = np.linalg.norm(curve.at(np.linspace(0.0, curve.knots[-1], 20_001))[:, 1:3], axis=2).max(axis=0)
        shares = found / [limits["speed"], limits.get("acceleration", 1.0)]
        assert shares.max() == pytest.approx(1.0, abs=1e-5)


def test_a_hold_is_a_rest_of_that_length_and_a_speed_is_that_of_its_way(tmp_path: Path) -> None:
    curve = read_waypoints(written(tmp_path, SQUARE), {})
    assert curve.knots[:2].tolist() == [0.0, 1.0]
    begin, end = curve.knots[3:5]
    assert end - begin == pytest.approx(2.0)
    resting = curve.at(np.linspace(begin, end, 50))
    assert resting[:, 0] == pytest.approx(np.tile([2.0, 2.0, -1.0], (50, 1)), abs=1e-12)
    assert not resting[1:-1, 1:].any()
    slow = np.linalg.norm(curve.at(np.linspace(end, curve.knots[-1], 5001))[:, 1], axis=1)
    assert slow.max() <= 0.5 * (1.0 + 1e-6)


@pytest.mark.parametrize(
    ("text", "limits", "line"),
    [
        ("x,y\n0,0\n1,1\n", {}, "no column z; expected x, y, z"),
        ("x,y,z,spd\n0,0,0,1\n1,1,1,1\n", {}, "column spd: expected x, y, z, hold, speed only"),
        ("time,x,y,z,hold\n0,0,0,0,1\n1,1,1,1,1\n", {}, "column hold: expected time, x, y, z only"),
        ("time,x,y,z\n0,0,0,0\n0,1,1,1\n", {}, "line 3: time = 0.0: expected times that increase"),
        ("x,y,z\n0,0,0\n1,one,1\n", {}, "line 3: y = one: expected numbers only"),
        ("x,y,z\n0,0,0\n\n0,0,0\n", {}, "line 4: x = 0.0: expected another point than the one before"),
        ("x,y,z,hold\n0,0,0,-1\n1,0,0,0\n", {}, "line 2: hold = -1.0: expected zero or a positive number of"),
        ("x,y,z,speed\n0,0,0,1\n1,0,0,0\n", {}, "line 3: speed = 0.0: expected a positive number, the largest"),
        ("x,y,z\n0,0,0\n", {}, "expected at least two rows of numbers"),
    ],
)
def test_errors_in_a_file_have_line_and_column(tmp_path: Path, text: str, limits: dict[str, float], line: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(UsageError) as error:
        read_waypoints(path, limits)
    assert str(error.value).startswith(f"{path}: {line}")


def test_limits_of_a_file_with_times_are_rejected(tmp_path: Path) -> None:
    path = written(tmp_path, "time,x,y,z\n0,0,0,0\n1,1,1,1\n")
    with pytest.raises(UsageError, match=r"parameters\.speed: expected none; .* has times"):
        read_waypoints(path, {"speed": 1.0})
