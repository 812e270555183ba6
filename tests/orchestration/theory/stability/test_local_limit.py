"""Local limits by twin runs, which a second pulse has to confirm."""

from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest

from orchestration.foundation.basics.bisection import Range
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.component import Component, Sampling
from orchestration.systems.system.computers import Computer, Task
from orchestration.systems.system.model import System
from orchestration.theory.stability import local_limit, several_rates
from orchestration.theory.stability.known_loops import LinearLimit
from orchestration.theory.stability.operating_point import NotAnEquilibriumError, hyperperiod_of
from orchestration.theory.stability.perturbed_runs import Growth

SPAN = Range(first=0.05, step=0.05, last=1.0, tolerance=5e-3)
BLURRED = 0.2
"""Where the growth of a difference as small as the rounding of single precision seems to begin"""


def at(value: float) -> System:
    return System(stop_time=value, components={"one": Component(fmu="one.fmu", step=0.01)})


def test_deviations_that_decay_in_a_band_about_the_own_value_have_both_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    def growth(system: System, *_: Any, **__: Any) -> float:
        return (system.stop_time - 0.31) * (system.stop_time - 0.52)

    monkeypatch.setattr(local_limit, "growth_of_loop", growth)
    found = local_limit.about_rest(at, replace(SPAN, own=0.4))
    assert (found.lower, found.limit) == pytest.approx((0.31, 0.52), abs=2e-9)
    assert "this quantity changes nothing" in local_limit.about_rest(lambda value: at(0.4), SPAN).reason
    assert local_limit.about_rest(at, SPAN).reason == "small deviations grow at 50 ms, where the scan begins"

    def refused(system: System, *_: Any, **__: Any) -> float:
        if system.stop_time > 0.48:
            raise NotAnEquilibriumError("no rest")
        return -1.0

    monkeypatch.setattr(local_limit, "growth_of_loop", refused)
    assert local_limit.about_rest(at, replace(SPAN, own=0.4)).reason == (
        "no local limit: small deviations decay at what was tried before, 400 ms to 450 ms; at 500 ms: no rest"
    )
    monkeypatch.setattr(local_limit, "growth_of_loop", growth)
    below = local_limit.about_rest(at, replace(SPAN, last=0.48, own=0.4))
    assert below.reason == "small deviations decay at each value tried from 310 ms to 480 ms, where the scan ends"


def test_of_an_own_value_without_a_rest_that_of_an_end_is_near(monkeypatch: pytest.MonkeyPatch) -> None:
    def rests(system: System, _: Any, known: Any) -> None:
        if system.stop_time > 0.3:
            raise UsageError("no rest")
        known.start = system

    def growth(system: System, _: Any, factor: float = 1.0, known: Any = None) -> float:
        assert known.start.stop_time == 0.05
        return system.stop_time - 0.31

    monkeypatch.setattr(local_limit, "keep_start", rests)
    monkeypatch.setattr(local_limit, "growth_of_loop", growth)
    assert local_limit.about_rest(at, replace(SPAN, own=0.4)).limit == pytest.approx(0.31)


@pytest.mark.parametrize(("enough", "limit"), [(1.0, 0.5), (100.0, None), (1e9, None)])
def test_a_pulse_that_rounding_blurs_is_not_believed(
    monkeypatch: pytest.MonkeyPatch, enough: float, limit: float | None
) -> None:
    def growth(system: Any, _: Any, factor: float = 1.0, *others: Any) -> Growth:
        true = system.stop_time - 0.5
        return Growth(rate=true if factor >= enough else system.stop_time - BLURRED * factor**0.1, horizon=1.0)

    def refuse(*_: Any, **__: Any) -> Any:
        raise UsageError("no saved states")

    monkeypatch.setattr(local_limit, "growth_of", growth)
    monkeypatch.setattr(local_limit, "growth_of_loop", refuse)

    found = local_limit.about_rest(at, SPAN)
    assert found.limit == (limit if limit is None else pytest.approx(limit, abs=1e-2))
    assert ("depends on how small they are" in found.reason) == (limit is None)


@pytest.mark.parametrize(("small", "large"), [(-1.0, -1.0), (-1.0, 1.0)])
def test_beyond_a_schedule_that_repeats_deviations_decay_up_to_the_last_value_at_which_it_does(
    monkeypatch: pytest.MonkeyPatch, small: float, large: float
) -> None:
    """From 0.5 on it does not, and growth is by chance; a larger pulse has to decay, too."""

    def growth(system: Any, _: Any, factor: float = 1.0, *others: Any) -> Growth:
        chance = 1.0 if factor == 1.0 else -1.0
        known = large if factor == local_limit.OTHER_SIZE else small
        return Growth(rate=chance if system.stop_time >= 0.5 else known, horizon=1.0)

    def refuse(*_: Any, **__: Any) -> Any:
        raise UsageError("no saved states")

    monkeypatch.setattr(local_limit, "growth_of", growth)
    monkeypatch.setattr(local_limit, "growth_of_loop", refuse)
    monkeypatch.setattr(local_limit, "keep_start", lambda *_: None)
    monkeypatch.setattr(System, "uses_scheduler", True)
    monkeypatch.setattr(local_limit, "repeating_period", lambda nominal: 1.0 if nominal.stop_time < 0.49 else None)
    reason = local_limit.about_rest(at, SPAN).reason
    known = "small deviations decay at what was tried before, 50 ms to 487.5 ms; "
    assert reason.startswith(f"no local limit: {known if large < 0.0 else ''}at 5")
    assert "is not known to repeat" in reason


