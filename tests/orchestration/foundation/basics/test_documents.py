"""JSON values of documents."""

import numpy as np
import pytest

from orchestration.foundation.basics.documents import plain, toml_of
from orchestration.foundation.basics.errors import UsageError


@pytest.mark.parametrize(
    ("value", "expected"), [(np.int64(3), 3), (np.bool_(True), True), (np.float32(0.5), 0.5), (np.array(2), 2)]
)
def test_scalars_of_numpy_become_those_of_python(value: object, expected: object) -> None:
    converted = plain({"a": [value]})["a"][0]
    assert (converted, type(converted)) == (expected, type(expected))


@pytest.mark.parametrize("value", [np.float32("nan"), np.float64("inf")])
def test_numpy_numbers_that_are_not_finite_become_none(value: object) -> None:
    assert plain([value]) == [None]


def test_values_without_a_json_type_are_refused() -> None:
    with pytest.raises(TypeError, match="ndarray: no type that JSON has"):
        plain(np.array([1, 2]))


@pytest.mark.parametrize(
    ("line", "end"),
    [
        ("delay = 1ms", r"column 10\); 1ms: expected a number without its unit; times are in seconds$"),
        ("sampling = { period = 0.2 ms }", r"; 0\.2 ms: expected a number without its unit; times are in seconds$"),
        ("x2b = [1, -3e2 kg] # 1ms", r"; -3e2 kg: expected a number without its unit$"),
        ("fmu = 2ms.fmu", r"column 8\)$"),
        ("x = ", r"\)$"),
    ],
)
def test_a_number_with_its_unit_in_a_file_is_told_as_such(line: str, end: str) -> None:
    with pytest.raises(UsageError, match=end):
        toml_of(f"a = 1\n{line}\nb = 2\n", "system.toml")
