"""Flights that the tests of the API share."""

import dataclasses
from typing import Any

import pytest

import quadcosim
from quadcosim import Result, Scenario
from tests.native import NATIVE


def native(**fields: Any) -> Scenario:
    """A short flight of native FMUs."""
    return dataclasses.replace(NATIVE, **{"stop_time": 0.2, **fields})


@pytest.fixture(scope="session")
def result() -> Result:
    """A flight of 0.2 s."""
    return quadcosim.run(native())
