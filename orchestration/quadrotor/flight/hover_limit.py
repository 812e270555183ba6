"""The local limits of the quadrotor about hover in period and delay, and the delays that its loop tolerates there."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

from orchestration.foundation.basics.bisection import Range, ends_of_good
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.unit_algebra import quantity
from orchestration.foundation.processes.passable import passable
from orchestration.quadrotor.flight.hover import NotSmooth, at_edge, at_hover
from orchestration.quadrotor.flight.hover_loop import HoverLoop
from orchestration.quadrotor.scenarios.scenario import Scenario
from orchestration.quadrotor.scenarios.timing import range_of
from orchestration.simulation.requests.ranges import Varied
from orchestration.systems.system.distribution import lowest
from orchestration.systems.system.paths import changed
from orchestration.systems.system.request import Request
from orchestration.theory.stability.delay_bounds import SampledLoop, breaking_jitter, certain_jitter
from orchestration.theory.stability.in_double import of_code
from orchestration.theory.stability.known_loops import KnownLoop, LinearLimit
from orchestration.theory.stability.local_limit import about_rest

HOVER = "spectral radius of the sampled loop about hover, by differences through saved states"
HOVER_ACCURACY = 1e-3
"""relative accuracy of the limit with these differences"""
KNOWN = ("period", "delay")
"""Quantities for which the loop about hover applies"""


def local_limits(varied: Varied, span: Range) -> LinearLimit:
    """The local limit of a quantity: of the loop about hover where that applies, else as for any system."""
    scenario = cast(Scenario, varied.request)
    if varied.of in ("jitter", "loss"):
        return LinearLimit(reason=f"linear theory has no local limit of {varied.of}")
    why = "the loop about hover is for period and delay only"
    try:
        if varied.of in KNOWN:
            return about_hover(scenario, varied.of)
    except NotSmooth as error:
        return LinearLimit(reason=f"no local limit: {error}")
    except UsageError as error:
        why = str(error)
    return _without_hover_loop(scenario, varied, span, why)


def radius_over(request: Request, of: str) -> Callable[[float], float] | None:
    """The spectral radius over a period or delay [s]; raises `UsageError` if there is no linear loop at hover."""
    if of not in KNOWN:
        return None
    scenario = cast(Scenario, request)
    loop = HoverLoop.of(scenario)
    return lambda value: radius(loop, scenario, of, value)


ABOUT_HOVER = KnownLoop(
    at_rest=lambda request: at_hover(cast(Scenario, request)), local_limits=local_limits, radius_over=radius_over
)
"""The loop of a `Scenario` about hover"""


def local_limit(loop: HoverLoop, scenario: Scenario, of: str) -> float | None:
    """Where the spectral radius first crosses one, up from the scenario's own period or delay [s]; None: nowhere."""
    span, own = range_of(scenario.timing, of), Varied(request=scenario, of=of).own
    assert span is not None
    low = min((*span.before, span.first))
    fine = [low + 0.001 * i for i in range(int((span.last - low) / 0.001))]
    bracket = ends_of_good(lambda value: radius(loop, scenario, of, value) >= 1.0, fine, own, 1e-6).upper
    return bracket.good if bracket is not None else None


def radius(loop: HoverLoop, scenario: Scenario, of: str, value: float) -> float:
    """The spectral radius of `scenario` about hover with another period or delay [s]."""
    timing = scenario.timing
    period = (value if of == "period" else timing.period) / timing.clock_ratio
    delay = (value if of == "delay" else lowest(timing.delay)) + (period if timing.order == "jacobi" else 0.0)
    return loop.spectral_radius(period, delay)


def about_hover(scenario: Scenario, of: str) -> LinearLimit:
    """The local limits of the quadrotor in period or delay, inside its boundary layer and just outside of it.

    Raises `UsageError` for a scenario without a linear loop about hover.
    """
    if scenario.timing.hold != "zero":
        raise UsageError("the loop about hover is for zero-order hold only")
    loop = HoverLoop.of(scenario)
    edge = at_edge(scenario)
    limit = local_limit(loop, scenario, of)
    return LinearLimit(
        limit=limit,
        outside=None if edge is None else local_limit(loop.with_law(edge), edge, of),
        method=f"{HOVER}{of_code(loop.in_double)}",
        accuracy=None if limit is None else HOVER_ACCURACY * limit,
        reason=""
        if limit is not None
        else "the spectral radius about hover stays below one to the end of the range, or is above it from the start",
    )


def _without_hover_loop(scenario: Scenario, varied: Varied, span: Range, why: str) -> LinearLimit:
    """The local limit of the quadrotor as of any other system, with the reason `why`."""
    try:
        hover = at_hover(scenario)
    except UsageError as error:
        return LinearLimit(reason=f"no local limit: {error}")
    found = about_rest(lambda value: changed(hover, dict.fromkeys(varied.paths, value)), span)
    if found.method is None:
        return replace(found, reason=f"{found.reason} ({why})")
    return replace(found, method=f"{found.method} ({why})")


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
    in_double: tuple[str, ...] = ()
    """the components whose float code in C is taken in double precision"""

    @property
    def verdict(self) -> str:
        """The delays of the command about hover that leave the loop stable."""
        if self.delay_limit is None:
            constant = "no constant delay of the range is its limit"
        else:
            constant = f"stable up to a constant delay of {quantity(self.delay_limit, 's')}"
        varying = f"and with any sequence of delays up to {quantity(self.delay + self.certain_jitter, 's')}"
        of = f"(small deviations from hover{of_code(self.in_double)})"
        return f"{constant}, {varying}, sampled every {quantity(self.period, 's')} {of}"


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
        in_double=hover.in_double,
    )
