"""What the tests of both slaves share: values by name, and how a failure speaks."""

from collections.abc import Callable, Mapping

import pytest

from fmu_kit.failure import Failure
from fmu_kit.slave import Slave


def put(slave: Slave, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        slave.set_real([slave._index[name]], [value])


def get(slave: Slave, *names: str) -> list[float]:
    return slave.get_real([slave._index[name] for name in names])


def assert_fails(call: Callable[[], object], *words: str) -> None:
    with pytest.raises(Failure) as caught:
        call()
    for word in words:
        assert word in repr(caught.value)


def named(name: str, value: float) -> tuple[str, str]:
    """How a message names a variable and its value; an inertia is shown whole."""
    group, _, entry = name.partition(".")
    return (group, f"{entry} {value:g}") if group == "inertia" else (f"{name} = {value}", str(value))
