"""Runs of random loops print on average what is expected of them."""

import pytest

from benchmarks.random_loops import compare_means, random_loop
from orchestration.theory.exact.expect import expect
from tests.extent import sample


@pytest.mark.parametrize("number", sample([3, 11, 53], 1))
def test_means_over_runs_are_within_three_standard_errors_of_what_is_expected(number: int) -> None:
    """A punctual servo, two rates with commands more than a period late, and measurements that are lost in bursts."""
    system = random_loop(number)
    found = expect(system, as_simulated=True)
    assert found.fourth_moment_radius is not None
    assert found.fourth_moment_radius < 0.95
    for mean, error, exact in compare_means(system, found, runs=48).values():
        assert 0.0 < error < 0.2 * exact
        assert abs(mean - exact) < 3.0 * error
