"""The points that axes span."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.experiments.studies.axes import MAX_POINTS, Axis, Method, Points, span, unit_points
from quadcosim import UsageError

LISTED = Axis(name="period", targets=("timing.period",), values=(0.02, 0.01))
ORDERS = Axis(name="order", targets=("timing.order",), values=("gauss-seidel", "jacobi", "gauss-seidel"))
MASS = Axis(name="mass", targets=("plant.mass",), low=0.5, high=2.0)
DELAY = Axis(name="delay", targets=("timing.delay",), low=1e-4, high=1e-1, scale="logarithmic")

COUNTS: dict[Method, int] = {"random": 8, "latin-hypercube": 8, "sobol": 8, "morris": 8 * 4, "saltelli": 8 * 5}
"""Points of a design of eight samples in three dimensions."""


def sampled(method: Method, seed: int = 0, samples: int = 8) -> list[dict[str, float]]:
    return list(Points([MASS, DELAY], method, samples, seed))  # type: ignore[arg-type]


# -- grids ------------------------------------------------------------------------------------------------


def test_a_grid_has_every_combination_once_and_the_last_axis_varies_fastest() -> None:
    found = Points([LISTED, ORDERS], "sobol", 0, 0)
    expected = [(p, o) for p in (0.02, 0.01) for o in ("gauss-seidel", "jacobi", "gauss-seidel")]
    assert [(point["period"], point["order"]) for point in found] == expected


def test_the_values_of_a_list_keep_their_order_and_types() -> None:
    for values in ((3, 1.5, 0), (True, False), ("jacobi", "gauss-seidel")):
        found = [point["x"] for point in Points([Axis(name="x", targets=("seed",), values=values)], "sobol", 0, 0)]
        assert tuple(found) == values
        assert [type(value) for value in found] == [type(value) for value in values]


@pytest.mark.parametrize("values", [(1, True), ("jacobi", 1.0), (False, "no")])
def test_values_of_several_kinds_are_refused(values: tuple[Any, ...]) -> None:
    with pytest.raises(UsageError, match="axis x: expected values of one kind: numbers, texts, or true and false"):
        Axis(name="x", targets=("seed",), values=values)


def test_a_design_is_counted_before_it_is_expanded() -> None:
    axes = [Axis(name=f"x{i}", targets=("seed",), values=tuple(range(100))) for i in range(6)]
    with pytest.raises(UsageError, match=rf"100 x 100 x .* = {100**6} runs: expected at most {MAX_POINTS}"):
        Points(axes, "sobol", 0, 0)
    with pytest.raises(UsageError, match=rf"number = 100000000, expected at most {MAX_POINTS}"):
        span("x", 0.0, 1.0, 100_000_000, "linear")
    with pytest.raises(UsageError, match=rf"2 x {2**40 * 3} = .* runs: expected at most"):
        Points([LISTED, MASS], "saltelli", 2**40, 0)


def test_points_of_the_largest_design_are_computed_on_access() -> None:
    axes = [Axis(name=f"x{i}", targets=("seed",), values=tuple(range(100))) for i in range(3)]
    found = Points(axes, "sobol", 0, 0)
    assert len(found) == MAX_POINTS
    assert found[987654] == {"x0": 98, "x1": 76, "x2": 54}
    assert found[-1] == {"x0": 99, "x1": 99, "x2": 99}
    with pytest.raises(IndexError):
        found[MAX_POINTS]


@pytest.mark.parametrize("method", ["random", "sobol"])
def test_more_samples_keep_those_before(method: Method) -> None:
    assert sampled(method, samples=16)[:8] == sampled(method, samples=8)


def test_each_combination_meets_every_sample_and_samples_vary_fastest() -> None:
    found = Points([MASS, LISTED], "random", 3, 0)
    assert [point["period"] for point in found] == [0.02] * 3 + [0.01] * 3
    assert [point["mass"] for point in found[:3]] == [point["mass"] for point in found[3:]]


# -- spans ------------------------------------------------------------------------------------------------


def test_the_steps_of_a_decimal_range_are_decimal_numbers() -> None:
    assert span("period", 0.001, 0.1, 100, "linear") == tuple(float(f"0.{i:03d}") for i in range(1, 101))


def test_logarithmic_steps_of_a_decade_are_powers_of_ten() -> None:
    assert span("delay", 1e-4, 1.0, 5, "logarithmic") == (1e-4, 1e-3, 1e-2, 1e-1, 1.0)


@given(
    low=st.floats(1e-6, 1e3), factor=st.floats(1.01, 1e4), number=st.integers(2, 40),
    scale=st.sampled_from(["linear", "logarithmic"]),
)  # fmt: skip
def test_a_span_has_exact_ends_and_equal_steps(low: float, factor: float, number: int, scale: str) -> None:
    high = low * factor
    values = span("x", low, high, number, scale)  # type: ignore[arg-type]
    assert (values[0], values[-1], len(values)) == (low, high, number)
    steps = np.diff(np.log(values) if scale == "logarithmic" else values)
    assert (steps > 0.0).all()
    # Twelve digits of a value are kept, and a step may be small against the values.
    rounding = 2.1e-11 * (1.0 if scale == "logarithmic" else high)
    assert np.ptp(steps) <= rounding


def test_two_values_are_the_ends() -> None:
    assert span("x", 0.1, 0.3, 2, "linear") == (0.1, 0.3)


# -- samples ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("method", "count"), COUNTS.items())
def test_a_design_has_its_number_of_points_in_the_unit_cube(method: Method, count: int) -> None:
    design = unit_points(method, 3, 8, seed=1)
    assert design.shape == (count, 3)
    assert design.min() >= 0.0
    assert design.max() <= 1.0
    assert np.ptp(design, axis=0).min() > 0.5


@pytest.mark.parametrize("method", COUNTS)
def test_the_seed_alone_decides_a_design(method: Method) -> None:
    assert sampled(method, seed=3) == sampled(method, seed=3)
    assert sampled(method, seed=3) != sampled(method, seed=4)


@pytest.mark.parametrize("method", COUNTS)
def test_samples_lie_in_the_range_of_their_axis(method: Method) -> None:
    for point in sampled(method):
        assert 0.5 <= point["mass"] <= 2.0
        assert 1e-4 * (1 - 1e-12) <= point["delay"] <= 1e-1 * (1 + 1e-12)


@pytest.mark.parametrize(("method", "samples"), [("latin-hypercube", 50), ("sobol", 64)])
def test_a_design_has_one_point_in_each_stratum_of_each_axis(method: Method, samples: int) -> None:
    design = unit_points(method, 3, samples, seed=2)
    for column in np.floor(design * samples).astype(int).T:
        assert sorted(column) == list(range(samples))


def test_a_morris_trajectory_moves_one_axis_at_a_time() -> None:
    for trajectory in unit_points("morris", 3, 4, seed=0).reshape(4, 4, 3):
        moved = np.diff(trajectory, axis=0) != 0.0
        assert (moved.sum(axis=1) == 1).all()
        assert moved.any(axis=0).all()


def test_a_logarithmic_axis_is_uniform_in_the_logarithm() -> None:
    shares = [math.log10(point["delay"] / 1e-4) / 3.0 for point in sampled("latin-hypercube", samples=200)]
    assert sorted(np.floor(np.array(shares) * 200 + 1e-9).astype(int)) == list(range(200))


# -- what cannot be ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "number", "scale"),
    [(1.0, 1.0, 3, "linear"), (2.0, 1.0, 3, "linear"), (math.nan, 1.0, 3, "linear"), (0.0, math.inf, 3, "linear"),
     (0.0, 1.0, 3, "logarithmic"), (-1.0, 1.0, 3, "logarithmic"), (0.0, 1.0, 1, "linear"), (0.0, 1.0, -2, "linear")],
)  # fmt: skip
def test_an_invalid_span_is_refused_with_what_was_expected(low: float, high: float, number: int, scale: str) -> None:
    with pytest.raises(UsageError, match=r"axis mass: .*expected"):
        span("mass", low, high, number, scale)  # type: ignore[arg-type]


def test_an_invalid_axis_is_refused() -> None:
    with pytest.raises(UsageError, match="axis mass: expected at least one value"):
        Axis(name="mass", targets=("plant.mass",), values=())
    with pytest.raises(UsageError, match=r"axis mass: .*positive number on a logarithmic scale"):
        Axis(name="mass", targets=("plant.mass",), low=0.0, high=1.0, scale="logarithmic")


@pytest.mark.parametrize(
    ("method", "samples", "expected"),
    [("random", 0, "at least 1"), ("sobol", -1, "at least 1"), ("sobol", 6, "power of two"),
     ("saltelli", 6, "power of two")],
)  # fmt: skip
def test_an_invalid_number_of_samples_is_refused(method: Method, samples: int, expected: str) -> None:
    with pytest.raises(UsageError, match=rf"design.samples = {samples}: expected .*{expected}"):
        sampled(method, samples=samples)
