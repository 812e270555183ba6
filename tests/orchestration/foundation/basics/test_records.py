"""A record is declared once: its constructor, its table in files, its schema and its flags follow from it."""

from fractions import Fraction

import numpy as np
import pytest

from orchestration.experiments.studies.axes import Axis
from orchestration.experiments.studies.study_file import DesignTable
from orchestration.foundation.basics.attribute_docs import attribute_docs
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import replaced
from orchestration.foundation.basics.times import exact_nanoseconds, is_at_least
from orchestration.foundation.basics.typed_tables import docs_of_keys, fields_of, parsed
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import TIMING_KEYS, Timing
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.file import ConnectionTable, SamplingTable, schema
from orchestration.systems.system.model import System
from tests.commands import Main


def test_a_whole_number_of_numpy_stays_one_and_a_float_stays_a_float() -> None:
    values = {"count": np.int64(3), "share": np.float64(3.0), "on": np.bool_(True), "name": "x"}
    kept = Component(fmu="tank.fmu", step=0.1, parameters=values).parameters
    assert {name: (value, type(value)) for name, value in kept.items()} == {
        "count": (3, int), "share": (3.0, float), "on": (True, bool), "name": ("x", str),
    }  # fmt: skip
    assert [type(value) for value in Axis(name="seed", values=np.arange(2)).values or ()] == [int, int]  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [2**63, -(2**63) - 1])
def test_a_whole_number_beyond_64_bits_is_refused_as_a_parameter(value: int) -> None:
    with pytest.raises(
        UsageError, match=r"^parameters\.n: expected a whole number from -2\^63 to 2\^63 - 1, or a float, as 1e19$"
    ):
        Component(fmu="tank.fmu", step=0.1, parameters={"n": value})


def test_docstrings_of_fields_are_read_without_importing_the_module() -> None:
    docs = attribute_docs("orchestration.systems.system.component", "Sampling")
    assert docs["offset"] == ("The time of the first instant [s], in its own time.", "0.0")
    assert docs["period"].default == ""
    assert attribute_docs("orchestration.systems.system.component", "Nobody") == {}


def test_a_table_has_the_keys_and_docstrings_of_its_record() -> None:
    assert [*fields_of(SamplingTable)] == [*attribute_docs("orchestration.systems.system.component", "Sampling"), "on"]
    assert {"from", "to", "name"} <= fields_of(ConnectionTable).keys()
    assert not {"start", "end", "stated"} & fields_of(ConnectionTable).keys()
    assert docs_of_keys(DesignTable)["seed"] == "The seed of the sampling."
    period = schema()["$defs"]["SamplingTable"]["properties"]["period"]
    assert period["description"] == attribute_docs("orchestration.systems.system.component", "Sampling")["period"].text


def test_the_help_of_a_flight_s_flags_is_the_docstrings_of_its_timing_record(main: Main) -> None:
    shown = letters(main("run", "--help").stdout)
    for key in TIMING_KEYS:
        text = attribute_docs("orchestration.quadrotor.scenarios.timing", "Timing")[key].text
        assert letters(text)[:15] in shown, key


def letters(text: str) -> str:
    return "".join(filter(str.isalnum, text))


def test_an_error_in_a_nested_record_names_its_place() -> None:
    with pytest.raises(UsageError, match=r"^components\.a = 3: expected a value made by Component\(…\)$"):
        System(stop_time=1.0, components={"a": 3})  # type: ignore[dict-item]
    with pytest.raises(UsageError, match=r"^sampling = 1.0: expected a value made by Sampling\(…\)$"):
        Component(fmu="a", sampling=1.0)  # type: ignore[arg-type]


def test_a_dictionary_stands_for_a_record_and_its_errors_are_those_of_the_record() -> None:
    assert Scenario(timing={}) == Scenario()  # type: ignore[arg-type]
    assert Scenario(timing={"period": 0.02}) == Scenario(timing=Timing(period=0.02))  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"^timing\.perod: no such key; .*did you mean period\?$"):
        Scenario(timing={"perod": 0.02})  # type: ignore[arg-type]


def test_whether_a_time_is_at_least_so_many_nanoseconds_is_decided_by_decimals() -> None:
    generator = np.random.default_rng(5)
    least = [1.0, 1.3, 0.7, 2.9999999999999996, *generator.uniform(0.1, 10.0, 200)]
    for nanoseconds in map(float, least):
        about = float(f"{nanoseconds!r}e-9")
        for seconds in (about, np.nextafter(about, 0.0), np.nextafter(about, 1.0), 0.5 * about, 2.0 * about):
            exact = exact_nanoseconds(float(seconds)) >= Fraction(repr(nanoseconds))
            assert is_at_least(float(seconds), nanoseconds) == exact
    Sampling(period=1.3e-9, clock_ratio=1.3)


def test_a_time_whose_last_digits_were_rounded_is_whole_nanoseconds_and_no_other_is() -> None:
    assert Sampling(period=12_000_000 * 1e-9).true_period == 12_000_000  # 0.012000000000000002
    for period in np.linspace(0.001, 0.02, 20):
        assert exact_nanoseconds(float(period)).denominator == 1
    assert exact_nanoseconds(0.3333333333333333) == Fraction(3333333333333333, 10**7)


def test_a_key_has_one_name_and_no_schema_has_another() -> None:
    with pytest.raises(UsageError, match=r"^design_seed: no such key; expected one of method, samples, seed"):
        parsed({"design_seed": 3}, DesignTable)
    assert parsed({"seed": 3}, DesignTable).design_seed == 3


def test_a_replaced_record_equals_a_new_one() -> None:
    first = System(stop_time=1.0, components={"a": Component(fmu="a.fmu", step=0.1)})
    assert first.fmus == {"a": "a.fmu"}  # computed from its values and cached
    moved = replaced(first, components={"a": replaced(first.components["a"], fmu="b.fmu")})
    assert moved == System(stop_time=1.0, components={"a": Component(fmu="b.fmu", step=0.1)})
    assert moved.fmus == {"a": "b.fmu"}
