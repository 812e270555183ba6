"""What documents are made of."""

import numpy as np
import pytest

from orchestration.basics.documents import plain


@pytest.mark.parametrize(
    ("value", "meant"), [(np.int64(3), 3), (np.bool_(True), True), (np.float32(0.5), 0.5), (np.array(2), 2)]
)
def test_scalars_of_numpy_are_those_of_python(value: object, meant: object) -> None:
    made = plain({"a": [value]})["a"][0]
    assert (made, type(made)) == (meant, type(meant))


@pytest.mark.parametrize("value", [np.float32("nan"), np.float64("inf")])
def test_numbers_of_numpy_that_are_not_finite_are_none(value: object) -> None:
    assert plain([value]) == [None]


def test_what_json_has_no_type_for_is_refused() -> None:
    with pytest.raises(TypeError, match="ndarray: no type that JSON has"):
        plain(np.array([1, 2]))
