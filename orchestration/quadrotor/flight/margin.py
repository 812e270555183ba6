"""The delays that a scenario's loop about hover tolerates: exact for constant ones, bounds for varying ones."""

from dataclasses import dataclass

from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.number_text import quantity
from orchestration.foundation.processes.passable import passable
from orchestration.quadrotor.flight.hover_limit import local_limit
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.systems.system.distribution import lowest
from orchestration.theory.stability.delay_bounds import SampledLoop, breaking_jitter, certain_jitter


@passable
@dataclass(frozen=True, kw_only=True)
class Margin:
    """Delay margins of the linear loop about hover, all in seconds."""

    period: float
    delay: float
    """Delay of every command, the smallest if it varies"""
    delay_limit: float | None
    """the largest constant delay, exact; None: every delay of the range is stable, or none"""
    certain_jitter: float
    """addition to the delay, different for each command, with which no sequence makes the loop unstable"""
    breaking_jitter: float | None
    """the smallest addition found that can make it unstable; None: no sequence that was tried does"""
    breaking_sequence: tuple[float, ...]
    """the shares of it, in turn, that do"""

    @property
    def verdict(self) -> str:
        """The delays of the command about hover that leave the loop stable."""
        if self.delay_limit is None:
            constant = "no constant delay of the range is its limit"
        else:
            constant = f"stable up to a constant delay of {quantity(self.delay_limit, 's')}"
        varying = f"and with any sequence of delays up to {quantity(self.delay + self.certain_jitter, 's')}"
        return f"{constant}, {varying}, sampled every {quantity(self.period, 's')} (small deviations from hover)"


def margin_of(scenario: Scenario) -> Margin:
    """The margin of a scenario; raises `UsageError` if it has no linear loop about hover."""
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
