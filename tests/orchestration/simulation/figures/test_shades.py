"""From which value to which the colours of a map go."""

import numpy as np
import pytest

from orchestration.simulation.figures.shades import is_wide, shades_of


def ends(*values: float) -> tuple[float, float]:
    shades = shades_of(np.array(values))
    assert shades is not None
    return shades.low, shades.high


def test_colours_go_from_the_least_value_to_the_largest() -> None:
    assert ends(2.0, np.nan, 1.0) == (1.0, 2.0)
    assert ends(-2.0, 1.0) == (-2.0, 1.0)


def test_next_to_no_variation_does_not_take_all_colours() -> None:
    low, high = ends(1.0, 1.0006)
    assert high - low == pytest.approx(0.05 * 1.0006)
    assert 0.5 * (low + high) == pytest.approx(1.0003)
    assert ends(-4.0, -4.0) == pytest.approx((-4.1, -3.9))


def test_orders_of_magnitude_are_told_apart_by_their_logarithms() -> None:
    shades = shades_of(np.array([0.01, 1.0]))
    assert shades is not None
    assert shades.logarithmic
    assert (shades.low, shades.high) == pytest.approx((0.01, 1.0))
    assert not is_wide(np.array([0.0, 1.0]))
    assert not is_wide(np.array([1.0, 50.0, np.inf]))


def test_a_few_values_far_off_do_not_take_the_colours_of_the_others() -> None:
    values = np.append(np.linspace(1.0, 2.0, 99), 9.0)
    shades = shades_of(values)
    assert shades is not None
    assert shades.high == pytest.approx(2.0, rel=0.02)
    assert shades.leaves_out == (True, True)


def test_what_is_nowhere_known_has_no_colours() -> None:
    assert shades_of(np.array([np.nan])) is None
