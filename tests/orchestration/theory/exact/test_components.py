"""Components as matrices: what rounding may do to coordinates that are nearly dependent."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.exact import components
from orchestration.theory.stability.matrices import Continuous

ROUGH = 2e-8


def decaying(h: float) -> tuple[Floats, Floats]:
    """The derivatives of an output and its state, the latter rounded as coarsely as its coordinate is."""
    after = np.exp(-h) + ROUGH * (-1.0) ** round(h / 0.01)
    return np.array([[after], [after]]), np.full((2, 1), 1.0 - np.exp(-h))


@pytest.mark.parametrize(
    ("rounding", "precision", "method"),
    [(0.0, 3.0 * ROUGH, "saved states, by differences"), (1e-7, 1e-7, "saved states, to rounding")],
)
def test_a_step_that_differs_from_two_of_half_its_length_is_known_as_accurately_unless_coordinates_round_so(
    rounding: float, precision: float, method: str
) -> None:
    tangent = SimpleNamespace(
        inputs=("u",), outputs=("y",), unit=0.01, accuracy=0.0, rounding=rounding, derivatives=decaying
    )
    fixed = SimpleNamespace(model=SimpleNamespace(varies_step=False))
    plant = SimpleNamespace(sampling=None, step=0.01, fmu="plant.fmu")
    simulation = SimpleNamespace(system=SimpleNamespace(components={"plant": plant}), instances={"plant": fixed})
    loop: Any = SimpleNamespace(simulation=simulation, tangent=lambda name: tangent)
    found = components._identified(loop, "plant")
    assert isinstance(found.part, Continuous)
    assert (found.part.unfit, found.method) == (None, method)
    assert found.precision == pytest.approx(precision, rel=0.02)
    assert found.accuracy == (components.ROUNDING if rounding else found.precision)
