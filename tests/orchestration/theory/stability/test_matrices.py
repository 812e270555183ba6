"""Components as matrices, and in coordinates that are their outputs, now and later."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from orchestration.components.fmi.reuse import Instances
from orchestration.theory.stability.linearised_component import Tangent
from orchestration.theory.stability.loop_at_rest import at_rest
from orchestration.theory.stability.matrices import (
    depends_on_step,
    in_continuous_time,
    in_output_coordinates,
    of_samples,
)
from tests.examples.common import native_example as example


@pytest.fixture(scope="module")
def tangents() -> Iterator[dict[str, Any]]:
    instances = Instances()
    with at_rest(example("double_integrator"), instances) as rest:
        yield rest.tangents
    instances.close()


def test_a_double_integrator_has_its_matrices(tangents: dict[str, Tangent]) -> None:
    found = in_continuous_time(tangents["plant"], 0.05)
    found = in_output_coordinates(found, expm(0.05 * found.A))
    assert found.unfit is None
    assert pytest.approx(np.array([[0.0, 1.0], [0.0, 0.0]]), abs=1e-9) == found.A
    assert pytest.approx(np.array([[0.0], [1.0]]), abs=1e-9) == found.B
    assert pytest.approx(np.eye(2), abs=1e-12) == found.C
    assert not found.D.any()


def test_a_law_without_memory_is_its_gains(tangents: dict[str, Tangent]) -> None:
    found = of_samples(tangents["controller"], 0.05)
    assert pytest.approx(np.array([[-1.0, -1.0]]), abs=1e-9) == found.D
    assert found.A.shape == (0, 0)
    assert not depends_on_step(tangents["controller"], 0.05)


class Stepped:
    """A stub of a tangent."""

    outputs, inputs, unit = ("y",), ("u",), None

    def __init__(self, flow: np.ndarray, feedthrough: float = 0.0, order: int | None = None) -> None:
        self._flow, self._through, self._order = flow, feedthrough, order
        self.state = np.zeros(len(flow) - 1)

    def derivatives(self, h: float) -> tuple[np.ndarray, np.ndarray]:
        n = len(self.state)
        after = expm(h * self._flow) if self._order is None else _series(h * self._flow, self._order)
        after = np.vstack([after[0], after[:n]])
        return after[:, :n], after[:, n:] + self._through * np.eye(n + 1, 1)


def _series(flow: np.ndarray, order: int) -> np.ndarray:
    return np.sum([np.linalg.matrix_power(flow, k) / math.factorial(k) for k in range(order + 1)], axis=0)


OSCILLATOR = np.array([[0.0, 3.0, 0.0], [-3.0, -0.2, 1.0], [0.0, 0.0, 0.0]])


def test_a_state_that_an_output_does_not_show_is_shown_a_period_later() -> None:
    tangent: Any = Stepped(OSCILLATOR, feedthrough=0.5)
    found = in_continuous_time(tangent, 0.1)
    found = in_output_coordinates(found, expm(0.3 * found.A))
    assert found.unfit is None
    assert pytest.approx(np.array([[1.0, 0.0]]), abs=1e-9) == found.C
    assert pytest.approx(np.array([[0.5]]), abs=1e-9) == found.D
    assert found.C @ expm(0.3 * found.A) == pytest.approx(np.array([[0.0, 1.0]]), abs=1e-9)
    assert np.linalg.eigvals(found.A) == pytest.approx(np.linalg.eigvals(OSCILLATOR[:2, :2]), abs=1e-9)


def test_steps_that_are_no_flow_are_refused_with_the_reason() -> None:
    tangent: Any = Stepped(OSCILLATOR, order=1)
    unfit = in_continuous_time(tangent, 0.1).unfit
    assert unfit is not None
    assert unfit.startswith("a step of 0.2 s differs from two of 0.1 s by ")


def test_steps_that_are_too_long_for_an_integrator_are_shortened_down_to_its_own() -> None:
    """A Runge-Kutta step of 50 ms is no flow to 1e-7, one of 3 ms is; the system takes steps of 2 ms."""
    tangent: Any = Stepped(OSCILLATOR, order=4)
    assert in_continuous_time(tangent, 0.05).unfit is not None
    found = in_continuous_time(tangent, 0.05, own=0.002)
    assert found.unfit is None
    assert np.linalg.eigvals(found.A) == pytest.approx(np.linalg.eigvals(OSCILLATOR[:2, :2]), abs=1e-7)
