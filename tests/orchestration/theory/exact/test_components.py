"""Components as matrices: what rounding may do to them."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orchestration.foundation.basics.simulator import Floats
from orchestration.theory.exact import components
from orchestration.theory.stability.matrices import Continuous

ROUGH = 2e-8


def identified(rounding: float, rough: float = ROUGH) -> components.IdentifiedComponent:
    """A plant whose state is off by so much, in turn up and down, and its tangent said to be by `rounding`."""

    def decaying(h: float) -> tuple[Floats, Floats]:
        after = np.exp(-h) + rough * (-1.0) ** round(h / 0.01)
        return np.array([[after], [after]]), np.full((2, 1), 1.0 - np.exp(-h))

    tangent = SimpleNamespace(
        inputs=("u",),
        outputs=("y",),
        unit=0.01,
        accuracy=0.0,
        rounding=rounding,
        derivatives=decaying,
        noise=(np.zeros((2, 1)), np.zeros((2, 1))),
    )
    fixed = SimpleNamespace(model=SimpleNamespace(varies_step=False))
    plant = SimpleNamespace(sampling=None, step=0.01, fmu="plant.fmu")
    simulation = SimpleNamespace(system=SimpleNamespace(components={"plant": plant}), instances={"plant": fixed})
    loop: Any = SimpleNamespace(simulation=simulation, tangent=lambda name: tangent)
    return components._identified(loop, "plant")


@pytest.mark.parametrize(("rounding", "error"), [(0.0, 3.0 * ROUGH), (1e-7, 1e-7)])
def test_a_step_that_differs_from_two_of_half_its_length_is_known_as_accurately_unless_coordinates_round_so(
    rounding: float, error: float
) -> None:
    found = identified(rounding)
    assert isinstance(found.part, Continuous)
    assert (found.part.unfit, found.method) == (None, "saved states, by differences")
    assert found.accuracy == (components.ROUNDING if rounding else pytest.approx(error, rel=0.02))
    steps = [one.step for one in (found.part, *found.others) if isinstance(one, Continuous) and one.step]
    known, *others = (step(0.01)[0] for step in steps)
    apart = [other - known for other in others]
    assert 0.1 * error < np.abs(apart).max() < 4.0 * error


@pytest.mark.parametrize(("rounding", "is_fit"), [(1e-9, False), (1e-6, True)])
def test_a_plant_is_refused_as_not_linear_only_where_it_differs_by_more_than_rounding_may(
    rounding: float, is_fit: bool
) -> None:
    """Steps differ by 3e-6 here, more than is allowed of one that is measured precisely."""
    found = identified(rounding, rough=1e-6)
    assert isinstance(found.part, Continuous)
    assert (found.part.unfit is None) == is_fit
    assert found.accuracy == pytest.approx(3e-6, rel=0.02)
