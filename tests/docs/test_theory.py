"""What the findings say from theory is what the equations do; what they measure is measured rightly."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import quadcosim
from docs import theory
from docs.comparisons import read_data
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.systems.system.files import files_of
from orchestration.theory.exact.expect import expected_of
from orchestration.theory.exact.loops import Loops


@pytest.mark.parametrize("exponent", [1.0, 0.9, 0.5])
def test_a_spring_of_any_power_under_linear_damping_decays_exponentially_at_the_rate_expected(exponent: float) -> None:
    """ë + k ė + k k_s |e|^β_t sgn e = 0, swung through many times for each time constant."""
    k, stiffness, h = 0.2, 40.0, 2e-3

    def rates(x: np.ndarray) -> np.ndarray:
        return np.array([x[1], -k * x[1] - k * stiffness * np.sign(x[0]) * abs(x[0]) ** exponent])

    x, energies = np.array([1.0, 0.0]), []
    for _ in range(10000):
        middle = x + 0.5 * h * rates(x)
        x = x + h * rates(middle)
        energies.append(0.5 * x[1] ** 2 + k * stiffness * abs(x[0]) ** (1.0 + exponent) / (1.0 + exponent))
    falls = -np.diff(np.log(energies[::5000])) / (5000 * h)
    assert falls[0] / (1.0 + exponent) == pytest.approx(theory.expected_rate(exponent, k), rel=0.03)


def test_the_rate_of_the_linear_loop_is_that_of_its_slowest_mode() -> None:
    """k = k_t + β of the paper, β_t = 1: half of it, in continuous time without a coupling."""
    loop = HoverLoop.of(theory.PAPER.with_changes(parameters={"controller.coupling": 0.0}))
    A, B, F = loop.continuous()
    assert -np.linalg.eigvals(A + B @ F).real.max() == pytest.approx(theory.expected_rate(1.0), rel=1e-5)


def test_the_attitude_loop_by_itself_is_at_the_edge_at_its_limit() -> None:
    for k_theta, k_eta, k_q in ((15.0, 15.0, 15.0), (0.3, 0.2, 9.0)):
        T = theory.of_attitude_alone(k_theta, k_eta, k_q)
        K = np.array([[0.5 * (k_theta * k_eta + k_q), k_theta + 0.5 * k_eta]])
        radius = [
            np.abs(np.linalg.eigvals([[1.0, t], [0.0, 1.0]] - np.array([[0.5 * t * t], [t]]) @ K)).max()
            for t in (0.999 * T, 1.001 * T)
        ]
        assert radius[0] < 1.0 < radius[1]


def test_all_rates_together_scale_the_limit_of_the_period_inversely() -> None:
    """Times a factor in 1/s, its square in 1/s²: the same loop in another unit of time."""
    base = theory.PAPER.with_changes(parameters={"controller.coupling": 0.0})
    faster = theory.scaled(("k_θ", "k_η", "k_s", "k_t + β"), 2.0, base)
    faster = theory.scaled(("k_q",), 4.0, faster)
    loop = HoverLoop.of(base)
    assert loop.with_law(faster).spectral_radius(0.035, 0.0) == pytest.approx(loop.spectral_radius(0.07, 0.0), rel=1e-6)


def test_exponent_of_a_power_is_the_power_and_its_interval_holds_it_under_noise() -> None:
    factors = np.array(theory.FACTORS)
    assert theory.exponent_of(factors, 3.0 * factors**-0.7) == pytest.approx((-0.7, -0.7, -0.7), abs=1e-7)
    noise = np.exp(0.05 * np.random.default_rng(1).standard_normal(len(factors)))
    slope, low, high = theory.exponent_of(factors, factors**-0.7 * noise)
    assert low < -0.7 < high
    assert slope == pytest.approx(0.5 * (low + high))


def test_an_error_counts_as_inside_if_it_stays_so_for_a_while_before_the_end() -> None:
    """Rates are of what falls from one bound to the next, and stays below both."""
    names = [name for name in theory.decay_study().origin.objectives if name.startswith("within_")]
    late = theory.PAPER.stop_time - 1.0
    table = pd.DataFrame([[2.0, 4.0, 6.0, 6.0, late], [2.0, 4.0, late, None, None]], columns=names)
    times = theory.since(table)
    assert np.isnan(times).tolist() == [[False] * 4 + [True], [False] * 2 + [True] * 3]
    rate = math.log(10.0) / 2.0
    assert theory.rates_of(times) == pytest.approx(
        np.array([[rate, rate, math.nan, math.nan], [rate, math.nan, math.nan, math.nan]]), nan_ok=True
    )


def test_a_flight_with_the_papers_exponent_decays_and_one_with_a_small_exponent_does_not() -> None:
    base, (exponent, period, *_) = theory.decay_study().base, theory.decay_study().axes
    values = {exponent.targets[0]: [0.99, 0.7], period.targets[0]: 0.01}
    flights = pd.DataFrame(dict(quadcosim.fly(base, values)))
    times, remains = theory.since(flights), flights["remains"]
    rates = theory.rates_of(times)
    assert times[0, 2] == pytest.approx(7.55, abs=0.02)
    assert ((rates[0] > 1.0) & (rates[0] < 2.5)).all()
    assert np.isnan(times[1, 2])
    assert np.isnan(rates[1, 1:]).all()
    assert 1e-3 < remains[1] < 1e-2


@pytest.mark.parametrize("place", range(len(theory.ENERGIES)))
def test_the_energy_rises_along_the_flight_as_is_kept(place: int) -> None:
    kappa = theory.ENERGIES[place]
    kept = read_data("energy")["flights"][place]
    found = theory.rises_of(kappa, *theory.energy_over_time(kappa))
    assert {name: value for name, value in found.items() if value is not None} == pytest.approx(
        {name: value for name, value in kept.items() if value is not None}, rel=1e-4
    )


@pytest.mark.parametrize(("period", "delay"), [(0.011, 0.0), (0.04, 0.0225), (0.065, 0.01)])
def test_wind_about_hover_has_a_finite_cost_where_the_loop_is_stable_and_is_known_to_nine_digits(
    period: float, delay: float
) -> None:
    """The mean-square radius against the plant's own steps; the position nearly the same everywhere."""
    system = theory.in_wind(period, delay)
    found = expected_of(system, Loops(files_of(system).models))
    radius = HoverLoop.of(theory.PAPER).spectral_radius(period, delay)
    assert found.mean_square_radius == pytest.approx(radius**2, rel=1e-6)
    assert found.accuracy < 2e-9
    assert found.objectives["position_rmse"] == pytest.approx(0.000215, rel=0.03)


def test_runs_in_wind_have_the_command_that_is_expected() -> None:
    system = theory.in_wind(0.03)
    exact = expected_of(system, Loops(files_of(system).models)).objectives["torque_rms"]
    found = np.sqrt(
        np.mean([quadcosim.run(replace(system, seed=seed)).metrics["torque_rms"] ** 2 for seed in range(4)])
    )
    assert found == pytest.approx(exact, rel=0.02)
