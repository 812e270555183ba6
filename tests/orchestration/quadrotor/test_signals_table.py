"""The quadrotor's signals are those that it had before there were systems, to the bit."""

import json
from typing import Any

import pytest

from tests.orchestration.quadrotor.signals_table import TABLE, entry, fingerprint, flights, flown

SAME_MATHEMATICS = json.loads(TABLE.read_text(encoding="utf-8"))["fingerprint"] == fingerprint()


@pytest.mark.parametrize("expected", [expected for _, expected in flights()], ids=[name for name, _ in flights()])
def test_a_flight_is_that_of_the_table(expected: dict[str, Any]) -> None:
    found = entry(flown(expected["scenario"]))
    assert found["columns"] == expected["columns"]
    if SAME_MATHEMATICS:
        assert found == {key: value for key, value in expected.items() if key != "scenario"}
    else:  # another libm, another last digit
        assert found["number_of_rows"] == expected["number_of_rows"]
        assert found["last"] == pytest.approx(expected["last"], rel=1e-9, abs=1e-9)
