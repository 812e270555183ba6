"""Dryden gusts: their spectra are those of the formulas, and a seed gives the same gusts again."""

import math
from itertools import pairwise

import numpy as np
import pytest

from orchestration.simulation.engines.sources import gusts
from orchestration.systems.signals.dryden import DRAWS, FOOT, Dryden

STEP = 0.05
AIR = Dryden(wind_speed=8.0, height=20.0, airspeed=6.0, step=STEP)


def stream(seed: int = 1) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def spectrum(air: Dryden, axis: int, omega: np.ndarray) -> np.ndarray:
    """One-sided, by ω [rad/s], as MIL-F-8785C prints it for Ω = ω/V."""
    sigma, length = air.intensities()[axis], air.lengths()[axis]
    x2 = (length * omega / air.airspeed) ** 2
    shape = 2.0 / (1.0 + x2) if axis == 0 else (1.0 + 3.0 * x2) / (1.0 + x2) ** 2
    return sigma**2 * length / (math.pi * air.airspeed) * shape


def test_intensities_and_lengths_are_those_of_the_low_altitude_model() -> None:
    feet = 20.0 / FOOT
    assert AIR.intensities()[2] == pytest.approx(0.8)
    assert AIR.intensities()[0] == AIR.intensities()[1] == pytest.approx(0.8 / (0.177 + 0.000823 * feet) ** 0.4)
    assert AIR.lengths()[0] == AIR.lengths()[1] == pytest.approx(20.0 / (0.177 + 0.000823 * feet) ** 1.2)
    assert AIR.lengths()[2] == 20.0
    top = Dryden(height=1000.0 * FOOT)  # where the model joins that of medium altitude: the same in all directions
    assert top.lengths()[0] == pytest.approx(top.lengths()[2])
    assert top.intensities()[0] == pytest.approx(top.intensities()[2])


def test_the_spectra_are_those_of_the_formulas() -> None:
    """Periodograms of many stretches, averaged over stretches and bands, over the spectrum as it is sampled.

    The mean of n independent ordinates has the relative standard deviation 1/√n; none of 12 bands on three axes may
    be 4.5 of them off, which happens once in 4,000 times where all is right.
    """
    count, stretches = 2048, 32
    values = np.array(AIR.velocities(stream().standard_normal((count * stretches, DRAWS)).tolist()))
    window = np.hanning(count)[:, None]
    found = np.abs(np.fft.rfft(values.reshape(stretches, count, 3) * window, axis=1)) ** 2
    found *= STEP / (math.pi * (window**2).sum())
    omega = 2.0 * math.pi * np.fft.rfftfreq(count, STEP)
    bands = np.unique(np.geomspace(4, len(omega) - 2, 13).astype(int))
    for axis in range(3):
        turns = 2.0 * math.pi / STEP * np.arange(-60, 61)[:, None]
        aliased = spectrum(AIR, axis, np.abs(omega + turns)).sum(axis=0)
        for low, high in pairwise(bands):
            ratio = (found[:, low:high, axis] / aliased[low:high]).mean()
            independent = stretches * max(1.0, (high - low) / 1.9)  # neighbours under the window share what they see
            assert abs(ratio - 1.0) < 4.5 / math.sqrt(independent) + 0.01


@pytest.mark.parametrize("step", [1e-4, 0.05, 0.7])
def test_values_at_the_steps_have_the_correlation_of_the_continuous_process(step: float) -> None:
    """Exactly, from the answers to one draw at a time: R(τ) = σ² e^{-θ}, and σ² e^{-θ} (1 - θ/2), with θ = τV/L."""
    air, count = Dryden(height=5.0, airspeed=6.0, step=step), 4
    draws = np.eye(count * DRAWS).reshape(-1, count, DRAWS)
    answers = np.array([air.velocities(each.tolist()) for each in draws])
    for axis, (sigma, length) in enumerate(zip(air.intensities(), air.lengths(), strict=True)):
        found = answers[:, :, axis].T @ answers[:, :, axis] / sigma**2
        theta = np.abs(np.subtract.outer(range(count), range(count))) * step * 6.0 / length
        expected = np.exp(-theta) * (1.0 if axis == 0 else 1.0 - 0.5 * theta)
        assert found == pytest.approx(expected, abs=1e-13)


def test_the_mean_wind_blows_in_its_direction_and_gusts_turn_with_it() -> None:
    draws = stream().standard_normal((50, DRAWS)).tolist()
    north, east = (np.array(Dryden(direction=a, steady=3.0).velocities(draws)) for a in (0.0, 0.5 * math.pi))
    assert east[:, 1] == pytest.approx(north[:, 0])
    assert east[:, 0] == pytest.approx(-north[:, 1])
    calm = np.array(Dryden(wind_speed=0.0, steady=3.0, direction=0.3).velocities(draws))
    assert calm == pytest.approx(np.tile([3.0 * math.cos(0.3), 3.0 * math.sin(0.3), 0.0], (50, 1)))


def test_a_seed_gives_the_same_gusts_again_and_a_longer_run_begins_with_them() -> None:
    short, long, other = (gusts(AIR, stop, stream(seed)) for stop, seed in ((3.0, 1), (9.0, 1), (3.0, 2)))
    count = len(short.columns)
    assert (long.columns[:count] == short.columns).all()
    assert not (other.columns == short.columns).any()
    times = np.linspace(0.0, 3.0, 301)
    assert (short.at_each(times) == np.array([short.at(t) for t in times.tolist()])).all()
