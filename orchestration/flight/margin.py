"""The delays that a scenario's loop about hover stands: exactly where they are constant, by bounds where they vary."""

from dataclasses import dataclass

from orchestration.basics.errors import UsageError
from orchestration.flight.hover_loop import HoverLoop
from orchestration.flight.local_limit import local_limit
from orchestration.quadrotor.scenario import Scenario
from orchestration.stability.delay_bounds import SampledLoop, breaking_jitter, certain_jitter
from orchestration.system.distribution import lowest


@dataclass(frozen=True, kw_only=True)
class Margin:
    """All in seconds, of what is small about hover."""

    period: float
    delay: float
    """that every command has, the least where it varies"""
    delay_limit: float | None
    """the largest constant delay, exactly; None: none that is looked for is too much, or the least is"""
    certain_jitter: float
    """what may come to the delay, otherwise for each command, without any sequence making the loop unstable"""
    breaking_jitter: float | None
    """the least that was found to be too much; None: no sequence that was tried makes the loop unstable"""
    breaking_sequence: tuple[float, ...]
    """of the shares of it that do, in turn"""


def margin_of(scenario: Scenario) -> Margin:
    """The margin of a scenario; raises `UsageError` where its loop about hover cannot be had."""
    timing = scenario.timing
    if timing.hold != "zero" or timing.order != "gauss-seidel":
        raise UsageError("margin: expected hold zero and order gauss-seidel; the bounds are for no other")
    hover = HoverLoop.of(scenario)
    A, B, F = hover.continuous()
    period, delay = timing.period / timing.clock_ratio, lowest(timing.delay)
    loop = SampledLoop(A=A, B=B, F=F, period=period, delay=delay)
    limit = local_limit(hover, scenario, "delay")
    broken = None if limit is None else breaking_jitter(loop, max(limit - delay, 0.0) + period)
    return Margin(
        period=period,
        delay=delay,
        delay_limit=limit,
        certain_jitter=certain_jitter(loop),
        breaking_jitter=None if broken is None else broken[0],
        breaking_sequence=() if broken is None else broken[1],
    )
