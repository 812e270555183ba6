"""Local limits by radii at values that can be examined."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from orchestration.foundation.basics.bisection import Range
from orchestration.foundation.basics.errors import UsageError
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.system.computers import Computer, Task
from orchestration.systems.system.files import files_of
from orchestration.theory.exact import mean_square
from orchestration.theory.exact.examined_limit import METHOD, by_examined, local_limits
from tests.examples.common import native_example as example

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


def test_a_mean_square_limit_goes_on_beside_values_that_cannot_be_examined(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mean_square, "changed", lambda system, values: values["period"])
    loops: Any = SimpleNamespace(radius=lambda value, *, agree: radius(value))
    system: Any = SimpleNamespace(uses_scheduler=False)
    span = Range(**{**vars(SPAN), "own": 0.005, "also": (0.007391,)})
    found = mean_square._crossing(system, ["period"], span, loops)
    assert found.limit == pytest.approx(0.007705, abs=1e-5)
    assert found.lower is None
    assert found.reason.startswith("second moments are bounded at 7.7 ms and grow without bound at 7.71 ms, of values")
    assert "not examined: 7.391 ms" in found.reason


def test_second_moments_are_bounded_up_to_the_last_value_that_could_be_examined(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As of a jitter: from 8 ms on too many messages are in transit."""
    monkeypatch.setattr(mean_square, "changed", lambda system, values: values["jitter"])

    def radius(value: float, *, agree: float) -> float:
        if value > 0.0075:
            raise UsageError("too many messages")
        return 0.9

    found = mean_square._crossing(Any, ["jitter"], SPAN, SimpleNamespace(radius=radius))  # type: ignore[arg-type]
    assert found.limit is None
    assert found.reason == (
        "second moments are bounded at each value examined, 2 ms to 7 ms; not examined: 8 ms, 9 ms, 10 ms, as 8 ms "
        "for: too many messages"
    )


def test_between_values_too_far_apart_there_is_no_mean_square_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mean_square, "changed", lambda system, values: values["jitter"])

    def radius(value: float, *, agree: float) -> float:
        if 0.0075 < value < 0.0085:
            raise UsageError("too many messages")
        return 0.9 if value < 0.008 else 1.1

    found = mean_square._crossing(Any, ["jitter"], SPAN, SimpleNamespace(radius=radius))  # type: ignore[arg-type]
    assert found.limit is None
    assert "bounded at 7 ms and grow without bound at 9 ms, between which no value was found" in found.reason


GAIN, EXECUTION = 3.0 - 3.0**0.5, 0.2
LIMIT = 2.0 / GAIN + 2.0 * EXECUTION
"""Period [s] from which on small deviations grow, of x⁺ = x - (h - τ) K x - τ K x⁻, which oscillates there"""


def test_limits_of_a_task_period_are_those_of_theory_where_schedules_repeat_late() -> None:
    whole = example("minimum_variance")
    controller = replace(whole.components["controller"], sampling=None)
    control = Task(component="controller", period=1.0, priority=1, execution=EXECUTION)
    beside = Task(period=0.3, priority=2, execution=0.001)
    node = Computer(preemptive=True, tasks={"control": control, "beside": beside})
    system = replace(
        whole,
        components={**whole.components, "controller": controller},
        computers={"node": node},
        operating_point={"components.controller.parameters.gain": GAIN},
    )
    varied, models = (
        Varied(request=system, of="computers.node.tasks.control.period"),
        files_of(system).models_of(system),
    )
    span = Range(own=1.0, first=1.0, step=0.5, last=2.5, tolerance=0.1)
    found = local_limits(varied, span, models)
    assert found.limit is not None
    assert (found.method or "").startswith(METHOD)
    assert found.limit == pytest.approx(LIMIT, abs=found.accuracy or 0.0)
