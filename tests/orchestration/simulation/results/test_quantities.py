"""One rule for names, units and values of what is varied or set, wherever they are read."""

import pytest

from orchestration.foundation.basics.unit_algebra import quantity as text_of
from orchestration.simulation.results.quantities import is_in_seconds, quantity, setting


@pytest.mark.parametrize(
    ("values", "unit", "text"),
    [
        ([0.01, 0.999], "ms", "10 ms"),
        ([0.01, 1.0], "s", "0.01 s"),
        ([0.01, -1.0], "s", "0.01 s"),
        ([0.0, 0.01], "ms", "10 ms"),
        ([], "s", "0.01 s"),
        ([None, "none", True, 0.01], "ms", "10 ms"),
        ([0.0], "ms", "10 ms"),
        ([0.0, 0.99e-3], "µs", "10000 µs"),
        ([-2e-7], "ns", "1e+07 ns"),
    ],
)
def test_times_have_the_prefix_of_the_largest(values: list[object], unit: str, text: str) -> None:
    found = quantity("period", "s", values)
    assert (found.title, found.text_of(0.01)) == (f"period [{unit}]", text)
    assert found.of([0.01, 0.5]).tolist() == [0.01 * found.factor, 0.5 * found.factor]


def test_nothing_but_a_time_is_in_thousandths() -> None:
    assert quantity("mass", "kg", [0.01]).text_of(0.01) == "0.01 kg"
    assert quantity("share", None, [0.01]).title == "share"
    assert quantity("share", "1", [0.01]).text_of(0.123456789, 3) == "0.123"


@pytest.mark.parametrize(
    ("path", "unit", "title"),
    [
        ("timing.period", None, "period [ms]"),
        ("period", None, "period [ms]"),
        ("components.pilot.sampling.period", None, "period of pilot [ms]"),
        ("components.pilot.parameters.kp", None, "kp of pilot"),
        ("components.pilot.parameters.kp", "N.m", "kp of pilot [N·m]"),
        ("components.pilot.parameters.k_p", None, "k_p of pilot"),
        ("components.pilot.parameters.initial.gap", "m", "initial gap of pilot [m]"),
        ("computers.mcu.tasks.control.execution", None, "execution of mcu's task control [ms]"),
        ("computers.mcu.switch", None, "switch of mcu [ms]"),
        ("connections.valve.delay", None, "delay of valve [ms]"),
        ("connections.valve.offset", None, "offset of valve"),
        ("controller.delay", None, "delay"),
        ("plant.mass", None, "mass [kg]"),
    ],
)
def test_a_path_has_a_name_and_the_unit_of_a_store_or_that_which_is_known(
    path: str, unit: str | None, title: str
) -> None:
    assert setting(path, [0.01], unit).title == title


def test_what_a_parameter_is_in_its_fmu_says() -> None:
    assert not is_in_seconds("components.pilot.parameters.delay")
    assert not is_in_seconds("plant.delay")
    assert is_in_seconds("components.plant.step")


def test_a_value_between_two_roundings_is_the_same_in_figures_and_sentences() -> None:
    assert quantity("period", "s", [0.005278245]).text_of(0.005278245) == text_of(0.005278245, "s", 6)
