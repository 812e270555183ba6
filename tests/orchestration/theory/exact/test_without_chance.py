"""Without chance the mean-square radius is the square of the spectral radius that the master's own exchange makes."""

import math
from typing import Any

import pytest

from orchestration.components.fmi.reuse import Instances
from orchestration.theory.exact.expect import expect
from orchestration.theory.stability.period_map import growth_of_loop
from tests.examples.common import native_example as example
from tests.extent import sample

PERIOD, DELAY = "components.controller.sampling.period", "connections.command.delay"


@pytest.mark.parametrize(
    "changes",
    sample(
        [
            {},
            {DELAY: 0.7},
            {"connections.command.hold": "first", DELAY: 0.1},
            {"connections.measurement.delay": 0.13},
            {"connections.measurement.delay": 0.5, "connections.measurement.hold": "first"},
            {"connections.command.order": "jacobi", DELAY: 0.05},
            {"components.controller.sampling.offset": 0.2, "components.controller.sampling.clock_ratio": 1.25},
            {"connections.measurement.scale": 0.5},
        ],
        4,
    ),
    ids=sample(["prompt", "late", "first", "measured", "measured first", "jacobi", "clock", "scale"], 4),
)
def test_the_mean_square_radius_is_that_of_one_period_from_each_number(changes: dict[str, Any]) -> None:
    """As simulated: a first-order hold goes in steps of the plant, which both take."""
    system = example("double_integrator", {PERIOD: 0.4, "components.plant.step": 0.01, **changes})
    found, instances = expect(system, as_simulated=True), Instances()
    growth = growth_of_loop(system, instances)
    instances.close()
    assert found.mean_square_radius == pytest.approx(math.exp(2.0 * growth * found.period), rel=1e-8)
