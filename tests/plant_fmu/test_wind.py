"""The wind against what its equation implies."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmu_kit.algebra import Vec3
from orchestration.simulation.engines.sources import NUMPY
from plant_fmu.wind import Wind

component = st.floats(-5.0, 5.0)
vectors = st.builds(Vec3, component, component, component)


@given(vectors, st.floats(0.1, 3.0), st.floats(0.0, 100.0))
def test_wind_starts_at_its_amplitude_and_turns_with_its_frequency(amplitude: Vec3, frequency: float, t: float) -> None:
    """A function of f(0) = a with f(x + y) + f(x - y) = 2 f(x) cos ωy, seen over sixths of its period."""
    wind = Wind(amplitude=amplitude, frequency=frequency)
    sixth = math.pi / (3.0 * frequency)  # cos ωy = ½
    assert wind.force(0.0) == amplitude
    both = wind.force(t + sixth) + wind.force(t - sixth)
    assert list(both) == pytest.approx(list(wind.force(t)), rel=0.0, abs=1e-11)
    assert list(wind.force(1.5 * sixth)) == pytest.approx([0.0] * 3, abs=1e-14)


def test_wind_of_the_paper() -> None:
    """0.01 N on each axis, 0.1 rad/s."""
    assert list(Wind().force(0.0)) == [0.01, 0.01, 0.01]
    assert list(Wind().force(5.0 * math.pi)) == pytest.approx([0.0] * 3, abs=1e-15)
    times = np.array([0.0, 1.0, 2.0])
    np.testing.assert_allclose(Wind().force(times, NUMPY).y, 0.01 * np.cos(0.1 * times), rtol=1e-15)
