"""Local limits by radii at values that can be examined."""

import pytest

from orchestration.foundation.basics.bisection import Range
from orchestration.foundation.basics.errors import UsageError
from orchestration.theory.exact.examined_limit import by_examined

SPAN = Range(first=0.002, step=0.001, last=0.01, tolerance=1e-4)


def radius(value: float) -> float:
    """Examined are periods of hundredths of a millisecond; stable from 2.505 ms to 7.705 ms, and at 7.75 ms."""
    hundredths = value * 1e5
    if abs(hundredths - round(hundredths)) > 1e-6:
        raise UsageError("more than 200000 jobs")
    return 0.9 if 250.5 < hundredths < 770.5 or round(hundredths) == 775 else 1.1


@pytest.mark.parametrize("also", [(), (0.007391, 0.0074001)])
def test_a_value_that_cannot_be_examined_is_neither_stable_nor_unstable(also: tuple[float, ...]) -> None:
    found = by_examined(radius, Range(**{**vars(SPAN), "own": 0.005, "also": also}))
    assert found is not None
    assert found.limit is not None
    assert found.lower is not None
    assert found.accuracy is not None
    assert found.accuracy <= 1e-5
    assert found.limit == pytest.approx(0.007705, abs=found.accuracy)
    assert found.lower == pytest.approx(0.002505, abs=found.accuracy)
    assert ("7.391 ms for: more than 200000 jobs" in found.reason) == bool(also)


def test_where_nothing_between_can_be_examined_the_bracket_is_the_accuracy() -> None:
    def coarse(value: float) -> float:
        if round(value * 1e6) % 1000:
            raise UsageError("too long")
        return radius(value)

    found = by_examined(coarse, Range(**{**vars(SPAN), "own": 0.005}))
    assert found is not None
    assert (found.limit, found.accuracy) == pytest.approx((0.0075, 0.0005))
    assert "decay at 7 ms and grow at 8 ms, between which no value was found that can be examined" in found.reason


def test_without_a_value_that_can_be_examined_there_is_no_answer() -> None:
    def never(value: float) -> float:
        raise UsageError("too long")

    assert by_examined(never, SPAN) is None


def test_before_a_value_that_is_stable_by_itself_the_first_that_can_be_examined_counts() -> None:
    found = by_examined(radius, Range(**{**vars(SPAN), "tolerance": 2e-5, "own": 0.005, "also": (0.00775,)}))
    assert found is not None
    assert found.limit == pytest.approx(0.007705, abs=5e-6)
