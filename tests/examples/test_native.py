"""The slaves of the examples, written out as C, make the runs that they make in Python."""

from dataclasses import replace
from pathlib import Path

import pytest

from fmu_kit.compiler.pack.c_compiler import Mathematics
from orchestration.components.building import builder
from orchestration.simulation.runs.result import Result
from orchestration.simulation.runs.simulation import run
from orchestration.systems.system.model import System
from tests.examples.common import NAMES, example
from tests.extent import sample
from tests.native import assert_near, assert_the_same, natives

SHORTER = {
    "minimum_variance": 100.0,
    "double_integrator": 30.0,
    "four_components": 25.0,
    "lqg": 20.0,
    "distributed_servo": 3.0,
}
"""[s]; of runs that are long for the sake of their statistics"""


def system(name: str) -> System:
    """Of an example, with slaves in Python."""
    return example(name, {"stop_time": SHORTER[name]} if name in SHORTER else {})


def on_native(name: str, mathematics: Mathematics) -> Result:
    """Its run with the same slaves written out as C."""
    asked = system(name)
    places = {Path(each.fmu).resolve().parent for each in asked.components.values()}
    built = {k: v for place in places for k, v in natives(builder.slaves_of(place), mathematics).items()}
    components = {
        key: replace(each, fmu=str(built.get(Path(each.fmu).stem, each.fmu))) for key, each in asked.components.items()
    }
    return run(replace(asked, components=components))


@pytest.mark.parametrize("name", sample([*NAMES], 2))
def test_an_example_on_the_same_libm_is_the_same_to_the_byte_without_python_inside(name: str) -> None:
    found = on_native(name, "libm")
    assert len(found.rows) > 100
    assert_the_same(found, run(system(name)))


def test_an_example_on_its_own_mathematics_is_near() -> None:
    assert_near(on_native("dc_servo", "own"), run(system("dc_servo")), 1e-9)
