"""What the tests of both slaves share: values by name, and how a failure speaks."""

from collections.abc import Callable, Mapping

from fmu_kit.failure import Failure
from fmu_kit.slave import Slave

BODY_OUT_OF_RANGE = [
    ("mass", 0.0, "> 0"),
    ("mass", -1.0, "> 0"),
    ("gravity", -9.81, ">= 0"),
    ("inertia.xx", -1.0, "a positive definite matrix"),
    ("inertia.yy", 0.0, "a positive definite matrix"),
    ("inertia.zz", -0.5, "a positive definite matrix"),
    ("inertia.xy", 1.5, "a positive definite matrix"),
    ("inertia.xz", -1.0, "a positive definite matrix"),
    ("inertia.yz", 2.0, "a positive definite matrix"),
]
"""Parameters of a rigid body, real or nominal, that are none, and what is expected of them"""


def put(slave: Slave, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        slave.set_real([slave._index[name]], [value])


def get(slave: Slave, *names: str) -> list[float]:
    return slave.get_real([slave._index[name] for name in names])


def assert_fails(call: Callable[[], object], *words: str) -> None:
    said = ""
    try:
        call()
    except Failure as failure:
        said = repr(failure)
    assert said, f"nothing failed with {words}"
    for word in words:
        assert word in said


def assert_initialisation_fails(slave: Slave, *words: str) -> None:
    """When it ends, where what belongs together has been set."""
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    assert_fails(slave.exit_initialization_mode, *words)


def named(name: str, value: float) -> tuple[str, str]:
    """How a message names a variable and its value; an inertia is shown whole."""
    group, _, entry = name.partition(".")
    return (group, f"{entry} {value:g}") if group == "inertia" else (f"{name} = {value}", str(value))
