"""What slaves may do: written out as C they answer as they do in Python, to the last bit and letter."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmu_kit.bundle import Target
from fmu_kit.compiler.emit.c_code import c_code
from fmu_kit.compiler.pack.building import modules_of
from fmu_kit.compiler.trace.tracing import trace
from fmu_kit.packaging import slave_class
from fmu_kit.variants import Variant
from tests.extent import sample, tries
from tests.fmu_kit.compiler.compiled import compiler
from tests.fmu_kit.compiler.probes import Pendulum, Zeros
from tests.fmu_kit.compiler.twins import InC, InPython, Values, answers, library

PROBES = ("Branches", "Arithmetic", "Integers", "Choices", "Memory", "Kept", "Below", "Loops", "Words")
NUMBERS = st.sampled_from([0.0, -0.0, 0.5, 1.0, -1.0, 2.0, 3.0, 7.25, 100.0, 1e3, 1e200, -1e308]) | st.floats(-8.0, 8.0)
INPUTS = st.fixed_dictionaries({"a": NUMBERS, "b": NUMBERS, "n": st.integers(-3, 12), "on": st.booleans()})
CHANGED = {"p": st.sampled_from([0.0, 2.0, -7.5, 13.0, 60.0, 200.0]), "mode": st.sampled_from([1, 2, 3, 0, 4])}
TUNED = st.fixed_dictionaries({}, optional=CHANGED)
STEPS = st.lists(st.tuples(INPUTS, TUNED).map(lambda both: both[0] | both[1]), max_size=5)
FIXED = st.fixed_dictionaries(
    {"q": st.sampled_from([0.25, 2.0, 1e-3])},
    optional={"times": st.sampled_from([0, 1, 9, 10, -1]), "mode": st.sampled_from([1, 3, 4])},
)


@pytest.fixture(scope="module", params=sample(PROBES, 3))
def probe(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Target, Path]:
    """Each slave in turn, and the library that it is compiled to."""
    compiler("cc")
    target = Target.parse(f"tests.fmu_kit.compiler.probes:{request.param}")
    return target, library(target, tmp_path_factory.mktemp("probe"))


def test_a_slave_in_c_answers_as_in_python(probe: tuple[Target, Path]) -> None:
    target, path = probe
    slave = slave_class(target)
    reset = InC.made(slave, path)

    @settings(derandomize=True, max_examples=tries(150, sampled=15), database=None)
    @given(start=INPUTS, fixed=FIXED, steps=STEPS)
    def answer_alike(start: Values, fixed: Values, steps: list[Values]) -> None:
        given = {**start, **fixed}
        expected = answers(InPython(slave(instance_name="probe")), given, steps)
        reset.fmu.reset()
        assert answers(reset, given, steps) == expected

    answer_alike()


@pytest.mark.parametrize(
    ("name", "mode"), sample([*((name, "as_it_is") for name in PROBES), ("Choices", "doubled")], 2)
)
def test_a_slave_with_values_that_are_fixed_answers_in_c_as_in_python(name: str, mode: str, tmp_path: Path) -> None:
    compiler("cc")
    fixed = Variant.of("Fixed", {"mode": mode, "times": 9, "p": 2.0})
    target = replace(Target.parse(f"tests.fmu_kit.compiler.probes:{name}"), variant=fixed)
    slave = slave_class(target)
    reset = InC.made(slave, library(target, tmp_path))

    @settings(derandomize=True, max_examples=tries(30, sampled=5), database=None)
    @given(start=INPUTS, q=st.sampled_from([0.25, 2.0, 1e-3]), steps=st.lists(INPUTS, max_size=5))
    def answer_alike(start: Values, q: float, steps: list[Values]) -> None:
        expected = answers(InPython(slave(instance_name="probe")), {**start, "q": q}, steps)
        reset.fmu.reset()
        assert answers(reset, {**start, "q": q}, steps) == expected

    answer_alike()


def test_what_fixed_values_turn_off_is_not_written_and_what_follows_from_them_has_no_place() -> None:
    target = Target.parse("tests.fmu_kit.compiler.probes:Choices")
    general, fixed = (
        trace(slave_class(each), modules_of(each))
        for each in (target, replace(target, variant=Variant.of("Fixed", {"mode": "turned", "p": 1.0})))
    )
    assert "self._offset" in {place.name for place in general.places}
    assert {place.name for place in fixed.places if place.reference is None} == {"self._stale", "self._start_time"}
    assert len(c_code(fixed)) < 0.8 * len(c_code(general))


def test_of_two_zeros_the_smaller_is_the_first_as_in_python(tmp_path: Path) -> None:
    compiler("cc")
    path = library(Target.parse("tests.fmu_kit.compiler.probes:Zeros"), tmp_path)
    pairs = [{"a": a, "b": b} for a in (0.0, -0.0) for b in (0.0, -0.0)]
    expected = answers(InPython(Zeros(instance_name="zeros")), {}, pairs)
    assert answers(InC.made(Zeros, path), {}, pairs) == expected
    assert [values[2:4] for values in expected[1:]] == [
        tuple(x.hex() for x in (first, first)) for first in (0.0, 0.0, -0.0, -0.0)
    ]


def test_a_model_that_initialises_without_its_base_starts_from_its_initial_values(tmp_path: Path) -> None:
    compiler("cc")
    path = library(Target.parse("tests.fmu_kit.compiler.probes:Pendulum"), tmp_path)
    given = {"initial.angle": 0.25, "initial.place.y": 3.0, "torque": 2.0}
    expected = answers(InPython(Pendulum(instance_name="pendulum")), given, [{}, {}])
    assert answers(InC.made(Pendulum, path), given, [{}, {}]) == expected
    assert [float.fromhex(values[Pendulum._index["angle"]]) for values in expected] == [0.25, 0.75, 1.25]
    assert float.fromhex(expected[0][Pendulum._index["height"]]) == 2.0 * math.cos(0.25) + 3.0
