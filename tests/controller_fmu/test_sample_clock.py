"""The sample clock: due times on a grid that does not drift, whatever the master does to time."""

from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller_fmu.sampled import SampleClock


def samples(clock: SampleClock, points: Iterable[float]) -> list[int]:
    """The numbers of the communication points at which `clock` samples."""
    return [i for i, t in enumerate(points) if clock.is_due(t)]


def started(period: float, offset: float = 0.0, start: float = 0.0) -> SampleClock:
    clock = SampleClock(period, offset)
    clock.start(start)
    return clock


def accumulated(step: float, count: int) -> list[float]:
    """Communication points of a master that adds up its steps."""
    t, points = 0.0, []
    for _ in range(count):
        points.append(t)
        t += step
    return points


@pytest.mark.parametrize("every", [1, 2, 5, 10, 50])
def test_time_added_up_30000_times_drifts_through_no_due_time(every: int) -> None:
    points = accumulated(0.001, 30000)
    assert points[-1] != 29999 * 0.001  # the drift is there
    assert samples(started(every * 0.001), points) == list(range(0, 30000, every))


@given(st.lists(st.floats(-1e-12, 1e-12), min_size=50, max_size=50), st.integers(0, 100000))
def test_changing_errors_of_the_masters_time_do_not_matter(errors: list[float], first: int) -> None:
    points = [(first + k) * 0.001 + error for k, error in enumerate(errors)]
    expected = [k for k in range(50) if (first + k) % 10 == 0]
    assert samples(started(0.01, start=first * 0.001), points) == expected


@pytest.mark.parametrize("leftover", [1e-13, 1e-12, 1e-9])
def test_tiny_last_step_adds_no_second_sample(leftover: float) -> None:
    """Some masters stop short of the stop time and make up for it."""
    clock = started(0.01)
    assert samples(clock, [0.0, 0.01, 0.02 - leftover, 0.02]) == [0, 1, 2]


def test_point_clearly_before_a_due_time_is_not_on_it() -> None:
    clock = started(0.01)
    assert samples(clock, [0.0, 0.01 - 1e-7, 0.01]) == [0, 2]


def test_sample_is_due_once() -> None:
    clock = started(0.01)
    assert [clock.is_due(0.0), clock.is_due(0.0)] == [True, False]


def test_late_sample_does_not_shift_the_grid() -> None:
    clock = started(0.01)
    assert samples(clock, [0.0, 0.019, 0.0195, 0.02, 0.029, 0.03]) == [0, 1, 3, 5]


@pytest.mark.parametrize(("start", "first"), [(5.0, 0), (5.003, 7), (4.9999999999, 0), (5.0000000001, 0)])
def test_due_times_before_a_later_start_are_past(start: float, first: int) -> None:
    """A start on the grid, to within rounding, is itself a sample."""
    points = [start + k * 0.001 for k in range(20)]
    assert samples(started(0.01, start=start), points) == [first, first + 10]


def test_period_of_zero_samples_at_every_communication_point() -> None:
    points = [0.0, 1e-13, 0.003, 0.0030001, 7.0]
    assert samples(started(0.0), points) == [0, 1, 2, 3, 4]


def test_long_gap_leaves_no_backlog() -> None:
    clock = started(0.01)
    assert samples(clock, [0.0, 1.0, 1.001, 1.002, 1.01]) == [0, 1, 4]


def test_clock_goes_on_from_a_saved_index() -> None:
    points = [k * 0.003 for k in range(200)]
    clock = started(0.01, offset=0.002)
    before = samples(clock, points[:77])
    resumed = SampleClock(0.01, 0.002, clock.next_index)
    after = [77 + i for i in samples(resumed, points[77:])]
    assert before + after == samples(started(0.01, offset=0.002), points)


@given(
    period=st.integers(1, 5000),
    step=st.integers(1, 5000),
    offset=st.integers(0, 20000),
    start=st.integers(0, 10**7),
    unit=st.sampled_from([1e-3, 1e-4, 1e-5]),
)
def test_samples_are_those_of_exact_arithmetic(period: int, step: int, offset: int, start: int, unit: float) -> None:
    """In whole units of time there is no rounding, and no point is closer to a due time without being on it."""
    ticks = [start + k * step for k in range(60)]
    next_due = max(0, -((offset - start) // period))  # k of the first due time from the start on
    expected = []
    for i, tick in enumerate(ticks):
        if tick >= offset + next_due * period:
            expected.append(i)
            next_due = (tick - offset) // period + 1
    clock = started(period * unit, offset * unit, start * unit)
    assert samples(clock, [tick * unit for tick in ticks]) == expected


@given(st.floats(1e-4, 1.0), st.floats(1e-4, 1.0))
def test_no_two_samples_fall_into_one_period_of_the_grid(period: float, step: float) -> None:
    points = [k * step for k in range(200)]
    periods = [points[i] / period for i in samples(started(period), points)]
    slots = [int(p + 1e-6) for p in periods]
    assert len(set(slots)) == len(slots)
    assert len(slots) >= min(200, int(points[-1] / period))


@pytest.mark.parametrize("offset", [0.0, 1e-9, 0.02])
def test_without_a_period_every_point_from_the_offset_on_is_a_sample(offset: float) -> None:
    points = [0.0, offset / 2.0, offset * (1.0 - 1e-13), offset, offset + 0.01]
    assert samples(started(0.0, offset), points) == ([2, 3, 4] if offset else [0, 1, 2, 3, 4])
