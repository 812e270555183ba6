"""Times of a flight: their rounding, the laws of what is random, and what is refused."""

import functools
import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestration.command import cli
from orchestration.command.flags import FlightFlags
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.times import Grid, nanoseconds
from orchestration.quadrotor.scenarios.timing import TIMING_KEYS, Timing
from orchestration.systems.schedule import instant_arrays
from orchestration.systems.schedule.instant_arrays import INSTANTS, Cursor
from quadcosim import Scenario
from tests.extent import tries
from tests.orchestration.quadrotor.scenarios import stubs
from tests.orchestration.quadrotor.scenarios.strategies import Case, cases
from tests.orchestration.quadrotor.scenarios.stubs import Instant, Sample

COMMANDS = cli.command_line().commands


def cursor_of(case: Case) -> Cursor:
    return stubs.cursor_of(case.timing, case.stop_time, case.seed)


def instants_of(case: Case) -> list[Instant]:
    return list(stubs.instants_of(cursor_of(case)))


def samples_of(case: Case) -> list[Sample]:
    return [instant.sample for instant in instants_of(case) if instant.sample is not None]


def many(timing: dict[str, Any], count: int, seed: int = 1) -> list[Sample]:
    """`count` samples a millisecond apart, the plant's own points out of the way."""
    return samples_of(Case(Timing(period=1e-3, plant_interval=100.0, **timing), count * 1e-3, seed))


# -- rounding -----------------------------------------------------------------------------


@given(
    st.builds(Fraction, st.integers(0, 10**15), st.integers(1, 10**6)),
    st.builds(Fraction, st.integers(1, 10**15), st.integers(1, 10**6)),
    st.integers(0, 10**15),
)
def test_instants_do_not_drift_however_far_they_are(offset: Fraction, period: Fraction, k: int) -> None:
    grid = Grid(offset, period)
    assert grid[k] == round(offset + k * period)
    first = k % 10**5
    assert grid.between(first, first + 3).tolist() == [grid[first + i] for i in range(3)]


@given(st.integers(0, 10**9), st.integers(1, 10**9), st.integers(0, 10**9))
def test_an_instant_between_two_nanoseconds_is_at_the_even_one(offset: int, period: int, k: int) -> None:
    doubled = offset + k * period
    lower = doubled // 2
    grid = Grid(Fraction(offset, 2), Fraction(period, 2))
    assert grid[k] == lower + (doubled % 2 and lower % 2)
    assert grid.between(k, k + 1).tolist() == [grid[k]]


# -- jitter -----------------------------------------------------------------------


@pytest.mark.parametrize("distribution", ["uniform", "normal"])
def test_jitter_reaches_all_of_its_range_around_its_middle(distribution: str) -> None:
    timing = {"jitter": 0.9e-3, "jitter_distribution": distribution}
    late = np.array([s.time - s.k * 1_000_000 for s in many(timing, 4000)]) / 900_000
    deviation = 1 / math.sqrt(12) if distribution == "uniform" else 0.1644  # of a normal one cut at three σ
    assert abs(late.mean() - 0.5) < 5 * deviation / math.sqrt(len(late))
    assert abs(late.std() - deviation) < 0.01
    assert late.min() < 0.1
    assert late.max() > 0.9


# -- losses -----------------------------------------------------------------------------------------------


def lost_commands(samples: list[Sample]) -> np.ndarray:
    return np.array([sample.arrival is None for sample in samples])


def lost_measurements(samples: list[Sample]) -> np.ndarray:
    return np.array([sample.measurement_lost for sample in samples])


LOSSES = [("measurement_loss", lost_measurements), ("command_loss", lost_commands)]
Losses = Callable[[list[Sample]], np.ndarray]


@functools.cache
def lossy(probability: float, count: int, burst_length: float | None = None) -> list[Sample]:
    """Samples of which as many measurements as commands are lost, by draws of their own."""
    timing = {"measurement_loss": probability, "command_loss": probability, "burst_length": burst_length}
    return many(timing, count)


@pytest.mark.parametrize("probability", [0.02, 0.3, 0.9])
@pytest.mark.parametrize("lost", [lost_measurements, lost_commands])
def test_independent_losses_have_their_probability(lost: Losses, probability: float) -> None:
    flags = lost(lossy(probability, 10_000))
    assert abs(flags.mean() - probability) < 5 * math.sqrt(probability * (1 - probability) / len(flags))


