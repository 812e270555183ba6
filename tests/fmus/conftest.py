"""What the tests of the packed FMUs share."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fmus.flights import FLIGHTS, STEPS, Flight
from tests.fmus.instance import Instance
from tests.fmus.making import MAKINGS, Making

OF_BOTH_MAKINGS = ("errors", "instances", "other_masters", "state", "times")
"""Modules of tests that hold for an FMU with Python inside and for the same slave written out as C."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run them for both, but for what is about the Python inside."""
    module = metafunc.module.__name__.rpartition(".test_")[2]
    if "built" in metafunc.fixturenames and module in OF_BOTH_MAKINGS and "python_inside" not in metafunc.fixturenames:
        metafunc.parametrize("making", MAKINGS, indirect=True, scope="session")


@pytest.fixture
def python_inside(making: Making) -> None:
    """Of a test that is about the ways of pythonfmu: it is run for that making alone."""
    assert not making.native


@pytest.fixture(scope="session")
def alone(built: dict[str, Path]) -> dict[str, list[list[str]]]:
    """Each flight with no other instance in the process, and no call too many."""
    flights = {}
    for name, flight in FLIGHTS.items():
        with Instance(built[flight.model]) as instance:
            flight.begin(instance)
            flights[name] = flight.fly(instance, 0, STEPS)
    return flights


@pytest.fixture(params=FLIGHTS)
def name(request: pytest.FixtureRequest) -> str:
    """Of each flight in turn."""
    return str(request.param)


@pytest.fixture
def flight(name: str) -> Flight:
    """Each in turn."""
    return FLIGHTS[name]


@pytest.fixture
def controller(built: dict[str, Path]) -> Iterator[Instance]:
    """Freshly instantiated."""
    with Instance(built["UnifiedController"]) as controller:
        yield controller


@pytest.fixture
def plant(built: dict[str, Path]) -> Iterator[Instance]:
    """Freshly instantiated."""
    with Instance(built["QuadrotorPlant"]) as plant:
        yield plant