def test_growth_is_confirmed_on_the_side_of_a_limit_where_the_loop_is_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond 0.52 a task has no time left, and what is left of the loop is stable."""

    def growth(system: Any, *others: Any) -> Growth:
        return Growth(rate=-1.0 if system.stop_time > 0.52 else system.stop_time - 0.5, horizon=1.0)

    def refuse(*_: Any, **__: Any) -> Any:
        raise UsageError("no saved states")

    monkeypatch.setattr(local_limit, "growth_of", growth)
    monkeypatch.setattr(local_limit, "growth_of_loop", refuse)
    assert "decay at each value tried" in local_limit.about_rest(at, replace(SPAN, first=0.075)).reason
    found = local_limit.about_rest(at, replace(SPAN, first=0.075, also=(0.51,)))
    assert found.limit == pytest.approx(0.5, abs=2e-3)


def test_a_period_among_several_rates_has_no_limit_beyond_a_value_that_is_unstable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Between 0.15 and 0.2, both stable, a multiple of the other period is unstable, and what is just below it not."""

    def two(period: float) -> System:
        components = {
            name: Component(fmu=f"{name}.fmu", sampling=Sampling(period=each))
            for name, each in (("law", period), ("servo", 0.008))
        }
        return System(stop_time=9.0, components=components)

    def growth(system: System, *_: Any, **__: Any) -> float:
        sampling = system.components["law"].sampling
        assert sampling is not None
        return 1.0 if any(a < sampling.period < b for a, b in ((0.1911, 0.1914), (0.1915, 0.195), (0.9, 2.0))) else -1.0

    monkeypatch.setattr(local_limit, "growth_of_loop", growth)
    found = local_limit.about_rest(two, SPAN)
    assert found.limit is not None
    assert found.accuracy is not None
    assert (found.limit - found.accuracy, found.limit + found.accuracy) == pytest.approx((0.191, 0.1912))
    named = "local: small deviations grow at 191.2 ms, 191.6 ms to 192 ms, 904 ms to 1 s, of "
    assert found.reason.startswith(named)
    repeating = list[Fraction]()

    def decays(system: System, *_: Any, **__: Any) -> float:
        repeating.append(hyperperiod_of(system) or Fraction(0))
        return -1.0

    monkeypatch.setattr(local_limit, "growth_of_loop", decays)
    none = local_limit.about_rest(two, replace(SPAN, last=0.15))
    assert repeating == sorted(repeating, reverse=True), "a tangent over a long period serves shorter ones, too"
    assert none.limit is None
    assert none.reason.startswith("local: small deviations grow at none, of 15 values from 50 ms to 150 ms")
    monkeypatch.setattr(several_rates, "hyperperiod_of", lambda system: None)
    assert "at no value of the scan" in local_limit.about_rest(two, SPAN).reason


def test_beside_tasks_that_share_a_processor_few_values_are_examined_at_which_their_schedule_repeats_soon(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def shared(period: float) -> System:
        periods = {"law": period, "servo": 2e-4}
        tasks = {
            name: Task(component=name, period=each, execution=1e-5, priority=k)
            for k, (name, each) in enumerate(periods.items())
        }
        node = Computer(tasks={**tasks, "comms": Task(period=0.002, execution=1e-4, priority=2)})
        return System(
            stop_time=9.0, components={name: Component(fmu=f"{name}.fmu") for name in periods}, computers={"node": node}
        )

    tried = list[float]()

    def growth(system: System, *_: Any, **__: Any) -> float:
        tried.append(system.computers["node"].tasks["law"].period or 0.0)
        return tried[-1] - 0.0202

    monkeypatch.setattr(local_limit, "growth_of_loop", growth)
    shares = list[float]()
    span = Range(own=0.002, first=0.001, step=0.001, last=0.03, tolerance=1e-4, also=(0.0203125, 0.0204))
    found = local_limit.about_rest(shared, span, report=shares.append)
    assert found.limit == pytest.approx(0.0202, abs=1e-4)
    assert {0.0203125, 0.0204}.isdisjoint(tried)
    assert len(tried) < 60, "not at all 146 multiples of 0.2 ms"
    assert shares == sorted(shares)
    assert shares[-1] > 0.8

    def refused(*_: Any, **__: Any) -> float:
        raise UsageError("it repeats after 350 ms")

    monkeypatch.setattr(local_limit, "growth_of_loop", refused)
    beside = local_limit.about_rest(shared, span, lambda *_: LinearLimit(limit=0.02, method="by radii"))
    assert (beside.limit, beside.method) == (0.02, "by radii (no spectral radius: it repeats after 350 ms)")
    assert local_limit.about_rest(shared, span).reason.startswith("no local limit: several rates, and no spectral rad")