@pytest.mark.parametrize("lost", [lost_measurements, lost_commands])
def test_independent_losses_do_not_remember(lost: Losses) -> None:
    flags = lost(lossy(0.3, 10_000))
    after_a_loss = flags[1:][flags[:-1]]
    assert abs(after_a_loss.mean() - 0.3) < 5 * math.sqrt(0.21 / len(after_a_loss))


@pytest.mark.parametrize(("key", "lost"), LOSSES)
@pytest.mark.parametrize("burst", [None, 4.0])
def test_probabilities_zero_and_one_lose_nothing_and_everything(key: str, lost: Losses, burst: float | None) -> None:
    assert not lost(many({key: 0.0, "burst_length": burst}, 100)).any()
    assert lost(many({key: 1.0, "burst_length": burst}, 100)).all()


@pytest.mark.parametrize(("probability", "length"), [(0.2, 5.0), (0.05, 2.0), (0.6, 3.0)])
@pytest.mark.parametrize("lost", [lost_measurements, lost_commands])
def test_bursts_have_their_loss_rate_and_mean_length(lost: Losses, probability: float, length: float) -> None:
    flags = lost(lossy(probability, 20_000, length))
    remembered = 1 - 1 / length - probability / (length * (1 - probability))  # correlation of neighbours
    spread = probability * (1 - probability) / len(flags) * (1 + remembered) / (1 - remembered)
    assert abs(flags.mean() - probability) < 5 * math.sqrt(spread)
    bursts = [len(list(group)) for is_lost, group in itertools.groupby(flags) if is_lost]
    assert abs(np.mean(bursts) - length) < 5 * math.sqrt(length * (length - 1) / len(bursts)) + 0.01


def test_the_chain_of_bursts_starts_in_its_stationary_distribution() -> None:
    timing = Timing(command_loss=0.3, burst_length=10.0)
    runs = tries(1000, sampled=250)
    first = [samples_of(Case(timing, 0.005, seed))[0].arrival is None for seed in range(runs)]
    assert abs(np.mean(first) - 0.3) < 5 * math.sqrt(0.21 / runs)


# -- seeds and streams ------------------------------------------------------------------------------------

CAUSES: dict[str, Any] = {"jitter": 0.4e-3, "delay_jitter": 0.3e-3, "measurement_loss": 0.3, "command_loss": 0.4}


def drawn(samples: list[Sample]) -> dict[str, list[Any]]:
    """What each cause decided; delays are short enough that no command waits for another."""
    return {
        "jitter": [sample.time - sample.k * 1_000_000 for sample in samples],
        "delay_jitter": [None if s.arrival is None else s.arrival - s.sent for s in samples],
        "measurement_loss": [sample.measurement_lost for sample in samples],
        "command_loss": [sample.arrival is None for sample in samples],
    }


@pytest.mark.parametrize("cause", CAUSES)
def test_another_seed_gives_others(cause: str) -> None:
    timing = {cause: CAUSES[cause]}
    assert drawn(many(timing, 100, seed=1))[cause] != drawn(many(timing, 100, seed=2))[cause]


@pytest.mark.parametrize("burst", [None, 3.0])
@pytest.mark.parametrize("switched", CAUSES)
def test_switching_one_cause_off_leaves_the_numbers_of_the_others(switched: str, burst: float | None) -> None:
    with_all = drawn(many({**CAUSES, "burst_length": burst}, 300))
    without = drawn(many({**CAUSES, "burst_length": burst, switched: 0.0}, 300))
    for cause in set(CAUSES) - {switched, "delay_jitter"}:
        assert without[cause] == with_all[cause]
    if switched != "delay_jitter":
        both = [
            (one, other)
            for one, other in zip(with_all["delay_jitter"], without["delay_jitter"], strict=True)
            if one is not None and other is not None
        ]
        assert len(both) > 100
        assert all(one == other for one, other in both)


@given(cases(), st.data())
def test_a_timetable_made_again_and_moved_on_continues_identically(case: Case, data: st.DataObject) -> None:
    whole = instants_of(case)
    at, size = data.draw(st.integers(0, len(whole))), data.draw(st.sampled_from((1, 3, INSTANTS)))
    first, again = cursor_of(case), cursor_of(case)
    before = list(itertools.islice(stubs.instants_of(first), at))
    assert first.past == at
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(instant_arrays, "INSTANTS", size)
        passed = list(again.move_to(at))
        assert again.past == sum(map(len, passed)) == at
        assert before + list(stubs.instants_of(again)) == whole


