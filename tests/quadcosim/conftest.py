"""Flights that the tests of the API share."""

import pytest

import quadcosim
from quadcosim import Result, Scenario


def native(**fields: object) -> Scenario:
    """A short flight of native FMUs."""
    scenario = Scenario(**{"stop_time": 0.2, **fields})  # type: ignore[arg-type]
    return scenario.with_fmus(plant="native/QuadrotorPlant", controller="native/UnifiedController")


@pytest.fixture(scope="session")
def flown() -> Result:
    """A flight of 0.2 s."""
    return quadcosim.run(native())
