"""Intervals of shares, against the equation that defines them and the coverage that they state."""

import math
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.foundation.basics.statistics import first_end, pair_correlation, quantile, refutes, wilson
from quadcosim import UsageError


@given(st.integers(1, 2000), st.data(), st.sampled_from([0.5, 0.9, 0.95, 0.99]))
def test_at_its_ends_the_seen_share_is_z_standard_errors_away(trials: int, data: st.DataObject, level: float) -> None:
    seen = data.draw(st.integers(0, trials))
    z, share = NormalDist().inv_cdf(0.5 + 0.5 * level), seen / trials
    low, high = wilson(seen, trials, level)
    assert 0.0 <= low <= share <= high <= 1.0
    for end in (low, high):
        if 0.0 < end < 1.0:
            assert abs(share - end) == pytest.approx(z * math.sqrt(end * (1.0 - end) / trials), rel=1e-6, abs=1e-9)


def test_published_values() -> None:
    """Newcombe, Statistics in Medicine 17 (1998), table I, method 3: 81/263, 15/148, 0/20, 1/29."""
    for (seen, trials), ends in {
        (81, 263): (0.2553, 0.3662), (15, 148): (0.0624, 0.1605), (0, 20): (0.0, 0.1611), (1, 29): (0.0061, 0.1718),
    }.items():  # fmt: skip
        assert wilson(seen, trials) == pytest.approx(ends, abs=5e-5)


def test_the_correlation_of_pairs_is_that_of_their_table_towards_0() -> None:
    assert pair_correlation(36, 12, 2, 0) == -24 / math.sqrt(48 * 2 * 38 * 12)
    assert pair_correlation(20, 12, 2, 16) == (20 * 16 - 12 * 2 - 25) / math.sqrt(32 * 18 * 22 * 28)
    assert pair_correlation(1, 1, 0, 1) == pair_correlation(5, 0, 0, 0) == 0.0


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.97])
def test_the_interval_covers_the_share_about_as_often_as_stated(share: float) -> None:
    trials = 200
    covered = sum(
        math.comb(trials, k) * share**k * (1.0 - share) ** (trials - k)
        for k in range(trials + 1)
        if wilson(k, trials)[0] <= share <= wilson(k, trials)[1]
    )
    assert 0.93 < covered < 0.98


def test_a_share_is_refuted_if_so_few_successes_are_too_unlikely() -> None:
    """Of 29 with a share of 0.9, at most 23 succeed with probability 0.064, at most 22 with 0.022."""
    assert not refutes(23, 29, 0.9, 0.95)
    assert refutes(22, 29, 0.9, 0.95)
    assert refutes(23, 29, 0.9, 0.93)
    assert refutes(4464, 5000, 0.9, 0.95)
    assert not refutes(4466, 5000, 0.9, 0.95)
    assert not refutes(29, 29, 0.9, 0.05)


def test_the_interval_of_a_median_is_that_of_the_tables() -> None:
    found = quantile([float(k) for k in range(30, 0, -1)])
    assert found[:3] == (15.5, 10.0, 21.0)  # n = 30: the 10th and the 21st
    assert found.confidence == pytest.approx(0.957, abs=5e-4)


@pytest.mark.parametrize(("n", "share"), [(7, 0.5), (40, 0.9), (200, 0.1), (200, 0.5), (2000, 0.25)])
def test_the_ends_of_a_quantile_s_interval_are_the_innermost_of_the_binomial_distribution(n: int, share: float) -> None:
    from scipy.stats import binom  # not before: each process that collects would load it

    found = quantile([float(k) for k in range(1, n + 1)], share)
    low, high = found.low if math.isfinite(found.low) else 0, found.high if math.isfinite(found.high) else n + 1
    outside = binom.cdf([low - 1, low], n, share), binom.sf([high - 1, high - 2], n, share)
    for tail, wider in outside:
        assert tail <= 0.025 < wider
    assert found.confidence == pytest.approx(1.0 - outside[0][0] - outside[1][0], rel=1e-9)


def test_few_values_bound_nothing_and_many_cover_what_they_should() -> None:
    assert quantile([1.0, 2.0, 3.0, 4.0, 5.0])[:3] == (3.0, -math.inf, math.inf)
    generator = np.random.default_rng(0)
    found = (quantile(generator.normal(size=25).tolist()) for _ in range(400))
    inside = sum(low <= 0.0 <= high for _, low, high, _ in found)
    assert inside / 400 == pytest.approx(0.957, abs=0.03)


@pytest.mark.parametrize(
    ("seen", "trials", "level"), [(1, 0, 0.9), (3, 2, 0.9), (-1, 2, 0.9), (1, 2, 0.0), (1, 2, 1.0)]
)
def test_invalid_numbers_are_refused(seen: int, trials: int, level: float) -> None:
    with pytest.raises(UsageError, match="expected"):
        wilson(seen, trials, level)


def test_values_that_hold_again_beyond_the_first_end_do_not_move_it() -> None:
    assert first_end([0.1, 0.2, 0.3], [True, False, True]) == 0.1
    assert first_end([0.1, 0.2], [True, True]) == 0.2
    assert first_end([0.1, 0.2], [False, True]) is None
