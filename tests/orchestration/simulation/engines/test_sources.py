"""Values from outside, over time."""

from fractions import Fraction

import numpy as np

from orchestration.foundation.basics.times import Grid, exact_nanoseconds
from orchestration.simulation.engines.sources import WhiteNoise


def test_white_noise_changes_where_the_instants_of_its_period_are():
    for period in (2 / 3, 1 / 3, 0.1, 7e-9 / 3):  # in nanoseconds some are rounded up, some down
        grid = Grid(Fraction(0), exact_nanoseconds(period))
        noise = WhiteNoise(1.0, period, 1, np.random.Generator(np.random.PCG64(1)))
        held = noise.over(np.array([grid[k] / 1e9 for k in range(100)])).ravel().tolist()
        assert len(set(held)) == 100
        assert held == [noise.at(grid[k] / 1e9)[0] for k in range(100)]