# -- what is refused --------------------------------------------------------------------------------------

NAN, INF = math.nan, math.inf

BAD: list[tuple[str, dict[str, Any]]] = [
    *[("period", {"period": value}) for value in (0.0, -0.01, NAN, INF, 1e-10)],
    *[("plant_interval", {"plant_interval": value}) for value in (0.0, -1e-3, NAN, INF, 4e-10)],
    *[("clock_ratio", {"clock_ratio": value}) for value in (0.0, -1.0, NAN, INF)],
    *[(key, {key: value}) for key in ("offset", "delay", "delay_jitter") for value in (-1e-3, NAN, INF)],
    *[("jitter", {"jitter": value}) for value in (-1e-3, NAN, INF, 0.01, 0.02)],
    ("jitter", {"jitter": 0.006, "clock_ratio": 2.0}),
    ("period", {"period": 1e-9, "clock_ratio": 3.0}),
    *[(key, {key: value}) for key in ("measurement_loss", "command_loss") for value in (-0.1, 1.1, NAN, INF)],
    *[("burst_length", {"burst_length": value}) for value in (0.0, 0.99, -3.0, NAN, INF)],
    ("command_loss", {"command_loss": 0.8, "burst_length": 3.0}),
    ("measurement_loss", {"measurement_loss": 0.51, "burst_length": 1.0}),
    *[("noise", {"noise": {"position": value}}) for value in (-1.0, NAN, INF)],
    *[("quantisation", {"quantisation": {"position.x": value}}) for value in (-1.0, NAN, INF)],
    ("jitter", {"clock": "fmu", "jitter": 0.001}),
    ("clock_ratio", {"clock": "fmu", "clock_ratio": 1.1}),
    ("period", {"clock": "fmu", "period": 1.23456e-5 / 3}),
]


@pytest.mark.parametrize(("key", "values"), BAD, ids=[f"{key}-{values}" for key, values in BAD])
def test_a_timing_that_cannot_be_is_refused_in_one_line_that_names_the_key(key: str, values: dict[str, Any]) -> None:
    with pytest.raises(UsageError) as refused:
        Timing(**values)
    text = str(refused.value)
    assert text.startswith(f"timing.{key}")
    assert "expected" in text
    assert "\n" not in text


def test_the_defaults_are_those_of_the_contract() -> None:
    timing = Timing()
    assert (timing.period, timing.plant_interval) == (0.01, 0.001)
    assert (timing.order, timing.clock, timing.hold) == ("gauss-seidel", "master", "zero")
    off = ("offset", "delay", "delay_jitter", "jitter", "measurement_loss", "command_loss")
    assert all(getattr(timing, key) == 0.0 for key in off)
    assert timing.burst_length is None
    assert timing.clock_ratio == 1.0
    assert (timing.noise, timing.quantisation) == ({}, {})


def test_every_key_has_the_name_of_its_flag() -> None:
    values = {"order": "jacobi", "hold": "first", "clock": "fmu", "jitter_distribution": "normal"}
    for key in TIMING_KEYS:
        for command in ("run", "limit", "ssp"):
            named = [p.name for p in COMMANDS[command].params if f"--{key.replace('_', '-')}" in p.opts]
            assert named == [key], f"timing.{key}: expected its flag, a field of FlightFlags in command/flags.py"
        by_name = key in ("noise", "quantisation")
        given: Any = ["position=0.25"] if by_name else values.get(key, 1.0 if key == "burst_length" else 0.005)
        timing = FlightFlags(**{key: given}).applied_to(Scenario()).timing
        expected: dict[str, Any] = {key: {"position": 0.25} if by_name else given}
        assert timing == Timing(**expected)
        assert timing != Timing()


@given(st.integers(0, 10**12), st.integers(1, 10**6))
def test_seconds_are_read_as_the_decimal_that_is_written(whole: int, part: int) -> None:
    text = f"{whole}e-9"
    assert nanoseconds(float(text)) == whole
    assert nanoseconds(part / 10**6) == part * 1000
