"""The slaves of the examples, short as they are, make FMUs with which nothing is wrong."""

import pytest

from orchestration.components.building import fmus
from orchestration.components.checks.validation.validator import validate
from tests.places import EXAMPLES


@pytest.mark.parametrize("name", ["water_tank/TankController", "dc_servo/PidController", "four_components/Car"])
def test_validation_finds_nothing_of_an_example(name: str) -> None:
    """One with a threshold and a Boolean, one with an internal state, one with several inputs."""
    assert [finding for finding in validate(fmus.locate(str(EXAMPLES / f"{name}.fmu"))) if not finding.note] == []
